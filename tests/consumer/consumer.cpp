// What a user's first program needs of an installation: headers, libraries, and the two of one version.
#include <cstdio>

#include "tm485/errc.hpp"
#include "tm485/version.hpp"

int main() {
  const tm485::Version version = tm485::version();
  const std::string_view error = tm485::name(tm485::Errc::crc_error);
  std::printf("tm485 %.*s, %.*s\n", static_cast<int>(version.text.size()), version.text.data(),
              static_cast<int>(error.size()), error.data());
  return version.text == TM485_VERSION_STRING && error == "crc_error" ? 0 : 1;
}
