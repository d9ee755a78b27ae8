# Manual pages: one for every command, in agreement with --help, and their examples run.
load helper

page_of() { echo "$VKT_ROOT/man/vkt-${1// /-}.1"; }

# Pages may describe all sub-verbs of a verb together.
page_for() {
    local page
    page=$(page_of "$1")
    [ -e "$page" ] || page=$(page_of "${1%% *}")
    echo "$page"
}

# The long options that a help text lists: words at the start of a line or after a letter, "-o, --output FILE".
options_in_help() { grep -oE '^ +(-[A-Za-z0-9], *)?--[a-z][a-z0-9-]*(, *--[a-z][a-z0-9-]*)*' | grep -oE -- '--[a-z][a-z0-9-]*' | sort -u; }

# The long options that a page describes or mentions.
options_in_page() { grep -oE 'Fl -[a-z][a-z0-9-]*' "$1" | sed 's/^Fl -/--/' | sort -u; }

@test "every command has a page" {
    vkt help --list >verbs
    [ -s verbs ]
    missing=
    while read -r verb; do
        [ -e "$(page_for "$verb")" ] || missing="$missing $verb,"
    done <verbs
    [ -z "$missing" ] || { echo "no page:$missing" >&2; false; }
}

@test "every page belongs to a command" {
    vkt help --list >verbs
    for page in "$VKT_ROOT"/man/vkt-*.1; do
        name=$(basename "$page" .1)
        name=${name#vkt-}
        grep -qxF -e "$name" -e "${name//-/ }" verbs || grep -q "^$name " verbs ||
            { echo "$page: there is no command $name" >&2; false; }
    done
}

@test "pages have the sections of a page" {
    for page in "$VKT_ROOT"/man/vkt-*.1; do
        while read -r section; do
            grep -qx "\.Sh $section" "$page" || { echo "$page lacks $section" >&2; false; }
        done <<<"NAME
SYNOPSIS
DESCRIPTION
EXAMPLES
EXIT STATUS
SEE ALSO"
    done
}

@test "pages are correct mdoc" {
    command -v mandoc >/dev/null || skip "mandoc is not installed"
    for page in "$VKT_ROOT"/man/*.[1-9]; do
        # Both usual orders of EXIT STATUS and EXAMPLES are fine.
        if mandoc -T lint -W warning "$page" | grep -v 'conventional order'; then bad=1; fi
    done
    [ -z "${bad:-}" ]
}

@test "pages that are referred to exist" {
    for page in "$VKT_ROOT"/man/*.[1-9]; do
        grep -oE '^\.Xr vkt[a-z0-9-]* [1-9]' "$page" | sort -u | while read -r _ name section; do
            [ "$name" = vkt-COMMAND ] || [ -e "$VKT_ROOT/man/$name.$section" ] ||
                { echo "$page refers to $name($section)" >&2; exit 1; }
        done
    done
}

@test "vkt-stability(7) names every command and algorithm, every line of the table, and tests that exist" {
    python_with numpy scipy
    VKT=$(command -v vkt) /usr/bin/python3 - "$VKT_ROOT" <<'END'
import glob, os, re, subprocess, sys
root = sys.argv[1]
page = open(f"{root}/man/vkt-stability.7").read()
run = lambda *words: subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
lines = {int(line.split()[0]) for line in run("/usr/bin/python3", f"{root}/tests/stability/stability.py", "--list")}
named = set()
for group in re.findall(r"^\[([0-9, -]+)\]", page, re.MULTILINE):
    for first, last in re.findall(r"(\d+)(?:-(\d+))?", group):
        named |= set(range(int(first), int(last or first) + 1))
assert named == lines, f"not named: {sorted(lines - named)}; not lines: {sorted(named - lines)}"
commands = run("vkt", "help", "--list")
units = "".join(open(path).read() for path in glob.glob(f"{root}/tests/unit/*.cpp"))
tests = {f"{suite}.{name}" for suite, name in re.findall(r"^TEST\w*\((\w+), (\w+)\)", units, re.MULTILINE)}
rows = re.findall(r"^\.It (.*)\n((?:(?!\.It|\.El).*\n)*)", page, re.MULTILINE)
for item, row in rows:
    stems = re.findall(r"\b([a-z0-9-]+)\.bats", row)
    cases = re.findall(r"\b([A-Z]\w+\.\w+)\b", row)
    assert stems or cases or re.search(r"^\[[0-9, -]+\]", row, re.MULTILINE), f"no test: {item}"
    for stem in stems:
        there = glob.glob(f"{root}/tests/{stem}.bats") + glob.glob(f"{root}/tests/*/{stem}.bats")
        assert there, f"there is no {stem}.bats"
    for case in cases:
        assert case in tests, f"there is no {case}"
usage = " ".join(run("vkt", "render", "--help"))
algorithms = re.search(r"--render-algo[^[]*\[([a-z|-]+)\]", usage).group(1).split("|")
items = [name for item, _ in rows if item.startswith("Cm ") for name in item[3:].split(" , ")]
plain = {"completion", "dump", "dump-range", "help", "history", "info", "pipe"}  # move, print or start; compute nothing
absent = [name for name in commands + algorithms if name not in items and name not in plain]
assert not absent, f"not named: {absent}"
unknown = [name for name in items if name not in commands + algorithms]
assert not unknown, f"neither commands nor algorithms: {unknown}"
options = [word for item, _ in rows if item.startswith("Fl ") for word in re.findall(r"Fl (-[a-z-]+)", item)]
unknown = [option for option in options if f"-{option} " not in usage]
assert not unknown, f"no options of vkt render: {unknown}"
END
}

@test "common options are described in vkt(1)" {
    vkt help --common | options_in_help >help
    [ -s help ]
    options_in_page "$VKT_ROOT/man/vkt.1" >page
    diff help <(grep -vxF -e --range -e --roi -e --version page)
}

@test "options of each command are those of its page" {
    vkt help --common | options_in_help >common
    vkt help --list >verbs
    bad=
    while read -r verb; do echo "$(page_for "$verb") $verb"; done <verbs >pages
    for page in $(cut -d' ' -f1 pages | sort -u); do
        : >help
        while read -r on verb; do
            [ "$on" = "$page" ] || continue
            # shellcheck disable=SC2086  # "filter gaussian" is two words
            vkt $verb --help | options_in_help >>help
        done <pages
        sort -u help | grep -vxF -f common >own || true
        options_in_page "$page" | grep -vxF -f common >described || true
        # A page may mention options of other commands only in its examples and in prose about them, as Fl after Cm.
        missing=$(comm -23 own described | tr '\n' ' ')
        extra=$(comm -13 own described | tr '\n' ' ')
        [ -z "$missing" ] || bad="$bad$(basename "$page") does not describe $missing
"
        [ -z "$extra" ] || bad="$bad$(basename "$page") describes what --help does not list: $extra
"
    done
    [ -z "$bad" ] || { echo "$bad" >&2; false; }
}

@test "examples of every command run" {
    vkt help --list >verbs
    bad=
    mkdir scratch
    cd scratch
    while read -r verb; do
        # shellcheck disable=SC2086
        vkt $verb --examples >../examples || { bad="$bad$verb: --examples fails"; continue; }
        while IFS= read -r line; do
            [ -n "$line" ] || continue
            rm -rf ./*
            cp "$VKT_ROOT/examples/data/phantom.nrrd" volume.nrrd
            vkt make sphere --dims 8 8 8 --dtype uint8 -o engine_8x8x8_uint8.raw
            if ! timeout 120 bash -c "$line" >../out 2>../err </dev/null; then
                bad="$bad$verb: $line
    $(head -c 500 ../err)
"
            fi
        done <../examples
    done <../verbs
    [ -z "$bad" ] || { echo "$bad" >&2; false; }
}

@test "every command shows examples" {
    vkt help --list >verbs
    while read -r verb; do
        # shellcheck disable=SC2086
        [ -n "$(vkt $verb --examples)" ] || { echo "$verb has no example" >&2; false; }
    done <verbs
}
