// SHA-256 by OpenSSL.
#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <stdexcept>

#include "run_folder/sha256.hpp"

namespace abs_hil::run_folder {

struct Sha256::State {
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context{EVP_MD_CTX_new(), EVP_MD_CTX_free};
  static void check(int status) {
    if (status != 1) throw std::runtime_error("SHA-256 is not available in this OpenSSL");
  }
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
  State::check(state_->context ? EVP_DigestInit_ex(state_->context.get(), EVP_sha256(), nullptr) : 0);
}

Sha256::~Sha256() = default;

void Sha256::add(std::string_view bytes) {
  State::check(EVP_DigestUpdate(state_->context.get(), bytes.data(), bytes.size()));
}

std::string Sha256::hex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  State::check(EVP_DigestFinal_ex(state_->context.get(), digest.data(), &size));
  std::string text;
  for (unsigned int i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
  return text;
}

}  // namespace abs_hil::run_folder
