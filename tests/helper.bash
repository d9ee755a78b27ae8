# Common to all bats files: vkt on PATH, a scratch directory per test, sample data, short checks.
VKT_ROOT="${VKT_ROOT:-$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)}"
VKT_DATA="${VKT_DATA:-$VKT_ROOT/../shared/data}"
export VKT_ROOT VKT_DATA
bats_require_minimum_version 1.5.0

setup() {
    cd "$BATS_TEST_TMPDIR" || exit 1
    export XDG_CACHE_HOME="$BATS_TEST_TMPDIR/cache" # without the calibration of who runs the tests
    command -v vkt >/dev/null || { echo "vkt is not on PATH" >&2; return 1; }
    if declare -F setup_more >/dev/null; then setup_more; fi
}

# fails_with CODE TEXT COMMAND…: the command exits with the code, says TEXT on stderr, and nothing on stdout.
fails_with() {
    local code="$1" text="$2"
    shift 2
    run --separate-stderr "$@"
    [ "$status" -eq "$code" ] || { echo "status $status, not $code; stderr: $stderr" >&2; return 1; }
    [[ "$stderr" == *"$text"* ]] || { echo "stderr lacks '$text': $stderr" >&2; return 1; }
    # A pipe gets the error as a stream without volumes, so that stages downstream know; nothing else may be there.
    [[ -z "$output" || "$output" == VKT1*ERR* ]] || { echo "stdout is not empty: $output" >&2; return 1; }
}

# refused_and_foretold CODE TEXT COMMAND…: fails_with, and the same where the command is only planned.
refused_and_foretold() {
    fails_with "$@"
    fails_with "$@" -n
}

# only_shown FILE: it is UTF-8 of lines and characters that terminals show and do not act on, by Unicode's categories.
only_shown() { /usr/bin/python3 -c '
import sys, unicodedata
text = open(sys.argv[1], "rb").read().decode()
bad = {c for c in text if c != "\n" and unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")}
sys.exit(f"{sys.argv[1]} holds {bad}: {text!r}" if bad else 0)' "$1"; }

# names_in_shm: what lies below /dev/shm, but for volumes that were published there to stay (see shm.bats).
names_in_shm() { find /dev/shm -mindepth 1 -maxdepth 1 -printf '%f\n' | grep -v '^vkt\.[0-9]' | sort; }

# needs_data FILE: skips, saying so, where the sample volumes are absent.
needs_data() {
    [ -e "$VKT_DATA/$1" ] || skip "sample volume $1 is absent (set VKT_DATA)"
}

# install_and_move: one installation for all tests of a file, moved away from where it was installed.
install_and_move() {
    cmake --install "$VKT_BUILD" --prefix "$BATS_FILE_TMPDIR/first" >"$BATS_FILE_TMPDIR/log"
    mv "$BATS_FILE_TMPDIR/first" "$BATS_FILE_TMPDIR/moved here"
}

# python_has MODULE: the system's python can import it. That is asked once a file: an import takes a tenth of a second and more.
python_has() {
    local path=${PYTHONPATH:-}
    local known="$BATS_RUN_TMPDIR/python has $1, ${path//\//:}"
    [ -e "$known" ] && return
    /usr/bin/python3 -c "import $1" 2>/dev/null || return
    { : >"$known"; } 2>/dev/null || true # the name may be too long
}

# python_with MODULE…: the system's python has these modules, or the test is skipped with the reason.
python_with() {
    local module
    for module in "$@"; do
        python_has "$module" || skip "python3 has no $module"
    done
}

# with_peer MODULE: a package of PyPI, installed or in the build's folder peers (tests/run.sh), or the test is skipped
# with the reason.
with_peer() {
    export PYTHONPATH="${PYTHONPATH:+$PYTHONPATH:}$VKT_BUILD/peers"
    python_has "$1" || skip "python3 has no $1: pip install --target $VKT_BUILD/peers $1"
}

# peak_kib COMMAND…: its largest resident set in KiB.
peak_kib() {
    /usr/bin/python3 -c '
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)' "$@"
}
