// SHA-256 of a stream of bytes. The programs take OpenSSL's, which uses the processor's own instructions
// (sha256_openssl.cpp); the simulation core needs no library for it (sha256_own.cpp). A program links one of the two.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace abs_hil::run_folder {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  void add(std::string_view bytes);
  /// 64 hexadecimal digits. Call it once, at the end.
  [[nodiscard]] std::string hex();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace abs_hil::run_folder
