# Files compressed as a whole, .gz .bz2 .xz .zst, around every format of one file, against the tools of those names.
load helper

setup_more() {
    for tool in gzip bzip2 xz zstd; do command -v $tool >/dev/null || skip "$tool is not installed"; done
    vkt make noise --dims 21 13 9 --dtype int16 --seed 5 -o v.nrrd
    vkt write v.nrrd v.raw
}

tool_of() { case "$1" in gz) echo gzip ;; bz2) echo bzip2 ;; xz) echo xz ;; zst) echo zstd ;; esac; }

@test "what the tools compressed is read, of every format, from files and pipes" {
    for format in nrrd mha nii npy tif vti; do
        vkt write v.nrrd a.$format --force
        for end in gz bz2 xz zst; do
            "$(tool_of $end)" -c a.$format >a.$format.$end
            vkt write a.$format.$end - --format raw | cmp - v.raw
            # Without a name that tells it.
            vkt write - - --format raw <a.$format.$end | cmp - v.raw
        done
    done
    for end in gz bz2 xz zst; do
        "$(tool_of $end)" -c v.raw >r_21x13x9_int16.raw.$end
        vkt write r_21x13x9_int16.raw.$end - --format raw | cmp - v.raw
    done
    # Regions, and several members one after the other.
    for end in gz bz2 xz zst; do
        { head -c 700 a.nii | "$(tool_of $end)" -c; tail -c +701 a.nii | "$(tool_of $end)" -c; } >two.nii.$end
        vkt crop two.nii.$end --roi 3:9,:,4:6 -o - --force | vkt write - - --format raw >part
        vkt crop v.nrrd --roi 3:9,:,4:6 | vkt write - - --format raw | cmp - part
    done
}

@test "HDF5 and TIFF, whose libraries open what has no name" {
    for format in h5 tif; do
        vkt write v.nrrd b.$format 2>err || { grep -q 'without it' err && continue; cat err >&2; false; }
        for end in gz bz2 xz zst; do
            "$(tool_of $end)" -c b.$format >b.$format.$end
            vkt write b.$format.$end - --format raw | cmp - v.raw
        done
    done
}

@test "streams, of several volumes or bricks too" {
    vkt flip x v.nrrd | cat <(vkt read v.nrrd) - >two.vkt
    vkt make amr --blocks 40 -o tree.vkt
    for end in gz bz2 xz zst; do
        "$(tool_of $end)" -c two.vkt >s.vkt.$end
        vkt info s.vkt.$end | grep -c '^volume' | grep -qx 2
        vkt split s.vkt.$end -o 's%d.nrrd' --force
        vkt diff s0.nrrd v.nrrd
        cat s.vkt.$end | vkt split - --along series -o 'p%d.nrrd' --force
        vkt diff p1.nrrd <(vkt flip x v.nrrd)
        vkt write tree.vkt t.vkt.$end
        "$(tool_of $end)" -dc t.vkt.$end | cmp - tree.vkt
        head -c 700 s.vkt.$end >cut.vkt.$end
        fails_with 3 'ended early' vkt write cut.vkt.$end x.nrrd
    done
    [ -z "$(find . -name '.*vkt*')" ]
}

@test "what is written is what the tools decompress, the same for any number of threads" {
    vkt make noise --dims 90 80 70 --dtype uint16 --seed 6 -o n.nrrd
    for format in nrrd mha nii npy tif vti raw; do
        vkt write n.nrrd a.$format
        for end in gz bz2 xz zst; do
            vkt write n.nrrd b.$format.$end --threads 1
            "$(tool_of $end)" -dc b.$format.$end | cmp - a.$format
            vkt write n.nrrd c.$format.$end --threads 3
            cmp b.$format.$end c.$format.$end
            [ "$format" = raw ] || vkt diff n.nrrd b.$format.$end
        done
    done
    [ -z "$(find . -name '.*vkt*')" ]
}

@test "damaged and cut files are errors, wherever that is" {
    for format in nrrd tif; do
        for end in gz bz2 xz zst; do
            vkt write v.nrrd w.$format.$end --force
            size=$(stat -c %s w.$format.$end)
            for keep in 40 $((size / 2)) $((size - 1)); do
                head -c $keep w.$format.$end >cut.$format.$end
                run vkt write cut.$format.$end x.nrrd
                [ "$status" -eq 3 ] || { echo "$format.$end cut at $keep: $status $output" >&2; return 1; }
                [ ! -e x.nrrd ]
            done
            cp w.$format.$end bad.$format.$end
            printf '\xa5\x5a\xa5\x5a' | dd of=bad.$format.$end bs=1 seek=$((size / 2)) conv=notrunc status=none
            run vkt write bad.$format.$end x.nrrd
            [ "$status" -eq 3 ] || { echo "$format.$end damaged: $status $output" >&2; return 1; }
        done
    done
}

@test "what cannot be is said, and leaves nothing" {
    fails_with 2 'is not compressed' vkt write v.nrrd a.nhdr.zst
    fails_with 2 'compressed as a whole already' vkt write v.nrrd a.nrrd.xz --compress
    touch there.tif.gz
    fails_with 4 'exists' vkt write v.nrrd there.tif.gz
    vkt write v.nrrd there.tif.gz --force
    vkt diff v.nrrd there.tif.gz
    head -c 3000 v.nrrd >short.nrrd
    fails_with 3 'ended early' vkt write short.nrrd y.nii.zst
    run vkt write short.nrrd there.tif.gz --force
    [ "$status" -eq 3 ]
    vkt diff v.nrrd there.tif.gz
    [ ! -e y.nii.zst ] && [ -z "$(find . -name '.*vkt*')" ]
}
