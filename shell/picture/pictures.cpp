// Volumes made ready for drawing; pictures with their metadata.
// SPDX-License-Identifier: MIT
#include "shell/picture/pictures.h"

#include "libvkt/core/text.h"
#include "libvkt/engine/cut.h"
#include "libvkt/formats/format.h"
#include "libvkt/formats/header_text.h"
#include "libvkt/formats/picture_texts.h"
#include "libvkt/render/settings.h"

#include <algorithm>
#include <cmath>

namespace vkt::shell {

namespace {

class PictureSource : public Source {
public:
    explicit PictureSource(std::unique_ptr<ByteSource> bytes) : bytes_(std::move(bytes)) {}
    bool next_volume() override {
        if (std::exchange(opened_, true)) return false;
        for (auto const& [keyword, content] : texts())
            if (keyword == history_keyword) header_.history = parse_history(content);
        return true;
    }
    Header const& header() const override { return header_; }
    Access access() const override { return Access::forward; }
    void read(AnyView) override {
        throw Error(ErrorKind::usage, text("'", bytes_->name(), "' is a picture, not a volume"));
    }
    void finish() override {}

private:
    /// Of a PNG without decoding it.
    render::PictureTexts texts() {
        if (render::is_png(bytes_->peek(8))) return render::read_png_texts(*bytes_);
        return render::read_picture(*bytes_).texts;
    }

    std::unique_ptr<ByteSource> bytes_;
    Header header_;
    bool opened_ = false;
};

} // namespace

bool is_picture(ByteSource& bytes) { return render::is_picture_file(bytes.peek(8)); }

std::unique_ptr<Source> picture_source(std::unique_ptr<ByteSource> bytes) {
    return std::make_unique<PictureSource>(std::move(bytes));
}

bool Volumes::another() {
    while (!another_) {
        another_ = source_.next_volume();
        if (!*another_ || !source_.header().dry_run) break;
        context_.plan(source_.header(), context_.output());
        source_.finish();
        another_.reset();
    }
    return *another_;
}

bool Volumes::open() {
    if (!another()) return false;
    render::check_memory(source_.header(), context_.execution(), tree_, false, picture_(source_.header()));
    another_.reset();
    return true;
}

bool Volumes::rewind_to(std::int64_t volume) {
    if (!source_.rewind()) return false;
    another_.reset();
    for (; volume > 0 && another(); --volume) {
        source_.finish();
        another_.reset();
    }
    return true;
}

bool Volumes::next() {
    if (!open()) return false;
    renderer_.reset();
    header_ = source_.header();
    Execution const& execution = context_.execution();
    if (header_.kind == Kind::hierarchical) {
        renderer_ = std::make_unique<render::Renderer>(load(source_, execution), execution, tree_);
    } else if (std::optional<Volume> const whole = source_.take_whole()) {
        renderer_ = std::make_unique<render::Renderer>(*whole, execution);
    } else {
        renderer_ = std::make_unique<render::Renderer>(
            header_, [&](AnyView const& to) { read_all(to); }, execution);
    }
    return true;
}

void Volumes::read_all(AnyView const& to) {
    Execution const& execution = context_.execution();
    source_.expect(to.box);
    if (execution.monitor == nullptr) {
        source_.read(to);
    } else {
        Cut const cut = cut_of(header_, source_.natural_slab(), execution);
        for_each_piece(to.box, cut, [&](Box const& box) {
            ProgressPart const share = part_of(execution.monitor, to.box, box);
            source_.read(to.part(box));
        });
    }
    source_.finish();
}

render::PictureTexts with_history(render::PictureTexts const& texts, std::vector<render::PictureContents> const& others,
                                  StageInfo const& stage) {
    std::vector<Header> headers;
    for (render::PictureContents const& other : others) {
        Header& header = headers.emplace_back();
        if (std::string const known = other.text(history_keyword); !known.empty())
            header.history = parse_history(known);
    }
    History const history = folded(history_step(stage, headers));
    render::PictureTexts result = texts_of_history(history);
    for (auto const& [keyword, content] : texts)
        if (keyword != "Software" && keyword != "History" && keyword != history_keyword)
            result.emplace_back(keyword, content);
    return result;
}

void write_combined(std::string const& path, render::PictureContents const& picture,
                    render::PictureOptions const& options, Context& context) {
    render::Background const background{{0, 0, 0}, picture.alpha ? 0.0 : 1.0};
    render::check(options, background, path);
    if (context.dry_run()) {
        Header header;
        header.dims = {picture.image.width, picture.image.height, 1};
        header.dtype = DataType::float32;
        return context.plan(header, path);
    }
    auto const bytes = render::encode_picture(picture.image, background, picture.layers, picture.texts, options);
    OutputFile file(path, context.force());
    file.write(bytes.data(), bytes.size());
    file.commit();
}

void write_picture(std::string const& path, bool force, Picture const& picture, Header const& header,
                   StageInfo const& stage, Context& context) {
    render::RenderReport const& r = picture.report;
    History const history = folded(history_step(stage, {header}));
    std::string const quality = render::quality_text(r, picture.goal);
    render::PictureTexts texts = texts_of_history(history);
    for (auto& entry : render::texts_of(r, picture.goal)) texts.push_back(std::move(entry));
    render::PictureOptions options = picture.options;
    options.png = {context.execution().threads, r.quality.stopped};
    auto const bytes = render::encode_picture(picture.image, picture.background, r.layers, texts, options);
    auto const remarks = render::remarks_of(r, picture.goal);
    for (auto const& line : remarks) context.lossy(line);
    if (remarks.empty() && picture.goal.any()) context.note(quality);
    OutputFile file(path, force);
    file.write(bytes.data(), bytes.size());
    file.commit();
    if (r.capped > 0) context.note(text(r.capped, " paths were cut at the bounce limit"));
    if (context.verbose()) context.note(render::report_text(r));
}

} // namespace vkt::shell
