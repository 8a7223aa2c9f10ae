# arm64 Linux with Debian's g++-aarch64-linux-gnu. The libraries that the command needs come from TM485_ARM64_ROOT, a
# folder that arm64 packages were unpacked into (tools/vm/packages.sh); the C and C++ libraries come with the compiler.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TM485_ARM64_ROOT)

set(TM485_ARM64_ROOT "" CACHE PATH "Folder with Debian's arm64 packages, unpacked")
if(NOT IS_DIRECTORY "${TM485_ARM64_ROOT}")
  message(FATAL_ERROR "TM485_ARM64_ROOT is no folder: \"${TM485_ARM64_ROOT}\" (tools/vm-test.sh makes one)")
endif()
set(CMAKE_FIND_ROOT_PATH "${TM485_ARM64_ROOT}" /usr/aarch64-linux-gnu)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)

# For libraries that are named without a path.
set(CMAKE_EXE_LINKER_FLAGS_INIT "-L${TM485_ARM64_ROOT}/usr/lib/aarch64-linux-gnu")

set(ENV{PKG_CONFIG_SYSROOT_DIR} "${TM485_ARM64_ROOT}")
set(ENV{PKG_CONFIG_LIBDIR}
  "${TM485_ARM64_ROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${TM485_ARM64_ROOT}/usr/share/pkgconfig")
