// SHA-256 of a stream of bytes. The simulation core has none: the programs take OpenSSL's (sha256_openssl.cpp), the
// Python module hashlib's (python/src/sha256.cpp).
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
