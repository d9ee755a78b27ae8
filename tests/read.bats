# vkt read: raw files by name and by options, regions that read only what they need, inputs that are refused.
load helper

setup_more() {
    # 7 x 5 x 3 samples of int16, little-endian: 0, 1, 2, …
    for i in $(seq 0 104); do printf '%b' "$(printf '\\x%02x\\x00' "$i")"; done >ramp_7x5x3_int16.raw
}

voxels() { vkt write - --format raw; }

@test "dims and type stand in the name" {
    vkt info ramp_7x5x3_int16.raw --json >info
    python3 - <<'END'
import json
info = json.load(open("info"))
assert info["dims"] == [7, 5, 3] and info["dtype"] == "int16" and info["kind"] == "structured", info
assert info["spacing"] == [1, 1, 1] and info["origin"] == [0, 0, 0], info
END
    vkt read ramp_7x5x3_int16.raw | voxels | cmp - ramp_7x5x3_int16.raw
}

@test "dims and type by options, from a file, a pipe and a redirection" {
    cp ramp_7x5x3_int16.raw x
    vkt read x --dims 7 5 3 --dtype int16 | voxels | cmp - x
    vkt read x --dims 7,5,3 --dtype short | voxels | cmp - x
    cat x | vkt read --dims 7 5 3 --dtype i16 | voxels | cmp - x
    vkt read - --dims 7 5 3 --dtype i16 <x | voxels | cmp - x
    vkt read -i x -dims 7 5 3 --dtype i16 | voxels | cmp - x
    vkt read --input x --dims 7 5 3 --dtype i16 | voxels | cmp - x
}

@test "skip, byte order and spacing" {
    { printf 'HEADER'; cat ramp_7x5x3_int16.raw; } | python3 -c '
import sys
data = bytearray(sys.stdin.buffer.read())
data[6::2], data[7::2] = data[7::2], data[6::2]
sys.stdout.buffer.write(data)' >big
    vkt read big --dims 7 5 3 --dtype int16 --skip 6 --endian big --spacing 0.5,1,2 -o a.vkt
    vkt read a.vkt | voxels | cmp - ramp_7x5x3_int16.raw
    vkt info a.vkt --json | python3 -c 'import json, sys; assert json.load(sys.stdin)["spacing"] == [0.5, 1, 2]'
}

@test "the byte order stands in the name as well, also of what is written" {
    python_with numpy
    /usr/bin/python3 - <<'END'
import numpy
a = numpy.arange(-12, 12, dtype=">i2") * 300
for name in ("x_4x3x2_int16_be.raw", "x_int16_be_4x3x2.raw", "x_int16be_4x3x2.raw", "x_4x3x2_int16_msb.raw",
             "x_4x3x2_int16_big-endian.raw", "X_4X3X2_INT16_BigEndian.raw"):
    a.astype(">i2").tofile(name)
for name in ("expected", "x_4x3x2_int16_le.raw", "to_be_or_not_4x3x2_int16.raw", "x_4x3x2_int16le.raw",
             "x_4x3x2_int16_little_endian.raw", "maybe_4x3x2_int16.raw"):
    a.astype("<i2").tofile(name)
END
    for name in *4[xX]3[xX]2*.raw; do
        vkt read "$name" | vkt write - --format raw | cmp - expected || { echo "$name" >&2; false; }
        vkt read "$name" | vkt write "out_$name"
        cmp "$name" "out_$name"
    done
    # What is said beats the name.
    vkt read x_4x3x2_int16_be.raw --endian little | vkt write - --format raw | cmp - x_4x3x2_int16_be.raw
    vkt read expected --dims 4 3 2 --dtype int16 | vkt write y_4x3x2_int16_be.raw.gz
    gzip -dc y_4x3x2_int16_be.raw.gz | cmp - x_4x3x2_int16_be.raw
    # More than is written at once.
    vkt make noise --dims 100 90 17 --dtype float32 | vkt write n_100x90x17_float32_be.raw
    vkt make noise --dims 100 90 17 --dtype float32 | vkt write n.raw
    /usr/bin/python3 -c '
import numpy
assert (numpy.fromfile("n_100x90x17_float32_be.raw", ">f4") == numpy.fromfile("n.raw", "<f4")).all()'
}

@test "detached headers stay in their directory and with regular files, unless paths are trusted" {
    mkdir set elsewhere
    printf 'abcdefgh' | tee set/in.raw >elsewhere/secret.raw
    mkfifo set/fifo
    ln -s ../elsewhere/secret.raw set/leaves.raw
    ln -s in.raw set/stays.raw
    nrrd() { printf 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: %b\n' "$1" >set/h.nhdr; }
    metaimage() { printf 'NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = %b\n' "$1" >set/h.mhd; }
    for outside in "$PWD/elsewhere/secret.raw" ../elsewhere/secret.raw leaves.raw 'LIST 3\nleaves.raw'; do
        nrrd "$outside"
        metaimage "${outside/LIST 3/LIST 3D}"
        for name in set/h.nhdr set/h.mhd; do
            for command in info read "flip x" "write --format raw -o -" stats "diff $name"; do
                # shellcheck disable=SC2086
                fails_with 3 "$name" vkt $command $name
                [[ "$stderr" == *"--trust-paths"* ]] || { echo "$command $outside: $stderr" >&2; false; }
            done
            vkt read $name --trust-paths | vkt write - --format raw | cmp - set/in.raw
            vkt flip x $name --trust-paths | vkt flip x | vkt write - --format raw | cmp - set/in.raw
            vkt pipe --trust-paths "read $name | write - --format raw" | cmp - set/in.raw
            vkt make constant --dims 4 4 4 | vkt crop --like $name --trust-paths | vkt info | grep -q 'dims  *2 2 2'
            (cd set && fails_with 3 trust-paths vkt read - <"../$name")
        done
    done
    # None of these waits for a writer or reads without end.
    for special in fifo /dev/zero . /etc/passwd; do
        nrrd "$special"
        metaimage "$special"
        fails_with 3 "$special" timeout 20 vkt info set/h.nhdr
        fails_with 3 "$special" timeout 20 vkt info set/h.mhd
    done
    nrrd fifo
    cat set/in.raw >set/fifo &
    vkt read set/h.nhdr --trust-paths | vkt write - --format raw | cmp - set/in.raw
    wait
    for inside in in.raw stays.raw ./in.raw ../set/in.raw; do
        nrrd "$inside"
        vkt read set/h.nhdr | vkt write - --format raw | cmp - set/in.raw
    done
    # Of no use where nothing is read, and no part of the history.
    fails_with 2 trust-paths vkt make constant --trust-paths
    nrrd ../elsewhere/secret.raw
    vkt read set/h.nhdr --trust-paths | vkt history >steps
    grep -q read steps
    run ! grep -q trust steps
}

@test "wrong byte counts name both numbers" {
    head -c 209 ramp_7x5x3_int16.raw >short_7x5x3_int16.raw
    fails_with 3 "210 bytes expected, 209 found" vkt info short_7x5x3_int16.raw
    { cat ramp_7x5x3_int16.raw; echo; } >long_7x5x3_int16.raw
    fails_with 3 "210 bytes expected, 211 found" vkt info long_7x5x3_int16.raw
    run -3 bash -o pipefail -c 'cat short_7x5x3_int16.raw | vkt read --dims 7 5 3 --dtype int16 | cat >/dev/null'
    [[ "$output" == *"210 bytes expected, 209 found"* ]]
    run -3 bash -o pipefail -c 'cat long_7x5x3_int16.raw | vkt read --dims 7 5 3 --dtype int16 | cat >/dev/null'
    [[ "$output" == *"210 bytes expected, 211 found"* ]]
}

@test "what is unknown is asked for" {
    cp ramp_7x5x3_int16.raw x.raw
    fails_with 2 "--dims X Y Z --dtype TYPE" vkt read x.raw -o y.vkt
    fails_with 2 "--dtype" vkt read x.raw --dims 7 5 3 -o y.vkt
    cp ramp_7x5x3_int16.raw x
    fails_with 3 "no format that vkt knows" vkt read x -o y.vkt
    : >empty.raw
    fails_with 3 "" vkt read empty.raw --dims 1 1 1 --dtype u8 -o y.vkt
    fails_with 4 "no such file" vkt read nowhere.nrrd -o y.vkt
    fails_with 4 "is a directory" vkt read . -o y.vkt
    fails_with 2 "did you mean 'nrrd'" vkt read x --format nrd -o y.vkt
    fails_with 2 "two inputs" vkt read x -i x -o y.vkt
    fails_with 2 "exclude each other" vkt read x --roi 1,1,1 --roi-world 1:2,1:2,1:2 -o y.vkt
    fails_with 2 "--skip -3" vkt read ramp_7x5x3_int16.raw --skip -3 -o y.vkt
    [ ! -e y.vkt ]
}

@test "impossible dims are refused before anything is allocated" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers need all of the address space and no tracer"
    for dims in "1000000 1000000 1000000" "1099511627776 1099511627776 1099511627776" "0 1 1" "-1 5 3"; do
        # shellcheck disable=SC2086
        run -3 bash -c "ulimit -v 2000000; vkt read ramp_7x5x3_int16.raw --dims $dims -o y.vkt"
    done
    [ ! -e y.vkt ]
}

@test "a region is that part of the whole, with its place in the world" {
    python_with numpy
    vkt read ramp_7x5x3_int16.raw --spacing 2 --roi 2:5,1:-1,1 -o part.nrrd
    vkt read part.nrrd | voxels >part
    /usr/bin/python3 - <<'END'
import numpy
whole = numpy.fromfile("ramp_7x5x3_int16.raw", "<i2").reshape(3, 5, 7)
assert (numpy.fromfile("part", "<i2").reshape(1, 3, 3) == whole[1:2, 1:4, 2:5]).all()
END
    vkt info part.nrrd --json | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["dims"] == [3, 3, 1] and info["origin"] == [4, 2, 2] and info["spacing"] == [2, 2, 2], info'
    vkt read ramp_7x5x3_int16.raw --spacing 2 --roi-world 4:8,2:6.5,2:3 | voxels | cmp - part
    # The same forward, from a pipe.
    vkt read - --dims 7 5 3 --dtype int16 --roi 2:5,1:-1,1 <ramp_7x5x3_int16.raw | voxels | cmp - part
    cat ramp_7x5x3_int16.raw | vkt read --dims 7 5 3 --dtype int16 --roi 2:5,1:-1,1 | voxels | cmp - part
    fails_with 2 "roi" vkt read ramp_7x5x3_int16.raw --roi 2:9,:,: -o y.vkt
}

@test "a region reads only the bytes it needs" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers need all of the address space and no tracer"
    command -v strace >/dev/null || skip "strace is not installed"
    truncate -s 512M big_512x1024x512_uint16.raw
    strace -f -y -e trace=read,pread64,preadv -o trace vkt read big_512x1024x512_uint16.raw --roi :,:,100:104 -o part.raw
    grep big_512 trace | sed -n 's/.*= \([0-9]*\)$/\1/p' | python3 -c '
import sys
total = sum(map(int, sys.stdin))
assert 4 * 1024 * 1024 <= total < 4 * 1024 * 1024 + 65536, total'
    [ "$(stat -c %s part.raw)" -eq 4194304 ]
    strace -f -y -e trace=read,pread64,preadv -o trace vkt read big_512x1024x512_uint16.raw --roi :,10:20,7 -o part2.raw
    grep big_512 trace | sed -n 's/.*= \([0-9]*\)$/\1/p' | python3 -c '
import sys
total = sum(map(int, sys.stdin))
assert 10240 <= total < 10240 + 65536, total'
}

@test "a region of a file with a header reads only the bytes it needs" {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers need all of the address space and no tracer"
    command -v strace >/dev/null || skip "strace is not installed"
    truncate -s 512M big.raw
    printf 'NRRD0004\ntype: ushort\ndimension: 3\nsizes: 512 1024 512\nencoding: raw\nendian: little\n' >head
    { cat head; printf '\n'; cat big.raw; } | dd of=big.nrrd bs=1M iflag=fullblock conv=sparse status=none
    { cat head; printf 'data file: big.raw\n\n'; } >big.nhdr
    printf 'ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nDimSize = 512 1024 512\nElementType = MET_USHORT\n' >head
    { cat head; printf 'ElementDataFile = LOCAL\n'; cat big.raw; } | dd of=big.mha bs=1M iflag=fullblock conv=sparse status=none
    { cat head; printf 'ElementDataFile = big.raw\n'; } >big.mhd
    for name in big.nrrd big.nhdr big.mha big.mhd; do
        strace -f -y -e trace=read,pread64,preadv,mmap -o trace vkt read $name --roi :,10:20,7 -o part.raw --force
        [ "$(stat -c %s part.raw)" -eq 10240 ]
        grep "/big\." trace | sed -n 's/.*= \([0-9]*\)$/\1/p' | python3 -c '
import sys
total = sum(map(int, sys.stdin))
assert 10240 <= total < 10240 + 65536, (sys.argv[1], total)' $name
        # It is the file that is read and not a mapping of it.
        run ! grep -q "mmap.*/big\." trace
    done
}

@test "a named pipe and a process substitution are read once" {
    mkfifo fifo
    cat ramp_7x5x3_int16.raw >fifo &
    vkt read fifo --dims 7 5 3 --dtype int16 | voxels | cmp - ramp_7x5x3_int16.raw
    vkt read ramp_7x5x3_int16.raw -o a.nrrd
    vkt read <(cat a.nrrd) | voxels | cmp - ramp_7x5x3_int16.raw
}

@test "samples from elsewhere are read" {
    needs_data raw/stent_128x128x256_int16.raw
    [ "$(vkt read "$VKT_DATA/raw/stent_128x128x256_int16.raw" | voxels | sha256sum)" = "$(sha256sum <"$VKT_DATA/raw/stent_128x128x256_int16.raw")" ]
    [ "$(vkt read "$VKT_DATA/metaimage/HeadMRVolume.mhd" | voxels | sha256sum)" = "$(sha256sum <"$VKT_DATA/metaimage/HeadMRVolume.raw")" ]
    vkt info "$VKT_DATA/metaimage/HeadMRVolume.mhd" --json | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["dims"] == [48, 62, 42] and info["spacing"] == [4, 4, 4], info'
    vkt info "$VKT_DATA/nrrd/template_T2.nrrd" --json | python3 -c '
import json, sys
info = json.load(sys.stdin)
assert info["dims"] == [117, 159, 126] and info["origin"] == [-49.84375, 67.890625, -53.7109375], info'
}

@test "parts of a plot file, a store or a pair name the whole" {
    vkt make amr --blocks 20 --levels 2 | vkt write - plt --format amrex
    for part in Header Level_0 Level_0/Cell_H Level_0/Cell_D_00000; do fails_with 3 "is a part of 'plt'" vkt info plt/$part; done
    fails_with 3 "is a part of '$PWD/plt'" vkt info "$PWD/plt/Level_0/Cell_H"
    vkt make ramp --dims 9 8 7 --dtype uint8 -o a.zarr
    part=$(find a.zarr -type f -size +100c | grep -v '/[.]z\|json' | head -1)
    fails_with 3 "is a part of 'a.zarr'" vkt info "$part"
    vkt make ramp --dims 9 8 7 --dtype uint8 -o pair.mhd
    fails_with 2 "but 'pair.mhd' says them" vkt info pair.raw
    fails_with 2 "but 'pair.mhd' says them" vkt read pair.raw
    # A header that names other voxels is not theirs.
    cp pair.raw other.raw
    sed 's/pair.raw/elsewhere.raw/' pair.mhd >other.mhd
    fails_with 2 "'other.raw': dims are unknown" vkt info other.raw
    [[ "$stderr" == *"say vkt read other.raw"* ]]
    vkt read pair.raw --dims 9 8 7 --dtype uint8 | vkt diff - pair.mhd
}

@test "what lies where a file should be is said: pointers of version control, pages of the web" {
    printf 'version https://git-lfs.github.com/spec/v1\noid sha256:0123\nsize 5\n' >scan.nrrd
    fails_with 3 "'scan.nrrd' is a pointer of Git LFS, not the file itself" vkt info scan.nrrd
    printf '/annex/objects/MD5E-s5--0123.nii.gz\n' >scan.nii
    fails_with 3 "is a pointer of git-annex" vkt read scan.nii -o a.vkt
    for name in page.nrrd page.mha page.tif page.vti page.dcm page; do
        printf '<!DOCTYPE html>\n<html><body>404</body></html>\n' >$name
        fails_with 3 "is a page of the web" vkt info $name
    done
}

@test "files of formats that are not read are named by what they are" {
    printf 'GIF8900000000' >a.bin
    fails_with 3 "'a.bin' is a GIF picture, a format that vkt does not read" vkt read a.bin -o a.vkt
    printf '\377\330\377aaaaaaaa' >b.bin
    fails_with 3 "is a JPEG picture" vkt read b.bin -o a.vkt
    printf 'SIMPLE  =                    T' | gzip >c.bin
    fails_with 3 "is a FITS file, compressed as a whole, a format" vkt info c.bin
    printf 'CDF\001aaaaaaaa' >d.bin
    fails_with 3 "is a NetCDF file" vkt info d.bin
    printf '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid">' >e.bin
    fails_with 3 "is a VTK XML file" vkt info e.bin
    printf '\016\003\023\001aaaaaaaa' >h.bin
    fails_with 3 "is an HDF4 file" vkt info h.bin
    printf 'NanoVDB2aaaaaaaa' >h.bin
    fails_with 3 "is a NanoVDB file" vkt info h.bin
    printf 'a\n' >member
    tar -cf t.bin member
    fails_with 3 "is a tar archive" vkt info t.bin
    fails_with 3 "unpack it" vkt info t.bin
    gzip t.bin
    fails_with 3 "is a tar archive, compressed as a whole" vkt info t.bin.gz
    # What does not say it in its first bytes, by its name, and what makes of it something that is read.
    printf '\000\000\000\001' | gzip >m.mgz
    fails_with 3 "'m.mgz' is a FreeSurfer volume, a format that vkt does not read" vkt info m.mgz
    fails_with 3 "mri_convert" vkt info m.mgz
    printf '<?xml version="1.0"?>\n<VTKFile type="RectilinearGrid">' >r.vtr
    fails_with 3 "in ParaView: Resample To Image" vkt info r.vtr
    printf 'nothing known' >f.bin
    fails_with 3 "vkt read f.bin --dims X Y Z --dtype TYPE | vkt info" vkt info f.bin
    # What is known to hold no bare voxels is not taken for them.
    printf 'BM\106\000\000\000\000\000\000\000\066\000\000\000\050\000\000\000aaaaaaaaaaaaaaaa' >b.bmp
    fails_with 3 "is a BMP picture" vkt info b.bmp
    printf '\000\000\000\014jP  \r\n\207\naaaa' >j.jp2
    fails_with 3 "is a JPEG 2000 picture" vkt info j.jp2
    printf 'x,y,z\n1,2,3 \303\244\n' >t.csv
    fails_with 3 "is plain text" vkt info t.csv
    [[ "$stderr" != *--dims* ]]
    # Bytes that could be voxels still are.
    printf 'BMaaaaaaaaaaaaaaaaaa\n\001' >v.bin
    fails_with 3 "--dims X Y Z" vkt info v.bin
}

@test "bare voxels are described to the command that takes the description" {
    cp ramp_7x5x3_int16.raw x.raw
    fails_with 2 "say vkt read x.raw --dims X Y Z --dtype TYPE | vkt info, or name it" vkt info x.raw
    fails_with 2 "say vkt read x.raw --dims X Y Z --dtype TYPE | vkt flip, or" vkt flip x x.raw -o y.nrrd
    fails_with 2 "say vkt read x.raw --dims X Y Z --dtype TYPE | vkt filter box, or" vkt filter box x.raw --radius 1 -o y.nrrd
    fails_with 2 "| vkt stack" vkt stack x.raw x.raw -o y.nrrd
    fails_with 2 "say --dims X Y Z --dtype TYPE, or" vkt read x.raw -o y.nrrd
    cp ramp_7x5x3_int16.raw x_7x5x3.raw
    fails_with 2 "say vkt read x_7x5x3.raw --dtype TYPE | vkt info, or" vkt info x_7x5x3.raw
}
