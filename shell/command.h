// What a command is to the framework: help texts, parameters, and one of four shapes. Commands touch nothing else.
// SPDX-License-Identifier: MIT
#pragma once

#include "libvkt/core/execution.h"
#include "libvkt/core/parameters.h"
#include "libvkt/core/texts.h"
#include "libvkt/engine/operation.h"
#include "libvkt/engine/pipeline.h"
#include "libvkt/engine/registry.h"
#include "libvkt/engine/source.h"
#include "libvkt/formats/format.h"

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace vkt::shell {

/// What a command's body may use besides its parameters and inputs.
class Context {
public:
    virtual ~Context() = default;
    virtual Execution const& execution() const = 0;
    virtual StageInfo stage_info() const = 0; ///< name, history words and listener of this stage
    virtual bool json() const = 0;            ///< --json was given
    virtual bool quiet() const = 0;
    virtual bool verbose() const = 0;
    virtual std::string const& output() const = 0; ///< -o, "-" by default
    virtual bool force() const = 0;
    virtual bool dry_run() const = 0;     ///< nothing is to be written
    virtual bool trust_paths() const = 0; ///< --trust-paths was given
    virtual bool window() const = 0;      ///< there is no -o but a terminal, and the consumer shows()
    /// Prints a report to standard output (or -o). The only way for a command to print.
    virtual void print(std::string const& report) = 0;
    /// One line on standard error, prefixed with the stage, unless --quiet.
    virtual void note(std::string const& message) = 0;
    /// Tells of a volume that is only planned (a dry run) and where it would go.
    virtual void plan(Header const& header, std::string const& output) = 0;
    /// A note about voxels that are not shown or kept as they are; throws Error{data} with --strict.
    virtual void lossy(std::string const& message) = 0;
    /// Throws Error{data} with --strict if something lossy was told of already: before a file is written.
    virtual void refuse_lossy() = 0;
    /// One line on standard error with --verbose. May be called for as long as the stage runs.
    virtual std::function<void(std::string const& message)> detail() = 0;
    /// The format of an input, of what was opened last for it; "vkt" for a stream.
    virtual std::string format(std::string const& input) const = 0;
    /// Opens an input: any format, "-", FIFO or stream; a file as it is described by `stated`.
    virtual std::unique_ptr<Source> open(std::string const& path, ReadOptions const& stated = {}) = 0;
};

/// Reads volumes and reports on them or turns them into something that is no volume.
class Consumer {
public:
    virtual ~Consumer() = default;
    virtual void parameters(Parameters&) {}
    virtual void check() const {}
    virtual int inputs() const { return 1; }
    /// The inputs, where parameters of its own name them; never empty then.
    virtual std::vector<std::string> input_names() const { return {}; }
    /// True if it opens what input_names() says itself.
    virtual bool opens_inputs() const { return false; }
    /// True if `--json` has a meaning. Adds the option.
    virtual bool reports() const { return false; }
    /// True if -o names a file that this command writes itself (picture, volume file). Adds -o and --force.
    virtual bool writes() const { return false; }
    /// Suffixes that such a file may have (".png"), if not any; a name without one is always taken.
    virtual std::vector<std::string> suffixes() const { return {}; }
    /// Throws Error{usage} for a file that the parameters do not suit, or Error{failure} for one that this build cannot
    /// write, before anything is read.
    virtual void check_file(std::string const& /*path*/) const {}
    /// True if without -o, on a terminal, a window shows what -o would write (see shell/viewer), and always for those
    /// that do not write.
    virtual bool shows() const { return false; }
    /// True if it needs whole volumes at once: upstream then puts them into one piece of shared memory if it can.
    virtual bool needs_whole() const { return false; }
    /// False if --device gpu is refused.
    virtual bool runs_on_gpu() const { return false; }
    /// Bytes it then holds of a volume and of what it makes of it for this output: refused beyond --memory, told by a
    /// dry run.
    virtual std::size_t bytes_held(Header const& header, std::string const& /*output*/) const { return header.bytes(); }
    /// True if an input may be a picture that vkt render wrote: a volume without voxels, but with a history.
    virtual bool reads_pictures() const { return false; }
    /// What --explain says of a volume before it is worked on, one entry a line: method, cost.
    virtual std::vector<std::string> explain(Header const&, std::string const& /*output*/) const { return {}; }
    /// Returns the exit code. Asked for voxels of volumes that are only planned, sources throw PlannedOnly, which may
    /// pass: the framework then tells of the plan. Must finish() each volume that it reads; framework moves no volume
    /// itself.
    virtual int consume(std::vector<std::unique_ptr<Source>>& inputs, Context& context) = 0;
};

/// Opens something that yields volumes (read).
class Opener {
public:
    virtual ~Opener() = default;
    virtual void parameters(Parameters&) {}
    virtual void check() const {}
    /// True if it opens what others made. Adds the options about inputs.
    virtual bool reads() const { return false; }
    /// The inputs that its history names by placeholders (StageInfo), because their own past belongs to it.
    virtual std::vector<std::string> input_names() const { return {}; }
    /// In a pipeline of one process, open("-") of the context is the stage before. The context outlives the source.
    virtual std::unique_ptr<Source> open(Context& context) = 0;
    /// What writes to this output if it is no file (a directory); null if it is one. `create` makes files.
    virtual std::unique_ptr<Sink> sink(std::string const& /*output*/, WriteOptions const& /*options*/,
                                       std::function<std::unique_ptr<Sink>(std::string const&)> const& /*create*/) {
        return nullptr;
    }
};

/// Does something else entirely (help, completion, pipe); gets its raw words.
using Body = std::function<int(std::vector<std::string> const& words)>;

struct NamedCommand;

struct Command {
    Texts texts;
    /// Exactly one of these is set. Makers, because each use (also within `vkt pipe`) needs its own parameters.
    std::function<std::unique_ptr<Operation>()> operation;
    std::function<std::unique_ptr<Consumer>()> consumer;
    std::function<std::unique_ptr<Opener>()> opener;
    Body body;
    std::vector<NamedCommand> verbs; ///< sub-verbs: filter gaussian, make sphere
    bool takes_output = false;       ///< an operation whose last argument, beyond its inputs, is the output
};

struct NamedCommand {
    std::string name;
    Command command;
};

/// The operation that is registered under this name (VKT_OPERATION in its source).
inline Command operation_command(std::string name, Texts texts) {
    Command c;
    c.texts = std::move(texts);
    c.operation = [name = std::move(name)] { return make_operation(name); };
    return c;
}
/// The same with the operation's own texts.
inline Command operation_command(std::string name) {
    Texts texts = make_operation(name)->texts();
    return operation_command(std::move(name), std::move(texts));
}
/// All operations that are registered under names of two words that begin with this one, by their second.
std::vector<NamedCommand> methods_of(std::string_view name);
template <class T> Command consumer_command(Texts texts) {
    Command c;
    c.texts = std::move(texts);
    c.consumer = [] { return std::make_unique<T>(); };
    return c;
}
template <class T> Command opener_command(Texts texts) {
    Command c;
    c.texts = std::move(texts);
    c.opener = [] { return std::make_unique<T>(); };
    return c;
}

/// All commands by verb, in alphabetical order; generated at configure time from the files in commands/.
std::vector<NamedCommand> const& commands();

} // namespace vkt::shell
