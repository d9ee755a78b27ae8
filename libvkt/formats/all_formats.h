// Every format that is built in; format.cpp lists them in the order in which contents are tried.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/formats/format.h"

namespace vkt {

Format amrex_format();
Format analyze_format();
Format dicom_format();
Format exr_format();
Format flash_format();
Format hdf5_format();
Format metaimage_format();
Format mrc_format();
Format nifti_format();
Format npz_format();
Format nrrd_format();
Format numpy_format();
Format pfm_format();
Format pgm_format();
Format png_format();
Format pvd_format();
Format raw_format();
Format segment_format();
Format tiff_format();
Format vdb_format();
Format vti_format();
Format vtk_format();
Format zarr_format();

} // namespace vkt
