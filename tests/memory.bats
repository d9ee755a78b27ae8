# What streams holds slabs, not volumes; what needs a whole volume re-reads files and spools pipes; stages overlap.
load helper

setup_more() {
    [ -z "${VKT_SANITIZED:-}" ] || skip "sanitizers keep memory of their own"
    export OMP_WAIT_POLICY=passive
}

# peak COMMAND…: as peak_kib, in MiB.
peak() { echo $(($(peak_kib "$@") / 1024)); }

@test "eight times the volume takes no more memory" {
    vkt make noise --dims 256 256 48 --dtype float32 -o small.nrrd
    vkt make noise --dims 256 256 384 --dtype float32 -o large.nrrd # 96 MiB
    for command in 'flip x' 'flip z' 'convert --dtype uint8 --range 0:1' 'convert --dtype uint8 --range minmax' \
        'filter gaussian --sigma 1' 'resample --scale 0.5' 'arith add' 'crop --roi :,:,2:-2' stats; do
        number=
        [ "$command" != 'arith add' ] || number=1
        output=(-o out.nrrd --force)
        [ "$command" != stats ] || output=()
        # shellcheck disable=SC2086
        small=$(peak vkt $command small.nrrd $number "${output[@]}")
        # shellcheck disable=SC2086
        large=$(peak vkt $command large.nrrd $number "${output[@]}")
        [ "$large" -le $((small + 12)) ] || { echo "$command: $small MiB, then $large MiB" >&2; false; }
    done
}

@test "no operation holds more than its plan says" {
    nice /usr/bin/python3 "$VKT_ROOT/tests/predicted_memory.py" 160 6 uint8 >held || { grep '\*$' held >&2; tail -n 1 held >&2; false; }
    [ "$(grep -c 'said' held)" -gt 90 ]
}

@test "a picture of small integers holds its volume once" {
    vkt make noise --dims 16 16 16 --dtype uint8 -o small.nrrd
    vkt make noise --dims 512 512 256 --dtype uint8 -o large.nrrd # 64 MiB
    small=$(peak vkt render small.nrrd --size 8 --force -o out.png)
    large=$(peak vkt render large.nrrd --size 8 --force -o out.png)
    [ "$large" -le $((small + 64 * 13 / 10)) ] || { echo "$small MiB, then $large MiB" >&2; false; }
}

@test "a file is read again where a pipe is spooled" {
    vkt make noise --dims 64 64 64 -o in.nrrd
    mkdir spool
    export TMPDIR=$PWD/spool
    vkt flip z in.nrrd --memory 100k -o file.nrrd 2>err
    [ ! -s err ]
    vkt read in.nrrd | vkt flip z --memory 100k -o pipe.nrrd 2>err
    grep -q spool err
    [ "$(wc -l <err)" -eq 1 ]
    vkt diff file.nrrd pipe.nrrd
    [ -z "$(ls -A spool)" ]
}

@test "stages overlap: the first slabs leave before the last have come" {
    vkt make noise --dims 64 64 512 --dtype float32 -o in.nrrd # 8 MiB
    vkt read in.nrrd --slab 16 >whole.vkt
    size=$(stat -c %s whole.vkt)
    mkfifo pipe
    for stage in 'flip x' 'filter gaussian --sigma 1' 'resample --scale 0.5' 'convert --dtype uint8 --range 0:1'; do
        # shellcheck disable=SC2086
        timeout 60 vkt $stage pipe --slab 16 >out.vkt 3>&- &
        exec 9>pipe
        head -c $((size / 2)) whole.vkt >&9
        arrived=no
        for _ in $(seq 200); do
            [ "$(stat -c %s out.vkt)" -gt 100000 ] && arrived=yes && break
            sleep 0.05
        done
        tail -c +$((size / 2 + 1)) whole.vkt >&9
        exec 9>&-
        wait
        [ $arrived = yes ] || { echo "$stage waits for all of its input" >&2; false; }
        # shellcheck disable=SC2086
        vkt $stage in.nrrd | vkt diff - out.vkt
    done
}

@test "what does not fit into the address space is exit 5, wherever it is missed" {
    export VKT_PARSER_PATIENCE=2
    vkt make noise --dims 64 64 64 -o in.nrrd
    vkt write in.nrrd in.vdb 2>/dev/null || cp in.nrrd in.vdb
    vkt threshold in.nrrd --above 0.5 -o mask.nrrd
    fitted=0 refused=0
    for room in 16000 17000 18000 19000 20000 25000 30000 40000 60000 100000 200000; do
        (ulimit -v $room && vkt --version >/dev/null 2>&1) || continue # the system's loader says so itself
        for command in 'flip x in.nrrd' 'flip x in.nrrd --threads 16' 'filter gaussian in.nrrd --sigma 2' 'stats in.nrrd' \
            'read in.vdb' 'read in.nrrd' 'render in.nrrd -o out.png --force' 'label mask.nrrd' 'stats in.nrrd --percentiles 1' \
            'convert in.nrrd --dtype uint8 --range p1:p99' 'filter nlmeans in.nrrd --noise auto --search 1' 'make amr --blocks 300'; do
            code=0
            # shellcheck disable=SC2086
            (ulimit -v $room && vkt $command >/dev/null 2>err) || code=$?
            case $code in
            0) fitted=$((fitted + 1)) ;;
            5)
                refused=$((refused + 1))
                [ "$(grep -v 'hint:' err | grep -c .)" -eq 1 ] || { cat err >&2; false; }
                ;;
            *)
                echo "$room kB, $command: exit $code, $(cat err)" >&2
                false
                ;;
            esac
        done
    done
    [ $fitted -gt 0 ] && [ $refused -gt 0 ]
}

# The first blocks are those of constructors before main().
@test "any block of memory may be refused, once or from then on: exit 5, and a line" {
    library=$VKT_BUILD/tests/vkt_no_memory.so
    vkt make noise --dims 64 64 64 -o in.nrrd
    export OMP_WAIT_POLICY=passive # no second start
    for command in 'read in.nrrd' 'filter gaussian in.nrrd --sigma 2' 'stats in.nrrd --percentiles 1' 'render in.nrrd -o out.png --force'; do
        # shellcheck disable=SC2086
        blocks=$(LD_PRELOAD="$library" VKT_NO_MEMORY_AT=-1 vkt $command 2>&1 >/dev/null | tail -n 1)
        [ "$blocks" -gt 100 ]
        refused=0
        for at in $(seq 40 $((blocks / 25 + 1)) "$blocks"); do
            for for in 1 1000000; do
                code=0
                # shellcheck disable=SC2086
                LD_PRELOAD="$library" VKT_NO_MEMORY_AT=$at VKT_NO_MEMORY_FOR=$for vkt $command >/dev/null 2>err || code=$?
                [ $code -eq 0 ] && continue # an optional part, as of a dry run, did without
                [ $code -eq 5 ] && [ "$(grep -v hint: err | grep -c memory)" -eq 1 ] ||
                    { echo "$command, $for blocks from the ${at}th of $blocks on: exit $code, $(cat err)" >&2; false; }
                refused=$((refused + 1))
            done
        done
        [ $refused -gt 20 ]
    done
}

# What each thread holds of its own: rows that are filtered and summed, blocks that are compressed.
@test "as many threads run as the budget has room for, with the same result" {
    vkt make noise --dims 8 8 8 -o tiny.nrrd
    shopt -s extglob
    within() { # within COMMAND…: runs and keeps the budget of $mib MiB, beside what the command takes for a tiny volume.
        local base most
        base=$(peak_kib "${@/%@(cube|wide|whole).nrrd/tiny.nrrd}" --force)
        most=$(peak_kib "${@}" --force)
        [ "$most" -le $((base + 1024 * mib)) ] || { echo "$most KiB beside $base: $*" >&2; false; }
    }
    vkt make noise --dims 256 256 64 --dtype float32 -o cube.nrrd
    vkt make noise --dims 100000 4 6 --dtype float32 -o wide.nrrd
    vkt make noise --dims 1000000 2 2 --dtype int64 -o whole.nrrd
    while read -r mib command; do
        # shellcheck disable=SC2086
        vkt $command --threads 1 --memory 2G --format raw -o one.raw --force
        # shellcheck disable=SC2086
        within vkt $command --threads 64 --memory "${mib}M" --format raw -o many.raw
        cmp one.raw many.raw
    done <<'EOF'
4 filter gaussian cube.nrrd --sigma 2
8 filter gaussian cube.nrrd --sigma 0,0,3
72 filter gaussian wide.nrrd --sigma 1
24 filter gaussian wide.nrrd --sigma 1,0,0
16 resample wide.nrrd --dims 2 4 4
96 resample whole.nrrd --dims 3 2 2
EOF
    # They are told of.
    vkt resample wide.nrrd --dims 2 4 4 --threads 64 --memory 12M -n -o x.vkt 2>plan
    grep -Eq '^vkt resample:   [1-9][0-9]? of 64 threads: the memory has no room' plan || { cat plan >&2; false; }
    vkt resample wide.nrrd --dims 2 4 4 --threads 64 --memory 12M --explain -o y.vkt 2>ran
    [ "$(grep threads: plan)" = "$(grep threads: ran)" ]
    vkt resample wide.nrrd --dims 2 4 4 --threads 2 -n -o x.vkt 2>plan
    run ! grep 'threads:' plan
    # Compression.
    for format in nrrd mha; do
        vkt write cube.nrrd one.$format --compress --force --threads 1
        mib=8
        within vkt write cube.nrrd many.$format --compress --threads 64 --memory 8M
        cmp one.$format many.$format
    done
}

@test "what works on whole volumes takes what its dry run says" {
    vkt make noise --dims 8 8 8 --dtype uint8 -o tiny.nrrd
    vkt make noise --dims 160 160 160 --dtype uint8 -o noise.nrrd
    vkt make noise --dims 160 160 160 --dtype float32 -o floats.nrrd
    vkt filter gaussian noise.nrrd --sigma 3 -o smooth.nrrd
    vkt threshold smooth.nrrd --above 128 -o mask.nrrd
    local command file said base most
    while read -r file command; do
        # shellcheck disable=SC2086
        said=$(vkt $command $file.nrrd -n -o o.vkt --force 2>&1 | sed -n 's/.*peak memory about \([0-9.]*\) MiB.*/\1/p')
        # shellcheck disable=SC2086
        base=$(peak_kib vkt $command tiny.nrrd -q -o o.vkt --force)
        # shellcheck disable=SC2086
        most=$(peak_kib vkt $command $file.nrrd -q -o o.vkt --force)
        echo "$command $file: $said MiB, in fact $(((most - base) / 1024))"
        # A page or two of code, and no more than twice what is needed.
        awk "BEGIN { taken = ($most - $base) / 1024; exit !(taken <= 1.1 * $said + 1.5 && $said <= 2.5 * taken + 8) }"
    done <<'EOF'
mask distance
mask distance --signed
noise distance
smooth refine --tolerance 2
floats refine --tolerance 0.01
floats refine --tolerance 0.1 --block-size 4
floats refine --tolerance 0.3 --block-size mixed
smooth refine --tolerance noise --dtype auto --block-size auto
noise refine --tolerance 0 --block-size mixed
noise refine --tolerance 0 --block-size auto
smooth watershed
EOF
    # Every voxel a component: what is known of them outgrows the budget long before the volume ends.
    base=$(peak_kib vkt label tiny.nrrd --by-value -q -o o.vkt --force)
    most=$(peak_kib bash -c 'vkt label noise.nrrd --by-value --memory 32M -o o.vkt --force 2>err || [ $? -eq 5 ]')
    grep -q 'tables of [1-9][0-9]* runs of voxels' err || { cat err >&2; false; }
    echo "$((most - base)) KiB"
    [ $((most - base)) -le $((48 * 1024)) ]
    fails_with 5 'memory' vkt refine floats.nrrd --tolerance 0.01 --memory 24M -o o.vkt --force
}

@test "what needs a little more than half of the budget for one row is not refused" {
    vkt make noise --dims 8 8 8 -o tiny.nrrd
    truncate -s 272M tall_1024x69632x1_float32.raw # a row of the result comes of 4.25 MiB
    base=$(peak vkt flip x tiny.nrrd)
    most=$(peak vkt resample tall_1024x69632x1_float32.raw --dims 64 64 64 --memory 8M -o out.nrrd)
    [ "$most" -le $((base + 8)) ] || { echo "$most MiB beside $base" >&2; false; }
}

@test "rows that wrap around come from the other side, without those between" {
    vkt make noise --dims 8 8 8 -o tiny.nrrd
    vkt make noise --dims 2048 2048 4 --dtype float32 -o in.nrrd # slices of 16 MiB
    base=$(peak vkt flip x tiny.nrrd)
    for command in 'filter gaussian --sigma 1' 'resample --dims 2048 3000 4 --method cubic'; do
        # shellcheck disable=SC2086
        most=$(peak vkt $command in.nrrd --boundary wrap --memory 8M -o out.nrrd --force)
        [ "$most" -le $((base + 8)) ] || { echo "$command: $most MiB beside $base" >&2; false; }
    done
}

@test "trees: the same cells whatever the budget, the threads and the way they come" {
    export TMPDIR=$PWD/spool
    mkdir spool
    vkt make amr --blocks 600 --levels 5 --block-size 16 -o in.vkt # 9.4 MiB, twice the budget
    local command way memory threads
    result() { # of $command on what is given
        # shellcheck disable=SC2086
        case $command in
        stats* | histogram*) vkt ${command/@/$1} ;;
        *)
            vkt ${command/@/$1} -o out.vkt --force || return
            "$VKT_ROOT/tests/tree_content.py" out.vkt
            ;;
        esac
    }
    while read -r command; do
        result in.vkt >expected
        while read -r way memory threads; do
            export VKT_MEMORY=$memory VKT_THREADS=$threads
            if [ "$way" = file ]; then
                result in.vkt >got
            else
                vkt read in.vkt --transport "$way" | result - >got
            fi
            unset VKT_MEMORY VKT_THREADS
            cmp got expected || { echo "$command: $way, $memory, $threads threads" >&2; false; }
        done <<'EOF'
file 4M 1
file 256M 3
shm 4M 2
pipe 5M 3
EOF
    done <<'EOF'
arith mul @ in.vkt
convert @ --dtype uint8 --range p1:p90
convert @ --dtype uint8 --range minmax
filter gaussian @ --sigma 1
filter median @ --radius 1
flip x @
histogram @ --bins 8 --range 0:1
permute yzx @
stats @ --percentiles 50
EOF
    [ -z "$(ls -A spool)" ]
}

@test "a dry run tells what is held of a tree" {
    vkt make amr --blocks 600 --levels 5 --block-size 16 -o in.vkt
    says() { # TEXT COMMAND…
        local text=$1
        shift
        vkt "$@" --memory 4M -n -o x.vkt 2>plan
        grep -q "$text" plan || { cat plan >&2; false; }
    }
    says 'convert: .*, streaming$' convert in.vkt --dtype uint8
    says 're-reads a file, spools a pipe' convert in.vkt --dtype uint8 --range minmax
    says 'a window of bricks .* spools its result$' filter gaussian in.vkt
    says 'crop: .*, streaming$' crop in.vkt --roi 0:9,:,:
    vkt filter gaussian in.vkt -n -o x.vkt 2>&1 | grep -q 'holds the whole volume'
    fails_with 5 'the budget is 4' vkt resample in.vkt --dims 9 9 9 --memory 4M -n -o x.vkt
    vkt stats in.vkt --memory 4M --explain 2>&1 >report | grep -q 'stats: .*, streaming$'
}

@test "a brick beyond the budget, or one with neighbours that are, is refused before anything is written" {
    vkt make amr --blocks 1 --levels 1 --block-size 120 -o one.vkt # 6.6 MiB
    fails_with 5 'the budget is 4' vkt convert one.vkt --dtype uint8 --range 0:1 --memory 4M -o x.vkt
    fails_with 5 'the budget is 4' vkt stats one.vkt --memory 4M
    vkt make amr --blocks 8 --levels 2 --block-size 60 -o eight.vkt # 0.8 MiB each
    fails_with 5 'a brick with its neighbours' vkt filter gaussian eight.vkt --sigma 1 --memory 6M -o x.vkt
    [ ! -e x.vkt ]
    vkt convert eight.vkt --dtype uint8 --range 0:1 --memory 6M -o x.vkt
}

# Names of operations come from `vkt help --list`, so that what is new is tested, or asks how it can be.
@test "every command keeps its memory budget, on small slices, thick ones and a single one, from files and pipes" {
    export TMPDIR=$PWD
    "$VKT_ROOT/tests/budget.py" "${VKT_BUDGET_MIB:-8}" "${VKT_BUDGET_FACTOR:-$([ -n "${VKT_LONG:-}" ] && echo 16 || echo 3)}"
}

@test "the budget of the documentation: 64 MiB for 2 GiB" {
    [ -n "${VKT_LONG:-}" ] || skip "takes many minutes: set VKT_LONG=1"
    export TMPDIR=$PWD
    "$VKT_ROOT/tests/budget.py" 64 32
}

@test "what no cut can keep is refused before it starts, and a dry run says so" {
    truncate -s 128M wide_16777216x2x1_float32.raw
    fails_with 5 'rows of 64.0 MiB needs 512' vkt flip x wide_16777216x2x1_float32.raw --memory 8M
    truncate -s 16M cube_256x256x64_float32.raw
    fails_with 5 'the budget is 8' vkt refine cube_256x256x64_float32.raw --tolerance 1 --memory 8M -o out.vkt
    fails_with 5 'the budget is 8' vkt refine cube_256x256x64_float32.raw --tolerance 1 --memory 8M -o out.vkt -n
    fails_with 5 'the budget is 8' vkt render cube_256x256x64_float32.raw --memory 8M -o out.png
    fails_with 5 'the budget is 8' vkt render cube_256x256x64_float32.raw --memory 8M -o out.png -n
    # A single row needs 241 others of all slices and more.
    for dry in '' -n; do
        # shellcheck disable=SC2086
        fails_with 5 'the budget is 4' vkt filter gaussian cube_256x256x64_float32.raw --sigma 0,30,60 --boundary wrap \
            --memory 4M -o out.vkt $dry
    done
    [ ! -e out.vkt ] && [ ! -e out.png ]
}

@test "a dry run tells of spools that the budget makes necessary" {
    truncate -s 128M deep_128x128x2048_float32.raw
    vkt filter gaussian deep_128x128x2048_float32.raw --sigma 0,0,40 -n -o x.vkt 2>plan
    grep -q streaming plan
    vkt filter gaussian deep_128x128x2048_float32.raw --sigma 0,0,40 --memory 8M -n -o x.vkt 2>plan
    grep -q 'spools its result' plan
    /usr/bin/python3 - "$(grep -o 'about [0-9.]* MiB' plan | cut -d' ' -f2)" <<'EOF'
import sys
assert float(sys.argv[1]) <= 8
EOF
}

# A component every thirteen voxels: what is told of one takes 200 bytes, and 72 in the table of components.
@test "a report of every component takes no more than their table once more" {
    vkt make noise --dims 128 128 128 --dtype uint8 --high 255 --seed 1 | vkt threshold --above 190 -o noise.nrrd
    base=$(peak_kib vkt label noise.nrrd -q -o o.vkt --force)
    most=$(peak_kib vkt label noise.nrrd -q -o o.vkt --force --report report.json)
    components=$(sed -n 's/.*"components": \([0-9]*\),/\1/p' report.json)
    echo "$components components, $base KiB, with the report $most KiB" >&3
    [ "$components" -gt 100000 ]
    [ "$(grep -c '"label":' report.json)" -eq "$components" ]
    [ $((most - base)) -le $((components * 72 / 1024 * 3 / 2 + 8192)) ]
}
