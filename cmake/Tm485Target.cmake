# What every target of the stack has in common. All of it is private to the target: a program that links the stack
# gets an include folder and the language standard, and no flag, warning or definition besides.

# tm485_target(<target> [NO_EXCEPTIONS])
#   NO_EXCEPTIONS  build without exceptions and run-time type information, as on a microcontroller
function(tm485_target target)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "NO_EXCEPTIONS" "" "")
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  target_compile_features(${target} PUBLIC cxx_std_23)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow
    $<$<COMPILE_LANG_AND_ID:CXX,Clang>:-Wreserved-identifier>)
  if(TM485_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(ARG_NO_EXCEPTIONS)
    target_compile_options(${target} PRIVATE "$<$<COMPILE_LANGUAGE:CXX>:-fno-exceptions;-fno-rtti>")
  endif()
endfunction()

# tm485_library(<name> SOURCES <files> LINK <targets> [NO_EXCEPTIONS])
#   the static library tm485_<name>, alias tm485::<name>, with its public headers in ./include
function(tm485_library name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "NO_EXCEPTIONS" "" "SOURCES;LINK")
  set(target tm485_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(tm485::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(${target} PUBLIC
    "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>"
    "$<INSTALL_INTERFACE:include>")
  target_link_libraries(${target} PUBLIC ${ARG_LINK})
  if(ARG_NO_EXCEPTIONS)
    tm485_target(${target} NO_EXCEPTIONS)
  else()
    tm485_target(${target})
  endif()
endfunction()

# tm485_precompiled(<target> <header>): what the header includes is compiled once for all C++ sources of the target, with
# TM485_FAST_BUILD. A source includes what it needs all the same: builds without the option (clang-dev, tsan, release) notice.
function(tm485_precompiled target header)
  if(TM485_FAST_BUILD)
    target_precompile_headers(${target} PRIVATE "$<$<COMPILE_LANGUAGE:CXX>:${CMAKE_CURRENT_SOURCE_DIR}/${header}>")
  endif()
endfunction()

# tm485_hardened(<target>): for programs of the host that read what others give them: tables and calls that an attacker
# cannot overwrite, a guard on each stack frame, checked string functions, and (programs) a random address.
# tests/hardening looks at the result. Not with a sanitizer, whose checks these would hide.
include(CheckPIESupported)
check_pie_supported(LANGUAGES CXX)
function(tm485_hardened target)
  if(CMAKE_CXX_FLAGS MATCHES "-fsanitize|--coverage")
    return()
  endif()
  # Without optimisation glibc warns of _FORTIFY_SOURCE.
  target_compile_options(${target} PRIVATE -fstack-protector-strong
    "$<$<NOT:$<CONFIG:Debug>>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=3>")
  get_target_property(type ${target} TYPE)
  if(type STREQUAL "EXECUTABLE")
    set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    target_link_options(${target} PRIVATE -Wl,-z,relro,-z,now,-z,noexecstack)
  endif()
endfunction()
