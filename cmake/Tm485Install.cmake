# Installation: headers, static libraries, the command, find_package(tm485) and pkg-config's tm485.pc.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(libraries tm485_core tm485_c)
set(header_folders core/include/ core/c/include/)
foreach(pair IN ITEMS "tm485_hal_mcu hal/mcu/include/" "tm485_hal_posix hal/posix/include/" "tm485_design core/design/include/" "tm485_sim hal/sim/include/" "tm485_sim_server hal/sim/include/" "tm485_hal_linux hal/linux/include/")
  separate_arguments(pair)
  list(GET pair 0 target)
  list(GET pair 1 folder)
  if(TARGET ${target})
    list(APPEND libraries ${target})
    list(APPEND header_folders ${folder})
  endif()
endforeach()
list(REMOVE_DUPLICATES header_folders)

install(TARGETS ${libraries} EXPORT tm485Targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY ${header_folders} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp")
if(TARGET tm485)
  install(TARGETS tm485 RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/tm485)
install(EXPORT tm485Targets NAMESPACE tm485:: DESTINATION ${package_folder})
configure_package_config_file(cmake/tm485Config.cmake.in ${PROJECT_BINARY_DIR}/tm485Config.cmake
  INSTALL_DESTINATION ${package_folder} NO_SET_AND_CHECK_MACRO)
# Before 1.0.0 a minor version may change an interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tm485ConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tm485Config.cmake ${PROJECT_BINARY_DIR}/tm485ConfigVersion.cmake
  DESTINATION ${package_folder})

# A static library comes before those that it needs; one of headers only is no file.
set(TM485_PC_LIBS "")
foreach(target IN LISTS libraries)
  get_target_property(type ${target} TYPE)
  if(NOT type STREQUAL "INTERFACE_LIBRARY")
    string(PREPEND TM485_PC_LIBS " -l${target}")
  endif()
endforeach()
set(pc_folder ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
file(RELATIVE_PATH TM485_PC_PREFIX "/p/${pc_folder}" /p)
configure_file(cmake/tm485.pc.in ${PROJECT_BINARY_DIR}/tm485.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/tm485.pc DESTINATION ${pc_folder})
