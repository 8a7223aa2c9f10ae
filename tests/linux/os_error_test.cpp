#include "tm485/linux/os_error.hpp"

#include <gmock/gmock.h>

#include <cerrno>
#include <set>

namespace tm485::linux_hal {
namespace {

using ::testing::HasSubstr;

TEST(OsError, KeepsTheErrnoAndNamesPathOperationAndCause) {
  const OsError error = make_os_error(Resource::serial_port, "/dev/ttyUSB7", "open", EACCES);
  EXPECT_EQ(error.error_number, EACCES);
  EXPECT_THAT(error.what, HasSubstr("/dev/ttyUSB7"));
  EXPECT_THAT(error.what, HasSubstr("open"));
  EXPECT_THAT(error.what, HasSubstr("Permission denied"));
  EXPECT_THAT(error.remedy, HasSubstr("dialout"));
  EXPECT_THAT(error.message(), HasSubstr(error.what));
  EXPECT_THAT(error.message(), HasSubstr(error.remedy));
}

TEST(OsError, AbsentDevicesArePortGoneAndTheRestIsBadArgument) {
  for (const int absent : {ENOENT, ENODEV, ENXIO})
    EXPECT_EQ(make_os_error(Resource::serial_port, "x", "open", absent).code, Errc::port_gone) << absent;
  for (const int other : {EACCES, EBUSY, ENOTTY, EIO, EINVAL})
    EXPECT_EQ(make_os_error(Resource::serial_port, "x", "open", other).code, Errc::bad_argument) << other;
}

TEST(OsError, EveryErrnoThatUsersMeetHasItsOwnRemedy) {
  std::set<std::string_view> serial{remedy_for(Resource::serial_port, 0)};
  for (const int number : {ENOENT, ENODEV, ENXIO, EACCES, EPERM, EBUSY, ENOTTY, EISDIR, EIO, EINVAL, EMFILE})
    EXPECT_TRUE(serial.insert(remedy_for(Resource::serial_port, number)).second) << number;
  std::set<std::string_view> socket{remedy_for(Resource::unix_socket, 0)};
  for (const int number : {ENOENT, ECONNREFUSED, EACCES, EAGAIN, EPROTOTYPE, ENAMETOOLONG, EINVAL, EMFILE})
    EXPECT_TRUE(socket.insert(remedy_for(Resource::unix_socket, number)).second) << number;
}

TEST(OsError, AnUnknownErrnoStillHasARemedy) {
  EXPECT_FALSE(remedy_for(Resource::serial_port, EXDEV).empty());
  EXPECT_FALSE(remedy_for(Resource::unix_socket, -1).empty());
}

}  // namespace
}  // namespace tm485::linux_hal
