#!/bin/sh
# Style and static checks: lint.sh REPORT appends "pass|fail|skip WHAT" lines to the file and shows what is wrong.
# SPDX-License-Identifier: MIT
set -eu
cd "$(dirname "$0")/.."
report=${1:-/dev/stdout}
: >>"$report"
sources() { git ls-files -co --exclude-standard -- '*.cpp' '*.h' '*.cu' '*.cuh'; }

if command -v clang-format >/dev/null; then
    if sources | xargs -r clang-format --dry-run -Werror 2>&1 | grep -E 'error:|warning:' | cut -d: -f1 | sort | uniq -c | sort -rn >clang-format.log &&
        [ -s clang-format.log ]; then
        echo 'not formatted (clang-format -i):'
        cat clang-format.log
        echo 'fail clang-format' >>"$report"
    else
        echo 'pass clang-format' >>"$report"
    fi
    rm -f clang-format.log
else
    echo 'skip clang-format is not installed' >>"$report"
fi

# In bats "! command" fails a test only as its last line, "run ! command" does anywhere; so does the first part of "a && b".
cannot_fail=0
if git ls-files -co --exclude-standard -- '*.bats' | xargs -r grep -nE '^[[:space:]]+! ' | grep -v '||'; then
    echo 'these lines cannot fail: write run !'
    cannot_fail=1
fi
if ! git ls-files -co --exclude-standard -- '*.bats' | xargs -r python3 tests/chains.py; then
    echo 'these lines cannot fail by what stands before &&: write two lines'
    cannot_fail=1
fi
if [ "$cannot_fail" = 1 ]; then
    echo 'fail bats lines that cannot fail' >>"$report"
else
    echo 'pass bats lines that cannot fail' >>"$report"
fi

if command -v shellcheck >/dev/null; then
    if shellcheck -s sh examples/*.sh examples/*/*.sh tests/*.sh tests/bench/*.sh tests/gpu/*.sh libvkt/cmake/*.sh libvkt/python/*.sh && shellcheck -s bash .ci/run; then
        echo 'pass shellcheck' >>"$report"
    else
        echo 'fail shellcheck' >>"$report"
    fi
else
    echo 'skip shellcheck is not installed' >>"$report"
fi

# clang-tidy takes seconds a file, so a file is checked again only when it, a header or the list of checks has changed,
# and only as long as the time allows; what was left out is said.
if ! command -v clang-tidy >/dev/null || [ ! -e build/CMakeCache.txt ]; then
    echo 'skip clang-tidy needs itself and a release build' >>"$report"
    exit 0
fi
# Sources are read one by one and without precompiled headers, so that what they forget to include is found.
database=build/tidy/configured/compile_commands.json
cmake --preset release -B build/tidy/configured -DVKT_TESTS=OFF -DVKT_UNITE=OFF -DVKT_PRECOMPILE=OFF >/dev/null
sed 's# -Wno-maybe-uninitialized##' "$database" >build/tidy/compile_commands.json
state=$(git ls-files -co --exclude-standard -- '*.h' .clang-tidy | sort | xargs -r cat | sha256sum | cut -c1-16)
todo=$(mktemp)
trap 'rm -f "$todo"' EXIT
git ls-files -co --exclude-standard -- 'libvkt/core/*.cpp' 'libvkt/c/*.cpp' 'libvkt/engine/*.cpp' 'libvkt/formats/*.cpp' 'libvkt/amr/*.cpp' \
    'libvkt/render/*.cpp' 'ipc/*.cpp' 'shell/*.cpp' 'commands/*.cpp' | while read -r file; do
    grep -q "/$file\"" "$database" || continue
    stamp=build/tidy/$(sha256sum <"$file" | cut -c1-24)-$state
    [ -e "$stamp" ] || echo "$file $stamp"
done >"$todo"
end=$(($(date +%s) + ${VKT_TIDY_SECONDS:-200}))
export end
rm -f build/tidy/failed build/tidy/left
# shellcheck disable=SC2016  # expanded by the inner shell
xargs -r -P "$(nproc)" -n 2 sh -c '
    if [ "$(date +%s)" -ge "$end" ]; then
        echo "$0" >>build/tidy/left
    elif output=$(clang-tidy -p build/tidy --quiet --warnings-as-errors="*" "$0" 2>/dev/null); then
        touch "$1"
    else
        printf "%s\n" "$output"
        echo "$0" >>build/tidy/failed
    fi' <"$todo"
if [ -e build/tidy/failed ]; then
    echo "fail clang-tidy: $(tr '\n' ' ' <build/tidy/failed)" >>"$report"
else
    echo 'pass clang-tidy' >>"$report"
fi
if [ -e build/tidy/left ]; then
    echo "clang-tidy: no time left for $(wc -l <build/tidy/left) of $(wc -l <"$todo") changed files"
fi
