# Compiler options that every target of the project shares.
add_library(vkt_options INTERFACE)
target_include_directories(vkt_options INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
target_compile_options(vkt_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion>
  # No contraction by the compiler: a kernel that wants a fused multiply-add says so, and results stay the same.
  $<$<COMPILE_LANGUAGE:CXX>:-ffp-contract=off -fno-math-errno>)
if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  # GCC takes the first two as meant; the third says that unoptimised builds do not vectorise.
  target_compile_options(vkt_options INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:-Wno-implicit-float-conversion -Wno-implicit-int-float-conversion -Wno-pass-failed>)
endif()

if(VKT_SANITIZE)
  # Instrumented code sets off warnings that the plain build does not have, so none are looked for here: a sixth of the
  # time to compile. As much again are line numbers, which the thread sanitizer's reports do without.
  set(checks -g0)
  if(VKT_SANITIZE MATCHES "address")
    # What the address sanitizer finds by itself; a sixth of the time to compile.
    set(checks -fno-sanitize=null,object-size -g1)
    # Kernels compute with pointers all the time: to look for overflow there is half of the time that rays take to compile.
    list(APPEND checks $<$<BOOL:$<TARGET_PROPERTY:VKT_IS_BACKEND>>:-fno-sanitize=pointer-overflow>)
  endif()
  target_compile_options(vkt_options INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${VKT_SANITIZE} ${checks} -fno-omit-frame-pointer -fno-sanitize-recover=all -w>)
  target_link_options(vkt_options INTERFACE -fsanitize=${VKT_SANITIZE})
else()
  target_compile_options(vkt_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Werror>)
endif()

# vkt_precompile(TARGET [HEADER…]): reads the headers that most sources include once. Sources name what they use all the
# same: clang-tidy reads them without (tests/lint.sh).
function(vkt_precompile target)
  if(VKT_PRECOMPILE)
    target_precompile_headers(${target} PRIVATE <algorithm> <array> <cmath> <cstdint> <cstring> <functional> <limits>
      <map> <memory> <optional> <span> <string> <string_view> <utility> <vector> ${ARGN})
  endif()
endfunction()
