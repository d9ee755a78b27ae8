#!/bin/sh
# Counts tests: tally.sh CTEST-OUTPUT LASTTEST-LOG [late] prints "passed failed skipped", then each skipped test and why.
# SPDX-License-Identifier: MIT
#
# CTest sees a bats file, and a share of the unit tests under a sanitizer, as one test; their own lines (ok, not ok,
# ok … # skip; [       OK ], [  FAILED  ], [  SKIPPED ]) are in the log that CTest keeps. "late": the time of all tests ended
# (ctest --stop-time), so that those that ran then were killed before their own time was over, and others never began.
set -eu
awk -v late="${3:-}" '
    FILENAME == ARGV[1] && match($0, /^ *[0-9]+\/[0-9]+ Test +#/) { begun++; split($1, of, "/"); all = of[2] }
    FILENAME == ARGV[1] && /Test +#[0-9]+: / {
        several = ($0 ~ /: (bats|unit)\//)
        if ($0 ~ /: unit\//) shares = 1 # else CTest sees each unit test by itself
        if ($0 ~ / Passed +[0-9.]+ sec/) { if (!several) passed++ }
        else if (late && $0 ~ /\*\*\*Timeout/ && $(NF - 1) < (several ? 1199 : 299)) { skipped++; list = list "skipped: no time left for all of " $0 "\n" }
        else if ($0 ~ /\*\*\*(Skipped|Not Run)/) { skipped++; print "skipped: " $0 > "/dev/stderr" }
        else if ($0 ~ /\*\*\*|Subprocess/) { if (several) files++; else failed++ }
    }
    FILENAME == ARGV[2] && /^ok [0-9]+ .*# skip/ { skipped++; sub(/^ok [0-9]+ /, ""); list = list "skipped: " $0 "\n"; next }
    FILENAME == ARGV[2] && /^ok [0-9]+ / { passed++ }
    FILENAME == ARGV[2] && /^not ok [0-9]+ / { failed++; inside++ }
    # With their times; the summary at the end names some of them again.
    shares && FILENAME == ARGV[2] && /^\[ +OK \] .*\([0-9]+ ms\)$/ { passed++ }
    shares && FILENAME == ARGV[2] && /^\[ +SKIPPED +\] .*\([0-9]+ ms\)$/ { skipped++; list = list "skipped: " $4 "\n" }
    shares && FILENAME == ARGV[2] && /^\[ +FAILED +\] .*\([0-9]+ ms\)$/ { failed++; inside++ }
    # A file that broke before its first test, or timed out.
    END {
        if (late && all > begun) { skipped += all - begun; list = list "skipped: no time left to begin " all - begun " of " all " tests of CTest\n" }
        if (files > 0 && inside == 0) failed += files
        printf "%d %d %d\n%s", passed, failed, skipped, list
    }' "$1" "$2"
