# The C API beyond one call: streams over descriptors, how calls run and are ended, volkit's names.
load helper

setup_file() {
    [ -n "${VKT_BUILD:-}" ] && [ -z "${VKT_SANITIZED:-}" ] || return 0
    cd "$BATS_FILE_TMPDIR" || exit 1
    for program in streams series calls volkit; do
        cc -std=c99 -pedantic -Wall -Wextra -Werror -I"$VKT_ROOT" "$VKT_ROOT/tests/c/$program.c" -o "$program" \
            -L"$VKT_BUILD/libvkt" -lvkt -lm -pthread -Wl,-rpath,"$VKT_BUILD/libvkt" 2>>compiler || true
    done
}

setup_more() {
    [ -n "${VKT_BUILD:-}" ] || skip "VKT_BUILD does not name a build folder"
    [ -z "${VKT_SANITIZED:-}" ] || skip "a plain C program does not link with a sanitized library"
    [ ! -s "$BATS_FILE_TMPDIR/compiler" ] || { cat "$BATS_FILE_TMPDIR/compiler" >&2; false; }
    PATH=$BATS_FILE_TMPDIR:$PATH
}

make_series() {
    vkt make ramp --dims 40 30 20 --dtype int16 -o a.vkt
    vkt make noise --dims 64 64 64 -o b.vkt
    vkt make amr --blocks 40 --levels 3 -o c.vkt
}

@test "a program in a pipeline passes volumes on as they are, through pipes and shared memory" {
    make_series
    for transport in pipe shm; do
        for volume in a b c; do
            VKT_TRANSPORT=$transport vkt read $volume.vkt | VKT_TRANSPORT=$transport streams cat |
                VKT_TRANSPORT=$transport vkt write got.vkt --force
            cmp $volume.vkt got.vkt
        done
    done
    streams cat --no-checksum <b.vkt >plain.vkt
    vkt diff b.vkt plain.vkt
    # Segments with names of their own, vkt.USER.NAME, are those of tests that run beside this one.
    [ -z "$(ls -A /dev/shm | grep -i vkt | grep -v '^[.]*vkt[.][0-9]*[.]' || true)" ]
}

@test "volumes of a series come one after another" {
    make_series
    cat a.vkt b.vkt a.vkt >series.vkt
    [ "$(streams count <series.vkt)" = 3 ]
    [ "$(cat series.vkt | streams cat | streams count)" = 3 ]
    streams cat <series.vkt | vkt info --json >json
    [ "$(grep -c '"dims"' json)" = 3 ]
}

@test "what went wrong upstream is said with the name of who it was, and told downstream" {
    make_series
    run -3 bash -c "vkt crop a.vkt --roi 90:99,:,: 2>/dev/null | streams count"
    [[ "$output" == *"3: vkt crop: "*"40"* ]]
    run -3 bash -c "vkt crop a.vkt --roi 90:99,:,: 2>/dev/null | streams cat 2>/dev/null | vkt stats"
    [ -z "$output" ] # it was printed once, by the stage that failed
    head -c 60000 b.vkt >short.vkt
    run -3 streams count <short.vkt
    [[ "$output" == *"ended early"* ]]
    run -3 bash -c "streams cat <short.vkt 2>/dev/null | vkt write out.nrrd"
    [ ! -e out.nrrd ]
    run -3 bash -c "cat a.vkt short.vkt | streams count"
    [[ "$output" == *"ended early"*1 ]]
    /usr/bin/python3 -c "
data = bytearray(open('b.vkt', 'rb').read()); data[len(data) // 2] ^= 4; open('damaged.vkt', 'wb').write(data)"
    run -3 streams count <damaged.vkt
    run -3 streams count <"$VKT_ROOT/examples/data/phantom.nrrd"
    run -3 streams count </dev/null
    [[ "$output" == *"it is empty"* ]]
}

@test "a writer's last word reaches the reader" {
    make_series
    run -3 bash -c "streams fail | streams count"
    [[ "$output" == *"streams: the sun is down"* ]]
    run -3 bash -c "streams forget <a.vkt | streams count"
    [[ "$output" == *"streams: the stream was not closed"* ]]
    [ "$(streams refuse)" = refused ]
    # A reader that leaves is an error of the call, not a signal.
    vkt make noise --dims 128 128 128 -o large.vkt
    { streams cat <large.vkt 2>said || echo $? >code; } | head -c 5 >/dev/null
    [ "$(cat code)" = 4 ]
    grep -q "the reader of the stream is gone" said
}

@test "waiting for a stream is ended from the thread that waits" {
    run -6 timeout 20 bash -c "streams cancel < <(exec sleep 30 2>&-)"
    [ "$output" = "4 calls" ]
    make_series
    run -6 timeout 20 bash -c "streams cancel < <(head -c 60000 b.vkt; exec sleep 30 2>&-)"
    # And while a pipe takes no bytes.
    run -0 timeout 20 streams stuck
    [ "$output" = "4 calls" ]
    run -0 timeout 20 streams stuck --transport shm
    # A reader that is slow gets all of it.
    vkt make noise --dims 128 128 128 -o large.vkt
    for transport in pipe shm; do
        streams cat --transport $transport <large.vkt | { sleep 0.3; vkt diff - large.vkt; }
        streams cat --transport $transport <large.vkt | { head -c 100000; sleep 0.2; cat; } | vkt diff - large.vkt
    done
}

@test "each thread has a policy of its own for its calls" {
    run -0 env -u VKT_MEMORY -u VKT_DEVICE VKT_THREADS=5 calls policy
    [ "$output" = "5 threads" ]
}

@test "calls tell how far they are, and what they make is the same" {
    vkt make noise --dims 90 80 70 --dtype uint16 -o noise.nii.gz
    calls watch noise.nii.gz
    vkt read noise.nii.gz | vkt diff - written.nrrd
    vkt diff written.vkt written.nrrd
}

@test "calls of several passes tell evenly how far they are, in ten steps and more" {
    calls even
}

@test "calls that are ended leave nothing behind, and end soon" {
    vkt make noise --dims 90 80 70 --dtype uint16 -o noise.nii.gz
    mkdir spool
    TMPDIR=$PWD/spool calls cancel noise.nii.gz >&2
    [ "$(ls -A | tr '\n' ' ')" = "noise.nii.gz spool " ]
    [ -z "$(ls -A spool)" ]
}

@test "the command reads and writes what vkt_read and vkt_write call streams" {
    make_series
    cat a.vkt b.vkt >series.vkt
    cat >read.c <<'END'
#include "libvkt/c/vkt.h"
#include <stdio.h>
int main(void) {
    vkt_volume* volume = NULL;
    char const* const index[] = {"--index", "1"};
    if (vkt_read("series.vkt", NULL, 0, &volume) != VKT_USAGE) return 1;
    if (vkt_read("series.vkt", index, 2, &volume) != VKT_OK) return puts(vkt_error()), 2;
    if (vkt_write(volume, "out.vkt", NULL, 0) != VKT_OK) return puts(vkt_error()), 3;
    vkt_free(volume);
    return 0;
}
END
    cc -I"$VKT_ROOT" read.c -o read_program -L"$VKT_BUILD/libvkt" -lvkt -Wl,-rpath,"$VKT_BUILD/libvkt"
    ./read_program
    cmp b.vkt out.vkt
}

@test "volkit's volumes, fills and copies" { volkit volumes; volkit fills; volkit copies; }
@test "volkit's trees of bricks" { volkit trees; }
@test "volkit's turns, scaling and resampling" { volkit moves; }
@test "volkit's filters and prefix sums" { volkit filters; }
@test "volkit's functions of the program" { volkit transforms; }
@test "volkit's arithmetic limits and does not wrap" { volkit arithmetic; }
@test "volkit's aggregates, histograms and bricks" { volkit measures; volkit bricks; }

@test "volkit's execution policy is one of each thread" {
    run -0 env WITHOUT_GPU=$(vkt doctor 2>/dev/null | grep -q 'GPU.*none\|no GPU\|without CUDA' && echo 1) volkit policies
    [[ "$output" == "vktFillSV: "*" ms" ]]
}

@test "volkit's rendering writes pictures" {
    volkit pictures
    [ ! -e no ]
    /usr/bin/python3 - <<'END'
import struct, zlib
def pixels(name):
    data = open(name, "rb").read()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height, depth, kind = struct.unpack(">IIBB", data[16:26])
    assert (width, height, depth) == (40, 30, 8), (width, height, depth)
    channels = {2: 3, 6: 4}[kind]
    at, packed = 8, b""
    while at < len(data):
        size, name = struct.unpack(">I4s", data[at:at + 8])
        if name == b"IDAT": packed += data[at + 8:at + 8 + size]
        at += size + 12
    raw, rows, last = zlib.decompress(packed), [], bytes(width * channels)
    for y in range(height):
        line = bytearray(raw[y * (width * channels + 1) + 1:(y + 1) * (width * channels + 1)])
        how = raw[y * (width * channels + 1)]
        for i in range(len(line)):
            a = line[i - channels] if i >= channels else 0
            b, c = last[i], last[i - channels] if i >= channels else 0
            p = a + b - c
            paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            line[i] = (line[i] + (0, a, b, (a + b) // 2, paeth)[how]) % 256
        rows.append(line); last = line
    return rows, channels
rows, channels = pixels("red.png")
middle = rows[15][20 * channels:20 * channels + 3]
assert middle[0] > 200 and max(middle[1:]) < 30, list(middle)  # the table's red, opaque
assert max(rows[0][:3]) < 40, list(rows[0][:3])
pixels("iso.png")
END
}

@test "series: counted, read, chosen from, written; nothing remains of what was not closed" {
    vkt make noise --dims 24 20 16 --dtype uint8 -o a.nrrd
    for i in 1 2 3; do vkt transform "v / $i" a.nrrd -o $i.nrrd; done
    for format in nrrd nii.gz vkt; do
        vkt stack a.nrrd 1.nrrd 2.nrrd 3.nrrd -o series.$format
        [ "$(series round series.$format again.$format)" = "4 2" ]
        vkt stack a.nrrd 1.nrrd 2.nrrd 3.nrrd 1.nrrd -o want.$format
        for i in 0 1 2 3 4; do
            vkt read want.$format --index $i | vkt diff - <(vkt read again.$format --index $i)
        done
        run ! vkt read again.$format --index 5
    done
    series wrong series.nii.gz
    [ -z "$(find . -name '*left*')" ]
}

@test "slices and bricks go apart and together in memory" {
    vkt make noise --dims 24 20 16 --dtype uint16 -o a.nrrd
    [ "$(series pieces a.nrrd)" = 12 ]
}

@test "volkit's files" {
    vkt make ramp --dims 24 20 16 --dtype uint8 | vkt write v_24x20x16_uint8.raw
    [ "$(volkit files v_24x20x16_uint8.raw)" = "24 20 16 4" ]
    volkit regions v_24x20x16_uint8.raw
    vkt read v_24x20x16_uint8.raw | vkt flip x | vkt write want_24x20x16_uint8.raw
    vkt read out.nrrd | vkt write got_24x20x16_uint8.raw
    cmp want_24x20x16_uint8.raw got_24x20x16_uint8.raw
}

@test "surfaces: vertices and triangles in memory, and the file that the command writes" {
    run -0 calls surface
    vkt make sphere --dims 24 24 24 --radius 8 | vkt mesh --iso 0.5 --normals -o command.ply
    cmp ball.ply command.ply
}
