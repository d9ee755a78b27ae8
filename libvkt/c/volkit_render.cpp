// volkit's rendering, lookup tables and execution policy over vkt.h.
// SPDX-License-Identifier: MIT
#include "libvkt/c/volkit_volume.h"

#include "libvkt/c/call.h"

#include "libvkt/core/error.h"
#include "libvkt/core/text.h"
#include "libvkt/io/output_file.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

using namespace vkt;
using namespace vkt::volkit;

struct vktLookupTable_impl {
    vktVec3i_t dims{0, 0, 0};
    vktColorFormat format = vktColorFormatUnspecified;
    std::vector<uint8_t> data{};
    vktResourceHandle handle = 0;
};

namespace {

/// Tables by number: what vktRenderState_t names them by.
class Tables {
public:
    static Tables& all() {
        static Tables tables;
        return tables;
    }
    void add(vktLookupTable table) {
        std::lock_guard const lock(mutex_);
        table->handle = next_++;
        tables_[table->handle] = table;
    }
    void remove(vktLookupTable table) {
        std::lock_guard const lock(mutex_);
        tables_.erase(table->handle);
    }
    /// A copy, or throws Error{usage}.
    vktLookupTable_impl at(vktResourceHandle handle) {
        std::lock_guard const lock(mutex_);
        auto const found = tables_.find(handle);
        if (found == tables_.end())
            throw Error(ErrorKind::usage, text("there is no lookup table ", std::uint64_t{handle}));
        return *found->second;
    }

private:
    std::mutex mutex_;
    std::map<vktResourceHandle, vktLookupTable> tables_;
    vktResourceHandle next_ = 1;
};

std::size_t bytes_of(vktColorFormat format) {
    if (format <= vktColorFormatUnspecified || format >= vktColorFormatCount)
        throw Error(ErrorKind::usage, text("there is no color format ", static_cast<int>(format)));
    int const index = static_cast<int>(format) - 1; // four numbers of channels for each size
    static constexpr std::size_t sizes[] = {1, 2, 4, 4};
    return sizes[index / 4] * static_cast<std::size_t>(index % 4 + 1);
}

std::string triple(vktVec3f_t v) { return volkit::triple(double{v.x}, double{v.y}, double{v.z}); }

std::vector<std::string> words_of(vktStructuredVolume volume, vktRenderState_t const& state) {
    std::vector<std::string> words{text("--size=", state.viewportWidth, "x", state.viewportHeight)};
    switch (state.renderAlgo) {
    case vktRenderAlgoRayMarching:
        words.insert(words.end(), {"--step", to_text(double{state.dtRayMarching})});
        break;
    case vktRenderAlgoImplicitIso:
        if (state.numIsoSurfaces < 1 || state.numIsoSurfaces > vktMaxIsoSurfaces)
            throw Error(ErrorKind::usage, text(int{state.numIsoSurfaces}, " iso-surfaces: there may be 1 to ",
                                               static_cast<int>(vktMaxIsoSurfaces)));
        words.insert(words.end(), {"--render-algo", "implicit-iso", "--iso"});
        for (int i = 0; i < int{state.numIsoSurfaces}; ++i) words.push_back(to_text(double{state.isoSurfaces[i]}));
        break;
    case vktRenderAlgoMultiScattering:
        words.insert(words.end(), {"--render-algo", "multi-scattering"});
        break;
    default:
        throw Error(ErrorKind::usage, text("there is no algorithm ", static_cast<int>(state.renderAlgo)));
    }
    if (state.rgbaLookupTable != static_cast<vktResourceHandle>(-1)) {
        vktLookupTable_impl const table = Tables::all().at(state.rgbaLookupTable);
        if (table.format != vktColorFormatRGBA32F)
            throw Error(ErrorKind::usage, "the lookup table is not of vktColorFormatRGBA32F");
        words.push_back("--rgba-lookup-table");
        for (std::size_t i = 0; i + sizeof(float) <= table.data.size(); i += sizeof(float)) {
            float entry = 0;
            std::memcpy(&entry, &table.data[i], sizeof entry);
            words.push_back(to_text(double{entry}));
        }
        words.push_back("--domain=" + text(double{volume->low}, ":", double{volume->high}));
    }
    if (vktInitialCamera_t const& camera = state.initialCamera; camera.isSet != VKT_FALSE)
        words.insert(words.end(), {"--eye=" + triple(camera.eye), "--target=" + triple(camera.center),
                                   "--up=" + triple(camera.up), "--fov=" + to_text(double{camera.fovy})});
    return words;
}

void reshape(vktLookupTable table, vktVec3i_t dims, vktColorFormat format) {
    std::size_t const each = bytes_of(format);
    if (dims.x < 1 || dims.y < 1 || dims.z < 1 || std::int64_t{dims.x} * dims.y > (std::int64_t{1} << 30) / dims.z)
        throw Error(ErrorKind::usage, text("a lookup table of ", dims.x, " ", dims.y, " ", dims.z, " entries"));
    table->data.assign(each * static_cast<std::size_t>(dims.x) * static_cast<std::size_t>(dims.y) *
                           static_cast<std::size_t>(dims.z),
                       0);
    table->dims = dims;
    table->format = format;
}

/// What a thread asked for that vkt_policy does not say.
vktExecutionPolicy_t& asked_policy() {
    thread_local vktExecutionPolicy_t policy{vktExecutionPolicyDeviceCPU, vktExecutionPolicyAPIAuto,
                                             vktExecutionPolicyDeviceAPIAuto, VKT_FALSE};
    return policy;
}

} // namespace

void vktLookupTableCreate(vktLookupTable* lut, int32_t dimX, int32_t dimY, int32_t dimZ, vktColorFormat format) {
    if (lut != nullptr) *lut = nullptr;
    volkit::attempt([&] {
        c::need(lut, "lut");
        auto table = std::make_unique<vktLookupTable_impl>();
        reshape(table.get(), {dimX, dimY, dimZ}, format);
        Tables::all().add(table.get());
        *lut = table.release();
    });
}
void vktLookupTableDestroy(vktLookupTable lut) {
    if (lut == nullptr) return;
    Tables::all().remove(lut);
    delete lut;
}
void vktLookupTableSetDims3i(vktLookupTable lut, int32_t dimX, int32_t dimY, int32_t dimZ) {
    vktLookupTableSetDims3iv(lut, {dimX, dimY, dimZ});
}
void vktLookupTableSetDims3iv(vktLookupTable lut, vktVec3i_t dims) {
    volkit::attempt([&] {
        c::need(lut, "lut");
        reshape(lut, dims, lut->format);
    });
}
void vktLookupTableSetColorFormat(vktLookupTable lut, vktColorFormat format) {
    volkit::attempt([&] {
        c::need(lut, "lut");
        reshape(lut, lut->dims, format);
    });
}
void vktLookupTableGetDims3i(vktLookupTable lut, int32_t* dimX, int32_t* dimY, int32_t* dimZ) {
    vktVec3i_t const dims = vktLookupTableGetDims3iv(lut);
    if (dimX != nullptr) *dimX = dims.x;
    if (dimY != nullptr) *dimY = dims.y;
    if (dimZ != nullptr) *dimZ = dims.z;
}
vktVec3i_t vktLookupTableGetDims3iv(vktLookupTable lut) { return lut == nullptr ? vktVec3i_t{0, 0, 0} : lut->dims; }
vktColorFormat vktLookupTableGetColorFormat(vktLookupTable lut) {
    return lut == nullptr ? vktColorFormatUnspecified : lut->format;
}
void vktLookupTableSetData(vktLookupTable lut, uint8_t* data) {
    volkit::attempt([&] {
        c::need(lut, "lut");
        c::need(data, "data");
        std::copy_n(data, lut->data.size(), lut->data.begin());
    });
}
uint8_t* vktLookupTableGetData(vktLookupTable lut) { return lut == nullptr ? nullptr : lut->data.data(); }
size_t vktLookupTableGetSizeInBytes(vktLookupTable lut) { return lut == nullptr ? 0 : lut->data.size(); }
void vktLookupTableMigrate(vktLookupTable) {}
vktResourceHandle vktLookupTableGetResourceHandle(vktLookupTable lut) {
    return lut == nullptr ? static_cast<vktResourceHandle>(-1) : lut->handle;
}

void vktSetThreadExecutionPolicy(vktExecutionPolicy_t policy) {
    bool const gpu = policy.device == vktExecutionPolicyDeviceGPU;
    vkt_policy asked = {gpu ? "gpu" : "cpu", policy.hostApi == vktExecutionPolicyHostAPISerial ? 1 : 0, 0};
    lacks_gpu() = vkt_set_policy(&asked) != VKT_OK;
    asked_policy() = policy;
    prints_performance() = policy.printPerformance != VKT_FALSE;
}
vktExecutionPolicy_t vktGetThreadExecutionPolicy(void) { return asked_policy(); }

void vktRenderStateDefaultInit(vktRenderState_t* renderState) {
    if (renderState == nullptr) return;
    vktRenderState_t state{};
    state.renderAlgo = vktRenderAlgoRayMarching;
    state.dtRayMarching = 0.5F;
    state.numIsoSurfaces = 1;
    state.isoSurfaces[0] = 0.5F;
    state.dtImplicitIso = 1;
    state.majorant = 1;
    state.rgbaLookupTable = state.histogram = static_cast<vktResourceHandle>(-1);
    state.viewportWidth = state.viewportHeight = 512;
    state.sRGB = VKT_TRUE;
    state.initialCamera = {VKT_FALSE, {0, 0, 0}, {0, 0, -1}, {0, 1, 0}, 45, 0, 1};
    state.snapshotTool = {VKT_FALSE, "", VKT_FALSE, 'p', ""};
    *renderState = state;
}

vktError vktRenderSV(vktStructuredVolume volume, vktRenderState_t renderState, vktRenderState_t* newRenderState) {
    return run("vktRenderSV", [&] {
        needed(volume, "volume");
        vktSnapshotTool_t const& file = renderState.snapshotTool;
        if (file.enabled == VKT_FALSE || file.fileName == nullptr || *file.fileName == 0)
            throw Error(ErrorKind::usage, "libvkt has no window to show a picture in",
                        "set snapshotTool.enabled and snapshotTool.fileName, and it is written there");
        if (renderState.sRGB == VKT_FALSE)
            throw Error(ErrorKind::usage, "a PNG file is sRGB", "set sRGB, or take vkt_picture_light() of vkt.h");
        std::vector<char const*> list;
        auto const words = words_of(volume, renderState);
        list.reserve(words.size());
        for (std::string const& word : words) list.push_back(word.c_str());
        vkt_picture* picture = nullptr;
        if (vkt_render(volume->volume.get(), list.data(), list.size(), &picture) != VKT_OK) throw Failed{};
        std::unique_ptr<vkt_picture, void (*)(vkt_picture*)> const owner(picture, vkt_free_picture);
        void const* bytes = nullptr;
        size_t size = 0;
        if (vkt_picture_png(picture, &bytes, &size) != VKT_OK) throw Failed{};
        try {
            OutputFile output(file.fileName, true);
            output.write(bytes, size);
            output.commit();
        } catch (Error const&) {
            (void)c::attempted([] { throw; }); // for vkt_error()
            throw Failed{vktWriteError};
        }
        if (file.message != nullptr && *file.message != 0) std::fprintf(stderr, "%s\n", file.message);
        if (newRenderState != nullptr) *newRenderState = renderState;
    });
}
