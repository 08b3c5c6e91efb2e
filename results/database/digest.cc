#include "results/database/digest.h"

#include <openssl/evp.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <vector>

#include "results/system/error.h"

namespace dreamsearch::results {
namespace {

struct FreeContext {
  void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
};
using Context = std::unique_ptr<EVP_MD_CTX, FreeContext>;

Context NewSha256() {
  Context context(EVP_MD_CTX_new());
  if (context == nullptr || EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr) != 1) {
    throw Error(kExitInternal, "libcrypto offers no SHA-256");
  }
  return context;
}

std::string Hex(EVP_MD_CTX* context) {
  unsigned char bytes[EVP_MAX_MD_SIZE];
  unsigned size = 0;
  EVP_DigestFinal_ex(context, bytes, &size);
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (unsigned i = 0; i < size; ++i) {
    text += kDigits[bytes[i] >> 4];
    text += kDigits[bytes[i] & 15];
  }
  return text;
}

}  // namespace

std::string Sha256Hex(std::string_view bytes) {
  const Context context = NewSha256();
  EVP_DigestUpdate(context.get(), bytes.data(), bytes.size());
  return Hex(context.get());
}

std::string Sha256HexOfFile(const std::string& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"),
                                                             std::fclose);
  if (file == nullptr) {
    throw Error(errno == EACCES ? kExitPermission : kExitNoInput,
                path + ": cannot be read: " + std::strerror(errno));
  }
  const Context context = NewSha256();
  std::vector<char> buffer(1 << 16);
  std::size_t size;
  while ((size = std::fread(buffer.data(), 1, buffer.size(), file.get())) > 0) {
    EVP_DigestUpdate(context.get(), buffer.data(), size);
  }
  if (std::ferror(file.get()) != 0) {
    throw Error(kExitInputOutput, path + ": cannot be read: " + std::strerror(errno));
  }
  return Hex(context.get());
}

}  // namespace dreamsearch::results
