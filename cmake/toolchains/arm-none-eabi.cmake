# Cortex-M with Debian's gcc-arm-none-eabi and newlib. TM485_ARM_CPU chooses the core.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES TM485_ARM_CPU)

set(TM485_ARM_CPU cortex-m4 CACHE STRING "cortex-m0plus, cortex-m4 (with FPU) or cortex-m7 (with double-precision FPU)")
set_property(CACHE TM485_ARM_CPU PROPERTY STRINGS cortex-m0plus cortex-m4 cortex-m7)

if(TM485_ARM_CPU STREQUAL "cortex-m0plus")
  set(_fpu "-mfloat-abi=soft")
elseif(TM485_ARM_CPU STREQUAL "cortex-m4")
  set(_fpu "-mfloat-abi=hard -mfpu=fpv4-sp-d16")
elseif(TM485_ARM_CPU STREQUAL "cortex-m7")
  set(_fpu "-mfloat-abi=hard -mfpu=fpv5-d16")
else()
  message(FATAL_ERROR "TM485_ARM_CPU is \"${TM485_ARM_CPU}\"; it may be cortex-m0plus, cortex-m4 or cortex-m7")
endif()
set(CMAKE_CXX_FLAGS_INIT
  "-mcpu=${TM485_ARM_CPU} -mthumb ${_fpu} -ffunction-sections -fdata-sections -fno-exceptions -fno-rtti -fno-threadsafe-statics")

set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
