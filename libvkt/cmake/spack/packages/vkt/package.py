"""Recipe for Spack: vkt from the archive of its source. SPDX-License-Identifier: MIT

    tar xf vkt-0.1.0.tar.gz && spack repo add vkt-0.1.0/libvkt/cmake/spack
    spack dev-build --source-path vkt-0.1.0 vkt@0.1.0

A place that publishes the archive adds its address and checksum to the version below, and `spack install vkt` will do.
"""
from spack.package import *


class Vkt(CMakePackage):
    """Volume toolset for Unix pipelines: reads, changes, measures and draws volumes of scanners and simulations."""

    license("MIT")

    version("0.1.0")

    variant("cuda", default=False, description="Run operations on NVIDIA GPUs")
    variant("hdf5", default=True, description="Read and write HDF5, read FLASH files")
    variant("openvdb", default=False, description="Read and write OpenVDB files")
    variant("tiff", default=True, description="Read and write TIFF")
    variant("gdcm", default=False, description="Read DICOM")
    variant("blosc", default=True, description="Read and write chunks of Zarr that Blosc compressed")
    variant("openexr", default=False, description="Read and write OpenEXR pictures")
    variant("freetype", default=False, description="Write text into pictures")
    variant("python", default=False, description="Install the Python package")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
    depends_on("cmake@3.25:", type="build")
    depends_on("ninja", type="build")
    depends_on("boost", type="build")
    depends_on("cli11@2:", type="build")
    depends_on("spdlog", type="build")
    depends_on("nlohmann-json", type="build")
    depends_on("xxhash")
    depends_on("zlib-api")
    depends_on("bzip2")
    depends_on("libpng")
    depends_on("expat")
    depends_on("lz4")
    depends_on("xz")
    depends_on("zstd")
    depends_on("cuda@12.4:", when="+cuda")
    depends_on("hdf5", when="+hdf5")
    depends_on("openvdb", when="+openvdb")
    depends_on("intel-tbb", when="+openvdb")
    depends_on("libtiff", when="+tiff")
    depends_on("gdcm", when="+gdcm")
    depends_on("c-blosc", when="+blosc")
    depends_on("openexr@3:", when="+openexr")
    depends_on("freetype", when="+freetype")
    depends_on("python@3.9:", when="+python", type=("build", "run"))
    depends_on("py-numpy", when="+python", type=("build", "run"))

    generator("ninja")

    def cmake_args(self):
        parts = ("cuda", "hdf5", "openvdb", "tiff", "gdcm", "blosc", "openexr", "freetype", "python")
        switches = [self.define_from_variant(f"VKT_{part.upper()}", part) for part in parts]
        return switches + [self.define("VKT_TESTS", False), self.define("VKT_VIEWER", False)]
