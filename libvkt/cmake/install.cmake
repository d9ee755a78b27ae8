# cmake --install: library, headers, CMake package and pkg-config file, all found from where they lie.
include(CMakePackageConfigHelpers)

# What the library itself links to.
set(VKT_LINKED_PARTS ${VKT_FOUND_PARTS})
list(REMOVE_ITEM VKT_LINKED_PARTS VIEWER)
if(VKT_MODULES)
  list(REMOVE_ITEM VKT_LINKED_PARTS HDF5 OPENVDB TIFF GDCM BLOSC KISSFFT OPENEXR FREETYPE)
endif()

set(destination ${CMAKE_INSTALL_LIBDIR}/cmake/vkt)
install(TARGETS vkt EXPORT vktTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} NAMELINK_COMPONENT development)
install(EXPORT vktTargets NAMESPACE vkt:: DESTINATION ${destination} COMPONENT development)
configure_package_config_file(libvkt/cmake/vktConfig.cmake.in ${PROJECT_BINARY_DIR}/vktConfig.cmake
  INSTALL_DESTINATION ${destination})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/vktConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/vktConfig.cmake ${PROJECT_BINARY_DIR}/vktConfigVersion.cmake
  libvkt/cmake/imports.cmake DESTINATION ${destination} COMPONENT development)

# Headers keep their paths: #include "libvkt/core/volume.h". Those of the C API are <vkt/vkt.h> and <vkt/volkit.h>, too.
# Those of modules are left out: they stand on libraries that a program on libvkt does not need.
install(DIRECTORY libvkt DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development FILES_MATCHING PATTERN "*.h"
  PATTERN c EXCLUDE PATTERN cmake EXCLUDE PATTERN cuda EXCLUDE PATTERN python EXCLUDE
  PATTERN formats/gdcm EXCLUDE PATTERN formats/hdf5 EXCLUDE PATTERN formats/openvdb EXCLUDE PATTERN formats/tiff EXCLUDE)
foreach(folder libvkt/c vkt)
  install(FILES libvkt/c/vkt.h libvkt/c/volkit.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder} COMPONENT development)
endforeach()

# A static library leaves its own dependencies to the one who links it; a shared one needs none of them there.
file(RELATIVE_PATH VKT_PC_PREFIX /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" VKT_PC_PREFIX "${VKT_PC_PREFIX}")
set(VKT_PC_LIBS "")
set(VKT_PC_REQUIRES "")
set(VKT_PC_RPATH "")
if(BUILD_SHARED_LIBS) # wherever the prefix is, programs find the library there
  set(VKT_PC_RPATH " -Wl,-rpath,\${libdir}")
endif()
if(NOT BUILD_SHARED_LIBS)
  set(VKT_PC_REQUIRES "Requires: zlib libpng\n")
  set(VKT_PC_LIBS " -lstdc++ ${OpenMP_CXX_FLAGS} -pthread -lm")
  if(VKT_HAVE_BZIP2)
    string(APPEND VKT_PC_LIBS " -lbz2")
  endif()
  foreach(part IN LISTS VKT_LINKED_PARTS)
    foreach(target IN LISTS VKT_TARGETS_${part})
      get_target_property(location ${target} IMPORTED_LOCATION)
      get_filename_component(name ${location} NAME_WE)
      string(REGEX REPLACE "^lib" " -l" flag ${name})
      string(APPEND VKT_PC_LIBS ${flag})
    endforeach()
  endforeach()
endif()
configure_file(libvkt/cmake/vkt.pc.in ${PROJECT_BINARY_DIR}/vkt.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/vkt.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)

install(FILES shell/completion/vkt.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME vkt)
install(FILES shell/completion/_vkt DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
install(FILES shell/completion/vkt.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
install(FILES LICENSE README.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY examples/data DESTINATION ${CMAKE_INSTALL_DATADIR}/vkt FILES_MATCHING PATTERN "*.nrrd")
