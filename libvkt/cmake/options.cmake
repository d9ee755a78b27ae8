# Compiler options that every target of the project shares.
add_library(vkt_options INTERFACE)
target_include_directories(vkt_options INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
target_compile_options(vkt_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -Werror>
  # No contraction by the compiler: a kernel that wants a fused multiply-add says so, and results stay the same.
  $<$<COMPILE_LANGUAGE:CXX>:-ffp-contract=off -fno-math-errno>)
if(VKT_SANITIZE)
  target_compile_options(vkt_options INTERFACE
    $<$<COMPILE_LANGUAGE:CXX>:-fsanitize=${VKT_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all -g>)
  target_link_options(vkt_options INTERFACE -fsanitize=${VKT_SANITIZE})
endif()
