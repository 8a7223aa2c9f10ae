# Installs a build and builds the consumer twice: by find_package, and by pkg-config and the bare compiler.
# Then the examples, each as a project of its own.
#   cmake -DSOURCE= -DEXAMPLES= -DBUILD= -DCONFIG= -DCOMPILER= -DC_COMPILER= -DFLAGS= -DVERSION= -P run.cmake
set(work ${BUILD}/consumer)
set(prefix ${work}/prefix)
file(REMOVE_RECURSE ${work})

# run(<what it shows> <command...>); the command's output is left in `output`.
function(run what)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE errors)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " line)
    message(FATAL_ERROR "${what} failed (${result}): ${line}\n${output}\n${errors}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

run("installing" ${CMAKE_COMMAND} --install ${BUILD} --config "${CONFIG}" --prefix ${prefix})

run("configuring by find_package" ${CMAKE_COMMAND} -S ${SOURCE} -B ${work}/find_package -G Ninja
  -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_FLAGS=${FLAGS} -DCMAKE_BUILD_TYPE=${CONFIG})
run("building by find_package" ${CMAKE_COMMAND} --build ${work}/find_package)
run("running what find_package built" ${work}/find_package/consumer)
if(NOT output MATCHES "^tm485 ${VERSION}, ")
  message(FATAL_ERROR "the program built by find_package says: ${output}")
endif()

file(GLOB_RECURSE pc ${prefix}/tm485.pc)
get_filename_component(pc_folder ${pc} DIRECTORY)
set(ENV{PKG_CONFIG_PATH} ${pc_folder})
run("asking pkg-config for the version" pkg-config --modversion tm485)
string(STRIP "${output}" output)
if(NOT output STREQUAL VERSION)
  message(FATAL_ERROR "pkg-config reports version ${output}, not ${VERSION}")
endif()
run("asking pkg-config for flags" pkg-config --cflags --libs tm485)
separate_arguments(pc_flags UNIX_COMMAND "${output}")
separate_arguments(own_flags UNIX_COMMAND "${FLAGS}")
run("building by pkg-config" ${COMPILER} -std=c++23 -Wall -Wextra -Werror ${own_flags} ${SOURCE}/consumer.cpp
  -o ${work}/by_pkg_config ${pc_flags})
run("running what pkg-config built" ${work}/by_pkg_config)
if(NOT output MATCHES "^tm485 ${VERSION}, ")
  message(FATAL_ERROR "the program built by pkg-config says: ${output}")
endif()

file(GLOB examples RELATIVE ${EXAMPLES} ${EXAMPLES}/*)
file(GLOB_RECURSE design ${prefix}/libtm485_design.a)
if(NOT design)
  list(REMOVE_ITEM examples servo_loop)  # it needs tm485::design, which is built where Eigen is installed
endif()
foreach(example IN LISTS examples)
  run("configuring ${example}" ${CMAKE_COMMAND} -S ${EXAMPLES}/${example} -B ${work}/${example} -G Ninja
    -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_FLAGS=${FLAGS} -DCMAKE_C_COMPILER=${C_COMPILER}
    -DCMAKE_BUILD_TYPE=${CONFIG})
  run("building ${example}" ${CMAKE_COMMAND} --build ${work}/${example})
  if(EXISTS ${EXAMPLES}/${example}/run.sh)  # on a simulated encoder of the installed command
    file(GLOB command ${prefix}/bin/tm485)
    if(command)
      run("running ${example}" ${EXAMPLES}/${example}/run.sh ${work}/${example}/${example} ${command})
    endif()
  else()
    run("running ${example}" ${work}/${example}/${example})
  endif()
endforeach()
