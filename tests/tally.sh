#!/bin/sh
# Counts tests: tally.sh CTEST-OUTPUT LASTTEST-LOG prints "passed failed skipped", then each skipped test and why.
# SPDX-License-Identifier: MIT
#
# CTest sees a bats file, and a share of the unit tests under a sanitizer, as one test; their own lines (ok, not ok,
# ok … # skip; [       OK ], [  FAILED  ], [  SKIPPED ]) are in the log that CTest keeps.
set -eu
awk '
    FILENAME == ARGV[1] && /Test +#[0-9]+: / {
        several = ($0 ~ /: (bats|unit)\//)
        if ($0 ~ /: unit\//) shares = 1 # else CTest sees each unit test by itself
        if ($0 ~ / Passed +[0-9.]+ sec/) { if (!several) passed++ }
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
        if (files > 0 && inside == 0) failed += files
        printf "%d %d %d\n%s", passed, failed, skipped, list
    }' "$1" "$2"
