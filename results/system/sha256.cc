#include "results/system/sha256.h"

#include <openssl/evp.h>

#include "results/system/error.h"
#include "results/system/file.h"

namespace dreamsearch {

struct Sha256::State {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  ~State() { EVP_MD_CTX_free(context); }
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
  if (state_->context == nullptr ||
      EVP_DigestInit_ex(state_->context, EVP_sha256(), nullptr) != 1) {
    throw Failure(ExitCode::kInternal, "libcrypto offers no SHA-256");
  }
}

Sha256::~Sha256() = default;

void Sha256::Add(std::string_view bytes) {
  EVP_DigestUpdate(state_->context, bytes.data(), bytes.size());
}

std::array<unsigned char, Sha256::kBytes> Sha256::Finish() {
  std::array<unsigned char, kBytes> digest{};
  EVP_DigestFinal_ex(state_->context, digest.data(), nullptr);
  return digest;
}

std::string Sha256::FinishHex() {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const unsigned char byte : Finish()) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

std::string Sha256Hex(std::string_view bytes) {
  Sha256 sha256;
  sha256.Add(bytes);
  return sha256.FinishHex();
}

std::string Sha256HexOfFile(const std::filesystem::path& path) {
  Sha256 sha256;
  ReadFile(path, [&](std::string_view bytes) { sha256.Add(bytes); });
  return sha256.FinishHex();
}

}  // namespace dreamsearch
