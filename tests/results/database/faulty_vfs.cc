#include "tests/results/database/faulty_vfs.h"

#include <signal.h>

namespace dreamsearch::results {
namespace {

Fault the_fault = Fault::kNone;
int the_call = 0;
int calls = 0;

// SQLITE_OK, or what the call is to fail with.
int CountCall(int io_error) {
  if (++calls != the_call) return SQLITE_OK;
  switch (the_fault) {
    case Fault::kNone:
      return SQLITE_OK;
    case Fault::kKill:
      raise(SIGKILL);
      return SQLITE_OK;
    case Fault::kDiskFull:
      return SQLITE_FULL;
    case Fault::kInputOutputError:
      return io_error;
  }
  return SQLITE_OK;
}

struct File {
  sqlite3_file base;
  sqlite3_file* real;  // behind this struct
};
sqlite3_file* Real(sqlite3_file* file) { return reinterpret_cast<File*>(file)->real; }

sqlite3_vfs* real_vfs = nullptr;

const sqlite3_io_methods kMethods = {
    3,
    [](sqlite3_file* f) { return Real(f)->pMethods->xClose(Real(f)); },
    [](sqlite3_file* f, void* data, int size, sqlite3_int64 at) {
      return Real(f)->pMethods->xRead(Real(f), data, size, at);
    },
    [](sqlite3_file* f, const void* data, int size, sqlite3_int64 at) {
      const int code = CountCall(SQLITE_IOERR_WRITE);
      return code != SQLITE_OK ? code : Real(f)->pMethods->xWrite(Real(f), data, size, at);
    },
    [](sqlite3_file* f, sqlite3_int64 size) {
      const int code = CountCall(SQLITE_IOERR_TRUNCATE);
      return code != SQLITE_OK ? code : Real(f)->pMethods->xTruncate(Real(f), size);
    },
    [](sqlite3_file* f, int flags) {
      const int code = CountCall(SQLITE_IOERR_FSYNC);
      return code != SQLITE_OK ? code : Real(f)->pMethods->xSync(Real(f), flags);
    },
    [](sqlite3_file* f, sqlite3_int64* size) {
      return Real(f)->pMethods->xFileSize(Real(f), size);
    },
    [](sqlite3_file* f, int lock) { return Real(f)->pMethods->xLock(Real(f), lock); },
    [](sqlite3_file* f, int lock) { return Real(f)->pMethods->xUnlock(Real(f), lock); },
    [](sqlite3_file* f, int* out) { return Real(f)->pMethods->xCheckReservedLock(Real(f), out); },
    [](sqlite3_file* f, int op, void* arg) {
      return Real(f)->pMethods->xFileControl(Real(f), op, arg);
    },
    [](sqlite3_file* f) { return Real(f)->pMethods->xSectorSize(Real(f)); },
    [](sqlite3_file* f) { return Real(f)->pMethods->xDeviceCharacteristics(Real(f)); },
    [](sqlite3_file* f, int page, int size, int extend, void volatile** out) {
      return Real(f)->pMethods->xShmMap(Real(f), page, size, extend, out);
    },
    [](sqlite3_file* f, int offset, int n, int flags) {
      return Real(f)->pMethods->xShmLock(Real(f), offset, n, flags);
    },
    [](sqlite3_file* f) { Real(f)->pMethods->xShmBarrier(Real(f)); },
    [](sqlite3_file* f, int remove) { return Real(f)->pMethods->xShmUnmap(Real(f), remove); },
    [](sqlite3_file* f, sqlite3_int64 at, int size, void** out) {
      return Real(f)->pMethods->xFetch(Real(f), at, size, out);
    },
    [](sqlite3_file* f, sqlite3_int64 at, void* page) {
      return Real(f)->pMethods->xUnfetch(Real(f), at, page);
    },
};

int Open(sqlite3_vfs*, const char* name, sqlite3_file* file, int flags, int* out_flags) {
  File* mine = reinterpret_cast<File*>(file);
  mine->real = reinterpret_cast<sqlite3_file*>(mine + 1);
  mine->real->pMethods = nullptr;
  const int code = real_vfs->xOpen(real_vfs, name, mine->real, flags, out_flags);
  mine->base.pMethods = mine->real->pMethods != nullptr ? &kMethods : nullptr;
  return code;
}

int Delete(sqlite3_vfs*, const char* name, int sync) {
  const int code = CountCall(SQLITE_IOERR_DELETE);
  return code != SQLITE_OK ? code : real_vfs->xDelete(real_vfs, name, sync);
}

}  // namespace

void InstallFaultyVfs(Fault fault, int n) {
  the_fault = fault;
  the_call = n;
  calls = 0;
  if (real_vfs != nullptr) return;
  real_vfs = sqlite3_vfs_find(nullptr);
  // All that is not a file's comes from the real one as it is.
  static sqlite3_vfs vfs;
  vfs = *real_vfs;
  vfs.szOsFile = static_cast<int>(sizeof(File)) + real_vfs->szOsFile;
  vfs.pNext = nullptr;
  vfs.zName = "faulty";
  vfs.xOpen = Open;
  vfs.xDelete = Delete;
  sqlite3_vfs_register(&vfs, 1);
}

int WriteCalls() { return calls; }

}  // namespace dreamsearch::results
