# Calls of the operating system that fail or are interrupted: same bytes, or the right exit code and nothing left.
load ../helper

setup_more() {
    command -v strace >/dev/null || skip "strace is absent"
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers need no tracer"
    export OMP_WAIT_POLICY=passive # or vkt starts itself once more, which the tracer would count
    strace -f -qq -o /dev/null true 2>/dev/null || skip "processes cannot be traced here"
    vkt make noise --seed 2 --dims 64 61 67 --dtype uint16 -o in.nrrd
    vkt flip x in.nrrd | vkt write - --format raw >expected.raw
}

# with INJECTION COMMAND…: runs it while a system call misbehaves.
with() {
    local injection="$1"
    shift
    strace -f -qq -o trace -e "inject=$injection" "$@"
}

same() { vkt read "$1" | vkt write - --format raw | cmp - expected.raw; }
no_leftovers() { [ -z "$(find . -name '.*vkt-*')" ] || { find . -name '.*vkt-*' >&2; return 1; }; }

@test "interrupted calls are made again" {
    for call in write writev pwrite64 poll vmsplice sendmsg sendto recvfrom recvmsg; do
        for transport in pipe shm; do
            with $call:error=EINTR:when=1+2 vkt flip x in.nrrd --transport $transport >out.vkt
            same out.vkt
            vkt read in.nrrd --transport $transport | with $call:error=EINTR:when=1+2 vkt flip x >out.vkt
            same out.vkt
            vkt read in.nrrd | with $call:error=EINTR:when=1+2 vkt flip x -o out.nrrd --force
            same out.nrrd
        done
    done
}

@test "interrupted reads are made again" {
    # Of this file only: the loader of programs does not expect it.
    with read,pread64:error=EINTR:when=1+2 -P in.nrrd vkt flip x in.nrrd >out.vkt 2>/dev/null
    grep -q INJECTED trace
    same out.vkt
    mkfifo pipe
    vkt read in.nrrd >pipe &
    with read,pread64,readv:error=EINTR:when=1+2 -P pipe vkt flip x pipe >out.vkt 2>/dev/null
    grep -q INJECTED trace
    same out.vkt
}

@test "calls that move fewer bytes than asked, or none, are continued" {
    local library="$VKT_BUILD/tests/vkt_short_calls.so"
    [ -e "$library" ] || skip "vkt_short_calls is not built"
    short() { env LD_PRELOAD="$library" VKT_SHORT_CALLS_LOG="$PWD/disturbed" "$@"; }
    vkt make noise --seed 4 --dims 128 128 90 --dtype float32 -o large.nrrd
    vkt make amr --blocks 100 -o tree.vkt
    vkt flip z large.nrrd -o large.expected.nrrd
    vkt read tree.vkt | vkt read -o tree.expected.vkt
    for transport in pipe shm; do
        export VKT_TRANSPORT=$transport
        for file in out.nrrd out.mhd out.mha out.vkt; do
            short vkt flip x in.nrrd -o $file --force
            same $file
        done
        short vkt flip x in.nrrd -o packed.nrrd --compress --force
        short vkt read packed.nrrd -o out.nrrd --force
        same out.nrrd
        short vkt read large.nrrd | short vkt flip z --memory 1M 2>/dev/null | short vkt flip x | short vkt flip x |
            short vkt convert --dtype float32 | short vkt write out.nrrd --force
        vkt diff out.nrrd large.expected.nrrd
        short vkt read large.nrrd --no-checksum | short vkt stats --json >stats
        vkt stats large.nrrd --json | cmp - stats
        short vkt read tree.vkt | short vkt read -o tree.out.vkt --force
        cmp tree.out.vkt tree.expected.vkt
    done
    awk '{ n += $1 } END { print NR " processes, " n " calls disturbed"; exit !(NR >= 30 && n > 1000) }' disturbed >&3
}

@test "shared memory that cannot be had is said once, voxels go through the pipe" {
    for injection in memfd_create:error=ENOMEM fallocate:error=ENOSPC fallocate:error=ENOMEM; do
        with $injection vkt flip x in.nrrd --transport shm 2>err | vkt write - --format raw | cmp - expected.raw
        [ "$(grep -c 'voxels go through the pipe' err)" -eq 1 ]
    done
    with memfd_create:error=ENOMEM vkt flip x in.nrrd --transport shm 2>err | vkt stats >/dev/null
    grep -q 'Cannot allocate memory' err
}

@test "a rename that fails keeps the old file and leaves nothing" {
    cp in.nrrd old.nrrd
    for injection in rename:error=EIO rename:error=EINTR linkat:error=EIO:when=2; do
        status=0
        with $injection vkt flip x in.nrrd -o old.nrrd --force 2>err || status=$?
        [ "$status" -eq 4 ]
        [ "$(grep -c '^vkt' err)" -le 2 ]
        cmp in.nrrd old.nrrd
        no_leftovers
    done
}

# Another process removes the file: it needs a moment.
soon_no_leftovers() {
    for _ in $(seq 50); do no_leftovers 2>/dev/null && return; sleep 0.02; done
    no_leftovers
}

@test "killed between naming and renaming: the old file stays, the new one does not" {
    cp in.nrrd old.nrrd
    run with rename:signal=KILL vkt flip x in.nrrd -o old.nrrd --force
    [ "$status" -eq 137 ]
    soon_no_leftovers
    cmp in.nrrd old.nrrd
}

@test "killed where the file system has no unnamed files: nothing stays" {
    local library="$VKT_BUILD/tests/vkt_named_files.so"
    [ -e "$library" ] || skip "vkt_named_files is not built"
    mkfifo pipe
    # In a session of its own, so that the whole group can be killed: also then nothing stays.
    LD_PRELOAD="$library" setsid vkt write pipe out.nrrd 3>&- &
    local writer=$!
    exec 9>pipe
    vkt read in.nrrd | head -c 20000 >&9
    for _ in $(seq 100); do no_leftovers 2>/dev/null || break; sleep 0.02; done
    run ! no_leftovers
    kill -KILL -- -$writer
    exec 9>&-
    soon_no_leftovers
    [ ! -e out.nrrd ]
    LD_PRELOAD="$library" vkt flip x in.nrrd -o out.nrrd
    same out.nrrd
    no_leftovers
}

@test "a write that fails is exit 4 and leaves nothing" {
    for reason in EIO ENOSPC EDQUOT; do
        for file in out.raw out.nrrd out.nrrd.gz.vkt out.mhd; do
            status=0
            with write,pwrite64,writev:error=$reason:when=1 vkt flip x in.nrrd -q -o $file 2>err || status=$?
            grep -q INJECTED trace
            [ "$status" -eq 4 ]
            [ ! -e $file ]
            no_leftovers
        done
    done
}

@test "a read that fails is exit 4 here and 3 downstream, and makes no file" {
    vkt read in.nrrd | vkt write in_64x61x67_uint16.raw
    status=0
    with read,pread64:error=EIO:when=1 -P in_64x61x67_uint16.raw vkt flip z in_64x61x67_uint16.raw \
        >out.vkt 2>err || status=$?
    grep -q INJECTED trace
    [ "$status" -eq 4 ]
    grep -q "cannot read 'in_64x61x67_uint16.raw'" err
    fails_with 3 '' vkt read out.vkt -o x.nrrd
    [ ! -e x.nrrd ]
}

@test "a file beyond the size limit is an error, not a signal" {
    run bash -c 'ulimit -f 100; vkt flip x in.nrrd -o big.nrrd'
    [ "$status" -eq 4 ]
    [[ "$output" == *"big.nrrd"*"too large"* ]]
    [ ! -e big.nrrd ]
    no_leftovers
}
