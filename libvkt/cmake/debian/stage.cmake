# Run by cpack between installation and packing: what Debian asks of packages and other systems do not.
# Dependencies are told by dpkg-shlibdeps: those of the command and the library are needed, those of modules recommended.
set(top "${CPACK_TEMPORARY_DIRECTORY}")
set(library "usr/${CPACK_VKT_LIBRARY_FOLDER}")
set(documents "${CPACK_VKT_DEBIAN_FOLDER}")

function(vkt_compress)
  execute_process(COMMAND gzip -9n ${ARGN} RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "gzip fails: ${ARGN}")
  endif()
endfunction()

# vkt_dependencies(RESULT FIELD FILE…): packages with the libraries that these files need, but for our own.
function(vkt_dependencies result field)
  set(work "${top}/shlibdeps")
  file(MAKE_DIRECTORY "${work}/debian")
  file(WRITE "${work}/debian/control" "Source: vkt\n\nPackage: vkt\nArchitecture: any\n")
  execute_process(COMMAND dpkg-shlibdeps -O "-d${field}" --ignore-missing-info
      "-l${top}/runtime/${library}" ${ARGN}
    WORKING_DIRECTORY "${work}" OUTPUT_VARIABLE said ERROR_VARIABLE complaints RESULT_VARIABLE failed)
  file(REMOVE_RECURSE "${work}")
  if(failed)
    message(FATAL_ERROR "dpkg-shlibdeps fails: ${complaints}")
  endif()
  string(REGEX REPLACE "^shlibs:[A-Za-z]+=" "" said "${said}")
  string(STRIP "${said}" said)
  set(${result} "${said}" PARENT_SCOPE)
endfunction()

# Seconds since 1970 that the changelog names: those of the environment, else those of the build.
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
set(changelog "vkt (${CPACK_PACKAGE_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}) unstable; urgency=medium

  * Version ${CPACK_PACKAGE_VERSION}, packed by its own build.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")

foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${component} upper)
  set(package ${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  set(root "${top}/${component}")
  set(own "${root}/usr/share/doc/${package}")
  file(MAKE_DIRECTORY "${own}" "${root}/usr/share/lintian/overrides")
  # The licence is in the copyright.
  file(REMOVE "${own}/LICENSE")
  file(COPY_FILE "${documents}/copyright" "${own}/copyright")
  file(WRITE "${own}/changelog.Debian" "${changelog}")
  vkt_compress("${own}/changelog.Debian")
  if(EXISTS "${documents}/${package}.lintian-overrides")
    file(COPY_FILE "${documents}/${package}.lintian-overrides" "${root}/usr/share/lintian/overrides/${package}")
  else()
    file(REMOVE_RECURSE "${root}/usr/share/lintian")
  endif()
  file(GLOB pages "${root}/usr/share/man/man*/*.[1-9]")
  if(pages)
    vkt_compress(${pages})
  endif()
endforeach()

set(runtime "${top}/runtime")
# Completion of zsh lies where Debian's looks for it.
if(EXISTS "${runtime}/usr/share/zsh/site-functions")
  file(MAKE_DIRECTORY "${runtime}/usr/share/zsh/vendor-completions")
  file(RENAME "${runtime}/usr/share/zsh/site-functions/_vkt" "${runtime}/usr/share/zsh/vendor-completions/_vkt")
  file(REMOVE_RECURSE "${runtime}/usr/share/zsh/site-functions")
endif()
# Python's packages of any version have a folder of their own, as deep as that of one version.
file(GLOB site "${top}/python/usr/lib/python3.*/site-packages")
if(site)
  file(MAKE_DIRECTORY "${top}/python/usr/lib/python3")
  file(RENAME "${site}" "${top}/python/usr/lib/python3/dist-packages")
  get_filename_component(versioned "${site}" DIRECTORY)
  file(REMOVE_RECURSE "${versioned}")
endif()

file(GLOB libraries "${runtime}/${library}/libvkt.so.*")
file(GLOB modules "${runtime}/${library}/vkt/*.so")
file(GLOB python "${top}/python/usr/lib/python3/dist-packages/vkt/*.so")
vkt_dependencies(CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS Depends "${runtime}/usr/bin/vkt" ${libraries}
  "${runtime}/${library}/vkt/vkt_parser")
if(modules)
  vkt_dependencies(recommended Recommends ${modules})
  # What is needed anyway is not recommended besides.
  string(REPLACE ", " ";" needed "${CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS}")
  string(REPLACE ", " ";" recommended "${recommended}")
  set(kept "")
  foreach(entry IN LISTS recommended)
    string(REGEX REPLACE " .*" "" name "${entry}")
    set(there OFF)
    foreach(other IN LISTS needed)
      string(REGEX REPLACE " .*" "" other "${other}")
      if(other STREQUAL name)
        set(there ON)
      endif()
    endforeach()
    if(NOT there)
      list(APPEND kept "${entry}")
    endif()
  endforeach()
  list(JOIN kept ", " CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS)
endif()
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SUGGESTS "gnuplot-nox | gnuplot")
if(python)
  vkt_dependencies(needed Depends ${python})
  string(APPEND CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS ", ${needed}")
endif()
