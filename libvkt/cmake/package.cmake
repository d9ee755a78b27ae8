# cpack: Debian packages of what was built, and the archive of the source.
#
# vkt            the command, libvkt, its modules, manual pages, completion
# libvkt-dev     headers, CMake package, pkg-config file
# python3-vkt    the Python package
#
# Modules are in the package of the command, since they are small; the libraries that they alone need are recommended, so
# that apt installs them unless it is told not to, and vkt says what is missing when a file asks for it.
# Everything is found from where it lies: dpkg -x into any folder runs there.
set(VKT_PACKAGE_CONTACT "vkt authors <vkt@packages.invalid>" CACHE STRING "Maintainer of the Debian packages")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME vkt)
set(CPACK_PACKAGE_CONTACT "${VKT_PACKAGE_CONTACT}")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_VERBATIM_VARIABLES ON)

set(CPACK_COMPONENTS_ALL runtime development)
if(VKT_HAVE_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME vkt)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libvkt-dev)
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-vkt)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION
"Reads, changes, measures and draws volumes: three-dimensional grids of
numbers, as they come from scanners and simulations. Commands are joined by
pipes, work at the same time, hold only the slices that they need, and keep
geometry and history.

Reads and writes NRRD, MetaImage, NIfTI, TIFF, DICOM, HDF5, Zarr, OpenVDB,
VTK and others; what large libraries do is loaded when a file asks for it.")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
"Headers of libvkt, with interfaces for C and C++, its CMake package and its
pkg-config file.")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION
"The operations of the command vkt as a Python package, on NumPy arrays.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "vkt (= ${PROJECT_VERSION}-1)")
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "vkt (= ${PROJECT_VERSION}-1), python3, python3-numpy")
# What links to libvkt depends on this version; the linker's cache is told of it.
set(VKT_CONTROL ${PROJECT_BINARY_DIR}/debian)
file(CONFIGURE OUTPUT ${VKT_CONTROL}/shlibs CONTENT
  "libvkt ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR} vkt (= ${PROJECT_VERSION}-1)\n")
file(CONFIGURE OUTPUT ${VKT_CONTROL}/triggers CONTENT "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_CONTROL_EXTRA ${VKT_CONTROL}/shlibs ${VKT_CONTROL}/triggers)
# What else Debian asks of packages: see the script.
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/libvkt/cmake/debian/stage.cmake)
set(CPACK_VKT_DEBIAN_FOLDER ${PROJECT_SOURCE_DIR}/libvkt/cmake/debian)
set(CPACK_VKT_LIBRARY_FOLDER ${CMAKE_INSTALL_LIBDIR})

# cpack --config CPackSourceConfig.cmake packs the files as they lie; the target below packs what was committed.
set(CPACK_SOURCE_GENERATOR TGZ)
set(CPACK_SOURCE_PACKAGE_FILE_NAME vkt-${PROJECT_VERSION})
set(CPACK_SOURCE_IGNORE_FILES "/[.]git/;/build[^/]*/;/[.]cache/;__pycache__;[.]o$")
include(CPack)

find_package(Git QUIET)
if(Git_FOUND AND EXISTS ${PROJECT_SOURCE_DIR}/.git)
  # ninja source_archive: packages/vkt-VERSION.tar.gz, the same bytes from the same commit.
  add_custom_target(source_archive
    COMMAND ${CMAKE_COMMAND} -E make_directory ${CPACK_PACKAGE_DIRECTORY}
    COMMAND ${GIT_EXECUTABLE} -C ${PROJECT_SOURCE_DIR} archive --format=tar.gz --prefix=vkt-${PROJECT_VERSION}/
            --output=${CPACK_PACKAGE_DIRECTORY}/vkt-${PROJECT_VERSION}.tar.gz HEAD
    COMMENT "The source as it was committed" VERBATIM)
endif()
