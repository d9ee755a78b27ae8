// Where the process begins: words in, exit code out.
// SPDX-License-Identifier: MIT
#include "shell/help.h"
#include "shell/run.h"

#include <cstdio>
#include <cstdlib>
#include <string>
#include <unistd.h>
#include <vector>

namespace {

/// OpenMP's threads spin before they sleep, which starves the other stages of a pipeline, and the runtime reads its
/// settings before main() begins. So the program starts itself once more with the setting made.
void make_threads_sleep(char** argv) {
    if (std::getenv("OMP_WAIT_POLICY") != nullptr) return;
    ::setenv("OMP_WAIT_POLICY", "passive", 1);
    ::execv("/proc/self/exe", argv);
    // Where that is impossible the threads spin; results are the same.
}

} // namespace

int main(int argc, char** argv) {
    make_threads_sleep(argv);
    std::vector<std::string> const words(argv + 1, argv + argc);
    if (words.empty() || words.front() == "--help" || words.front() == "-h") {
        std::FILE* const where = words.empty() ? stderr : stdout;
        std::fputs(vkt::shell::overview().c_str(), where);
        return words.empty() ? 2 : 0;
    }
    if (words.front() == "--version") {
        std::puts("vkt " VKT_VERSION);
        return 0;
    }
    return vkt::shell::guarded("vkt " + words.front(), [&] { return vkt::shell::run_words(words); });
}
