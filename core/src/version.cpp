#include "tm485/version.hpp"

namespace tm485 {

Version version() noexcept {
  return {TM485_VERSION_MAJOR, TM485_VERSION_MINOR, TM485_VERSION_PATCH, TM485_VERSION_STRING};
}

}  // namespace tm485
