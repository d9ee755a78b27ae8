// vkt_parser: the program of children that parse. It is started by the library (parser.h) and by nobody else.
// SPDX-License-Identifier: MIT
#include "libvkt/io/module.h"
#include "libvkt/io/parser_child.h"

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <malloc.h>
#include <string>

int main(int argc, char** argv) {
    if (argc != 6) {
        std::fputs("vkt_parser is started by vkt and its library; see vkt(7)\n", stderr);
        return vkt::parser_unusable;
    }
    // Tables come and go in megabytes: pages that were touched once are kept.
    ::mallopt(M_MMAP_THRESHOLD, 1 << 30);
    ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
    try {
        std::string const module = argv[1];
        vkt::ParserTask const task{argv[2], std::atoi(argv[3]), std::strtoull(argv[4], nullptr, 10),
                                   std::atoi(argv[5])};
        return vkt::run_parser(task, [&] { return vkt::module_parser(module, task.name); });
    } catch (std::exception const&) {
        return vkt::parser_unusable;
    }
}
