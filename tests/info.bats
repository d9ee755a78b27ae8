# vkt info: headers as text and JSON, of files, streams and series.
load helper

setup_more() {
    printf 'NRRD0004\ntype: short\ndimension: 3\nspace: LPS\nsizes: 4 3 2\nspace directions: (0,2,0) (-0.5,0,0) (0,0,3)\nspace origin: (1,2,3)\nendian: little\nencoding: raw\nvkt slope:=2\nnote:=a remark\n\n' >a.nrrd
    head -c 48 /dev/zero >>a.nrrd
}

@test "JSON has what scripts need" {
    vkt info a.nrrd --json >info
    python3 - <<'END'
import json
info = json.load(open("info"))
assert info["kind"] == "structured"
assert info["dims"] == [4, 3, 2]
assert info["dtype"] == "int16"
assert info["spacing"] == [2, 0.5, 3]
assert info["origin"] == [1, 2, 3]
assert info["direction"] == [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
assert info["slope"] == 2 and info["intercept"] == 0
assert info["attributes"] == {"space": "left-posterior-superior", "note": "a remark"}
END
}

@test "text says the same" {
    vkt info a.nrrd >info
    for line in "kind       structured" "dims       4 3 2" "dtype      int16" "spacing    2 0.5 3" "origin     1 2 3" \
        "direction  0 1 0  -1 0 0  0 0 1" "values     2 \* stored + 0" "attribute  note: a remark" "bytes      48 (48 B)"; do
        grep -qx -- "$line" info || { cat info >&2; echo "no '$line'" >&2; false; }
    done
}

@test "a stream says the same as its file, and its history" {
    vkt read a.nrrd | vkt info >piped
    vkt info a.nrrd | grep -v '^format' | diff - <(grep -v '^history\|^format' piped)
    grep -qx "history    vkt read a.nrrd" piped
}

@test "of files only the header is read, of streams all unless --head" {
    truncate -s 4G big_2048x2048x1024_uint8.raw
    run -0 timeout 5 vkt info big_2048x2048x1024_uint8.raw
    # The command before is cut off, or let to its end.
    run -141 bash -o pipefail -c 'vkt read big_2048x2048x1024_uint8.raw | vkt info --head >/dev/null'
    truncate -s 64M small_512x512x256_uint8.raw
    run -0 bash -o pipefail -c 'vkt read small_512x512x256_uint8.raw | vkt info >/dev/null'
}

@test "several volumes are listed" {
    printf 'NRRD0004\ntype: uchar\ndimension: 4\nsizes: 2 2 1 3\nkinds: domain domain domain list\nencoding: raw\n\nabcdefghijkl' >series.nrrd
    vkt info series.nrrd | grep -c '^dims' | grep -qx 3
    vkt info series.nrrd | grep -qx 'volume     3 of 3'
    cp series.nrrd series2.nrrd
    vkt info 'series*.nrrd' | grep -c '^format *nrrd$' | grep -qx 6
    vkt read series.nrrd | vkt info --json | python3 -c 'import json, sys; assert [v["dims"] for v in json.load(sys.stdin)] == [[2, 2, 1]] * 3'
}

@test "damage is told" {
    head -c $(($(stat -c %s a.nrrd) - 1)) a.nrrd >cut.nrrd
    fails_with 3 "ended early" vkt info cut.nrrd
    head -c 100 a.nrrd >cut.nrrd
    fails_with 3 "ended early" vkt info cut.nrrd
    fails_with 4 "no such file" vkt info none.nrrd
    fails_with 3 "empty" vkt info - </dev/null
    run -3 bash -c 'vkt read a.nrrd | head -c 300 | vkt info 2>&1 >/dev/null'
    [[ "$output" == *"ended early"* ]]
}

@test "info says the format of a file, and that a stream is no NRRD whatever its name" {
    vkt make ramp --dims 4 4 4 -o v.nrrd
    vkt info v.nrrd | grep -q '^format *nrrd$'
    vkt info v.nrrd --json | python3 -c 'import json, sys; assert json.load(sys.stdin)["format"] == "nrrd"'
    vkt flip x v.nrrd >w.nrrd
    run --separate-stderr vkt info w.nrrd
    [ "$status" -eq 0 ]
    [[ "$output" == *"vkt (not nrrd, as the name says)"* ]]
    [[ "$stderr" == *"'w.nrrd' is a vkt stream, whatever its name says"* ]]
    vkt info w.nrrd --json 2>/dev/null | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["format"] == "vkt" and info["format_of_name"] == "nrrd", info'
    run ! grep -q format_of_name <(vkt info v.nrrd --json)
    vkt flip x v.nrrd | vkt info | grep -q '^format *vkt$'
}

@test "what files and arguments say is printed as text, never acted on by terminals" {
    # A line of its own for each lie, colours, a clear screen, C1 controls, writing from right to left, Latin-1.
    /usr/bin/python3 - <<'PY'
head = (b'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 1 1 2\nencoding: raw\nsample units: "HU\x1b[2J"\n'
        b'lie:=one\\ndims       9 9 9\nk\x1b]0;title\x07ey:=\xc2\x9b31m \xe2\x80\xae back\xff\n'
        b'vkt history:={"command":["read","\\\\u001b[31m\\\\nholes 1 %"]}\n\n')
open('evil.nrrd', 'wb').write(head + b'ab')
PY
    vkt info evil.nrrd >info
    only_shown info
    [ "$(grep -c '^dims' info)" -eq 1 ]
    run ! grep -q '^holes' info
    grep -qF 'attribute  lie: one\ndims       9 9 9' info
    grep -qF '\x1b[2J' info
    vkt info evil.nrrd --json >info
    only_shown info
    python3 - <<'END'
import json
info = json.load(open("info", encoding="utf-8"))
assert info["attributes"]["lie"] == "one\ndims       9 9 9", info
assert info["units"].endswith("\x1b[2J"), info
assert info["attributes"]["k\x1b]0;title\x07ey"].startswith("\x9b31m \u202e back"), info
assert info["history"]["command"][1] == "\x1b[31m\nholes 1 %", info
END
    # Errors, hints, plans and notes.
    name=$(printf 'no\033[31m\nvkt info: all is well\302\233.nrrd')
    for run in "info|$name" "crop|$name|-o|x.nrrd" "info|in.nrrd|--$name" "$name" "crop|evil.nrrd|--roi|$name|-o|x.nrrd" \
        "write|evil.nrrd|$name/x.nrrd" "write|$name|evil.nrrd" "render|evil.nrrd|-o|$name" "make|$name"; do
        IFS='|' read -r -d '' -a words <<<"$run" || true
        words[-1]=${words[-1]%$'\n'}
        if vkt "${words[@]}" >out 2>err; then echo "no error of $run" >&2; false; fi
        only_shown err
        run ! grep -q '^vkt info: all is well' err
    done
    cp evil.nrrd "$name"
    for table in '' --csv --json; do
        # shellcheck disable=SC2086
        vkt stats "$name" evil.nrrd $table >out
        only_shown out
    done
    vkt render "$name" --size 4 -n -o "$name.png" 2>err
    vkt convert "$name" --dtype int16 -o "$name.mha" -n 2>>err
    vkt flip x "$name" -o - -v 2>>err >x.vkt
    only_shown err
    run ! grep -q '^vkt info: all is well' err
}

@test "files of several variables have all that the page promises of trees" {
    needs_data amr
    for file in "$VKT_DATA/amr/plt_eb_3d" "$VKT_DATA"/amr/flash/*chk*; do
        vkt info "$file" --json >info
        variable=$(python3 -c 'import json; print([k[9:] for k in json.load(open("info"))["attributes"] if k.startswith("variable ")][0])')
        vkt read "$file" --variable "$variable" --no-history | vkt info --json >one
        vkt info --json <"$file" >standard_input 2>/dev/null || rm standard_input # a directory is no standard input
        python3 - "$VKT_ROOT/man/vkt-info.1" <<'END'
import json, os, re, sys
page = open(sys.argv[1]).read()
promised = re.findall(r"^\.Va (\w+)", page[page.index("Fl -json"):], re.M)
info, one = json.load(open("info")), json.load(open("one"))
own = {"level", "cell_width", "not_read"} # of the objects in level_list, and of files with more than is read
own |= {"format_of_name"} # of streams under the name of another format
own |= {"at_most", "values", "because"} # of the object that says of an error
assert len(promised) > 12 and not set(promised) - own - set(info), set(promised) - set(info)
for key in ("dims", "levels", "bricks", "cells", "holes", "level_list"): assert info[key] == one[key], key
assert sum(l["bricks"] for l in info["level_list"]) == info["bricks"]
assert sum(l["cells"] for l in info["level_list"]) == info["cells"]
covered = sum(l["cells"] * l["cell_width"][0] * l["cell_width"][1] * l["cell_width"][2] for l in info["level_list"])
d = info["dims"]
assert abs(info["holes"] - (1 - covered / (d[0] * d[1] * d[2]))) < 1e-5, info
if os.path.exists("standard_input"): assert json.load(open("standard_input"))["level_list"] == info["level_list"]
END
    done
    # Of a series each its own.
    cp -r "$VKT_DATA/amr/plt_eb_3d" plt1
    cp -r plt1 plt2
    vkt info 'plt*' --json | python3 -c 'import json, sys; assert [len(v["level_list"]) for v in json.load(sys.stdin)] == [2, 2]'
}

@test "a picture with colours is said to be one before its pixels are refused" {
    vkt make ramp --dims 8 8 8 -o v.nrrd
    vkt render v.nrrd --colormap viridis --size 16 -o a.png
    vkt info a.png | grep -q '^not read *pixels of [34] channels, colours.*, are refused unless all are opaque and grey'
    vkt info a.png --json | grep -q '"not_read": \["pixels of'
    fails_with 3 "has colours" vkt convert a.png --dtype uint8 -o b.nrrd
    vkt slice v.nrrd --range 0:7 -o grey.png
    run ! grep -q 'not read' <(vkt info grey.png)
}

@test "of several files one that cannot be read leaves the others their report, and the command fails" {
    vkt make ramp --dims 4 3 2 -o first.nrrd
    vkt make ramp --dims 5 3 2 -o second.nrrd
    head -c 60 first.nrrd >cut.nrrd
    for command in info stats; do
        run -4 --separate-stderr vkt $command first.nrrd missing.nrrd cut.nrrd second.nrrd
        [ "$(grep -c '^name *\(first\|second\).nrrd' <<<"$output")" -eq 2 ]
        [[ "$stderr" == "vkt $command: cannot open 'missing.nrrd': no such file or directory; 'cut.nrrd'"* ]]
        run -3 --separate-stderr vkt $command cut.nrrd first.nrrd --json
        [ "$(grep -c '"first.nrrd"' <<<"$output")" -eq 1 ]
        # Alone it is what the command is about.
        fails_with 4 "cannot open 'missing.nrrd'" vkt $command missing.nrrd
    done
    fails_with 2 "unknown option" vkt info first.nrrd missing.nrrd --nothing
}

@test "errors of a few subnormal steps are said, too" {
    vkt make constant --dims 1 4 4 --dtype uint8 | vkt scan | vkt filter sobel --component x | vkt filter box -o tiny.vkt
    timeout 60 vkt info tiny.vkt | grep -q '^error      within 1.*e-322 of exact$'
    timeout 60 vkt info tiny.vkt --json | grep -q '"at_most":1.*e-322'
}
