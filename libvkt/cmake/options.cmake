# Compiler options that every target of the project shares.
add_library(vkt_options INTERFACE)
target_include_directories(vkt_options INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
target_compile_options(vkt_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion>
  # No contraction by the compiler: a kernel that wants a fused multiply-add says so, and results stay the same.
  $<$<COMPILE_LANGUAGE:CXX>:-ffp-contract=off -fno-math-errno>)
# Where several sources are one (see vkt_unite), a local name may be that of something in another of them.
set(united $<AND:$<COMPILE_LANGUAGE:CXX>,$<BOOL:$<TARGET_PROPERTY:UNITY_BUILD>>>)
target_compile_options(vkt_options INTERFACE
  $<${united}:-Wno-shadow> $<$<AND:${united},$<CXX_COMPILER_ID:GNU>>:-Wno-subobject-linkage>)
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

# vkt_unite(TARGET [LENGTH]): compiles sources of one folder, of formats/ those of one format, together, at most LENGTH (8)
# of them: what they include, and the templates that all of them use, takes longer than what they say. So a name in an
# anonymous namespace is the only one of its folder, or format. Sources with definitions of their own stay alone.
function(vkt_unite target)
  if(NOT VKT_UNITE)
    return()
  endif()
  set(length 8)
  if(ARGC GREATER 1)
    set(length ${ARGV1})
  endif()
  get_target_property(sources ${target} SOURCES)
  list(FILTER sources INCLUDE REGEX "[.]cpp$") # the others are objects of other targets
  list(FILTER sources EXCLUDE REGEX "^${PROJECT_BINARY_DIR}/") # of the generated ones tests have others
  foreach(source IN LISTS sources)
    get_filename_component(folder ${source} DIRECTORY)
    get_filename_component(group ${folder} NAME)
    if(group STREQUAL "formats")
      get_filename_component(name ${source} NAME)
      string(REGEX MATCH "^[a-z0-9]+" format ${name})
      string(APPEND group _${format})
    endif()
    if(NOT count_${group})
      set(count_${group} 0)
    endif()
    math(EXPR batch "${count_${group}} / ${length}")
    math(EXPR count_${group} "${count_${group}} + 1")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group}_${batch})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
endfunction()
