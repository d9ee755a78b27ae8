// vkt history: what made a volume.
// SPDX-License-Identifier: MIT
#include "libvkt/core/error.h"
#include "shell/command.h"
#include "shell/run/history_text.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vkt::shell {
namespace {

class ShowHistory : public Consumer {
public:
    void parameters(Parameters& p) override {
        p.flag("as-shell", as_shell_, "print a pipeline that makes the volume again");
    }
    bool reports() const override { return true; }
    bool reads_pictures() const override { return true; }
    int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) override {
        if (as_shell_ && context.json()) throw Error(ErrorKind::usage, "--as-shell and --json exclude each other");
        Source& source = *inputs.front();
        std::vector<std::string> objects, texts;
        while (source.next_volume()) {
            std::optional<History> const history = source.header().history;
            source.finish();
            if (context.json())
                objects.push_back(history ? history_json(*history) : "null");
            else if (!history && as_shell_)
                throw Error(ErrorKind::failure, "no pipeline makes the volume again: it has no history");
            else if (!history)
                context.note("the volume has no history");
            else
                texts.push_back(as_shell_ ? history_line(*history) : history_tree(*history));
            if (!as_shell_) continue;
            if (std::string const why = history_obstacle(*history); !why.empty()) context.note(why);
        }
        if (objects.size() == 1)
            context.print(objects.front() + "\n");
        else if (context.json())
            context.print("[\n" + join(objects, ",\n") + "\n]\n");
        else if (!texts.empty())
            context.print(join(texts, ""));
        return 0;
    }

private:
    bool as_shell_ = false;
};

} // namespace

Command history_command() {
    return consumer_command<ShowHistory>(
        {"Show the commands that made a volume or a picture.",
         "The newest step comes first, what it read is indented below it. With --as-shell the same as a pipeline that "
         "a shell runs; what it would miss here is said. A picture is a PNG file that vkt render wrote.",
         {{"The steps", "vkt make sphere --dims 32 32 32 | vkt resample --scale 0.5 | vkt history"},
          {"As a pipeline", "vkt make sphere --dims 32 32 32 | vkt resample --scale 0.5 | vkt history --as-shell"},
          {"Of a picture", "vkt render volume.nrrd --size 64 | vkt history"}}});
}

} // namespace vkt::shell
