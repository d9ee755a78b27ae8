#!/bin/sh
# The command on the GPU and on the CPU, step by step and as pipelines: commands.sh VKT
# VKT_ONLY: only pipelines that this extended regular expression matches. Without VKT_LONG some 2400 of those that there are: a build draws its own.
# SPDX-License-Identifier: MIT
set -eu
vkt=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
"$vkt" make ramp --dims 4 4 4 -o tiny.nrrd
if ! reason=$("$vkt" flip x tiny.nrrd --device gpu -o out.nrrd 2>&1); then
    echo "skipped: $reason"
    exit 77
fi
failed=0 checked=0

last=$(($(nvidia-smi -L 2>/dev/null | grep -c '^GPU' || true) - 1))
[ "$last" -ge 0 ] || last=0
gpu=gpu

# same TOLERANCE PIPELINE…: on $gpu as on the CPU, largest difference at most TOLERANCE of the range, or the same text
# if that is `text`; a pipeline may name the device as $DEVICE. Notes what
# compare_all then runs, several at a time: a process takes half a second to get hold of a GPU.
same() {
    tolerance=$1
    shift
    echo "$tolerance $*" >>comparisons
}
cat >compare.sh <<'END'
# compare.sh VKT GPU "TOLERANCE PIPELINE…"
here=$(mktemp -d here.XXXXXX)
trap 'rm -rf "$here"' EXIT
tolerance=${3%% *} pipeline=${3#* }
for device in cpu "$2"; do
    DEVICE=$device VKT_DEVICE=$device sh -c "$pipeline" >"$here/${device%:*}.vkt" || {
        echo "FAILED on $device: $pipeline"
        exit 0
    }
done
if [ "$tolerance" = text ]; then
    cmp "$here/cpu.vkt" "$here/gpu.vkt" >"$here/report" || {
        echo "FAILED: differs: $pipeline"
        diff "$here/cpu.vkt" "$here/gpu.vkt" | head -8
    }
    exit 0
fi
"$1" diff "$here/cpu.vkt" "$here/gpu.vkt" --tolerance "$tolerance" >"$here/report" || {
    echo "FAILED: differs: $pipeline"
    cat "$here/report"
}
END
compare_all() {
    if [ -n "${VKT_ONLY:-}" ]; then
        grep -E -e "$VKT_ONLY" comparisons >chosen || true
        mv chosen comparisons
    fi
    [ -s comparisons ] || return 0
    if [ -z "${VKT_LONG:-}" ] && [ "$(wc -l <comparisons)" -gt 2400 ]; then
        echo "2400 of $(wc -l <comparisons) comparisons are made; all with VKT_LONG=1"
        shuf -n 2400 --random-source="$vkt" comparisons >drawn
        mv drawn comparisons
    fi
    # Told as they are found: what a limit of time ends has been told until then.
    tr '\n' '\0' <comparisons | xargs -0 -n 1 -P "$(nproc)" sh compare.sh "$vkt" "$gpu" | tee results
    checked=$((checked + $(wc -l <comparisons)))
    failed=$((failed + $(grep -c '^FAILED' results || true)))
    : >comparisons
}

# Kernels that do not separate: without gaps, with gaps, wide, and of 5^3.
weights() { awk -v n="$1" -v gap="$2" 'BEGIN { for (i = 0; i < n; ++i) print (gap && i % 3 == 1) ? 0 : (i * 7919 % 101 - 50) / (50 * n) }'; }
{ echo 3 3 3; weights 27 0; } >cube.txt
{ echo 3 3 3; weights 27 1; } >cross.txt
{ echo 25 3 1; weights 75 0; } >long.txt
{ echo 5 5 5; weights 125 0; } >five.txt
# Sums of many voxels that results have no room for on the way.
heavy() { awk -v n="$1" -v gap="$2" 'BEGIN { for (i = 0; i < n; ++i) print (gap && i % 4 == 1) ? 0 : i % 5 < 3 ? 0.9 : -1.2 - i % 2 / 8 }'; }
{ echo 3 3 3; heavy 27 0; } >heavy.txt
{ echo 3 3 3; heavy 27 1; } >heavy_gaps.txt
{ echo 15 5 1; heavy 75 0; } >heavy_long.txt
for type in uint8 uint16 int16 float32 float64; do
    "$vkt" make noise --dims 130 67 41 --dtype $type --seed 3 -o in_$type.nrrd
    case $type in float*) tolerance=1e-6 ;; *) tolerance=0 ;; esac
    for command in 'fill --value 7 --roi 10:100,5:,3:30' 'flip x' 'flip y' 'flip z' 'crop --roi 3:-2,1:,5:-1' \
        'resample --scale 0.5' 'resample --dims 77 91 53 --method linear' 'resample --dims 200 50 50 --method nearest' \
        'resample --scale 0.7 --method cubic' 'resample --dims 150 90 50 --boundary border:30.5'; do
        same "$tolerance" "$vkt $command in_$type.nrrd"
    done
    # Moved: bytes where nothing is interpolated.
    for command in 'permute zyx' 'permute yxz' 'permute xzy' 'permute zxy' 'permute yzx' 'pad --by 3:5,0:7,2:0' \
        'pad --by 200:5,3:90,50:60 --boundary mirror' 'pad --by 1:1,2:2,70:70 --boundary wrap' 'rotate --axis z --angle 90' \
        'rotate --axis y --angle 20 --method nearest' 'rotate --axis 1,2,3 --angle 40 --method nearest --expand' \
        'morphology erode --radius 2' 'morphology dilate --radius 3,1,2 --shape box' 'morphology open --radius 1' \
        'morphology close --radius 2 --boundary border:30' 'morphology gradient --radius 1' \
        'morphology tophat --radius 2 --shape box --roi 10:50,:,3:20'; do
        same 0 "$vkt $command in_$type.nrrd -q"
    done
    # Sums and interpolants: as CPUs with AVX2 compute them, but for sines and what is summed in another order.
    case $type in float*) tolerance=1e-6 ;; *) tolerance=1 ;; esac
    for command in 'rotate --axis z --angle 20' 'rotate --axis 1,2,3 --angle 33 --method cubic' \
        'rotate --axis z --angle 20 --method bspline3' 'rotate --axis 3,1,2 --angle 50 --method bspline5 --boundary mirror' \
        'rotate --axis x --angle 7 --method lanczos3 --boundary wrap' 'rotate --axis z --angle 15 --boundary border:9 --expand' \
        'rotate --axis z --angle 15 --roi 20:100,5:60,:' 'rotate --axis z --angle 15 --roi 20.25:100,5:60.5,2.75:' \
        'scale --factor 1.2 --roi 20.25:100,5:60.5,: --boundary mirror' 'rotate --axis 1,1,0 --angle 11 --method bspline3 --boundary wrap' \
        'scale --factor 1.3,0.7,1' 'scale --factor 0.6 --method cubic' 'filter box --radius 2' \
        'filter box --radius 9,0,3 --boundary wrap' 'filter box --radius 1 --roi 5:50,3:60,:'; do
        same "$tolerance" "$vkt $command in_$type.nrrd -q"
    done
    # Linear in float32 where slices stay slices: what CPUs make to the bit, of rows that are aligned and that are not,
    # beside voxels that are not finite, and of slices that lie elsewhere.
    if [ $type != float64 ]; then
        "$vkt" crop in_$type.nrrd --roi 1:129,:,1: -o even_$type.nrrd
        [ $type != float32 ] ||
            "$vkt" transform 'x==40 && y==30 && z>10 ? 0/0 : z==25 && x>100 ? 1/0 : x<20 ? -0.0 : v' in_float32.nrrd -q -o even_float32.nrrd --force
        for command in '--axis z --angle 0.3' '--axis z --angle -61 --expand' '--axis z --angle 137 --boundary clamp' \
            '--axis y --angle 20' '--axis y --angle 89.9 --boundary mirror' '--axis y --angle -100 --roi 5:90,3:50,7:33' \
            '--axis z --angle 20 --roi 5:90,3:50,7:33 --background 3'; do
            same 0 "$vkt rotate $command in_$type.nrrd -q"
            same 0 "$vkt rotate $command even_$type.nrrd -q"
        done
        echo "0.9 -0.3 0 2  0.4 0.8 0 -1  0 0 1 7" >shifted.txt
        same 0 "$vkt affine shifted.txt even_$type.nrrd -q"
    fi
    for expression in v 7.25 x wy 'z*2' 'v[0,3,0]' 'v*2+1' 'sqrt(abs(v-20))' 'v[1,0,0]-v[-1,0,0]+v[0,2,-1]' 'v>30 ? sin(x/7)+cos(wy) : mod(v, 7)' \
        'max(min(v,50),3)+nz*hypot(x,y)' 'exp(-v/50)*log(1+v)' 'atan2(v,x+1)+pow(v,0.5)' 'clamp(v,10,20)+floor(z/3)' '1/(v-50)'; do
        same "$tolerance" "$vkt transform '$expression' in_$type.nrrd -q"
    done
    same "$tolerance" "$vkt transform 'v+a*0.5' in_$type.nrrd in_float32.nrrd -q"
    for expression in 'v[0,0,17]' 'v[0,0,40]-v[0,0,-2]' 'v[0,0,-20]' 'v[1,2,128]+v[0,0,-128]'; do
        same "$tolerance" "$vkt read in_$type.nrrd | $vkt transform '$expression' --slab 5 -q"
    done
    for command in sobel gradient laplacian 'log --sigma 1.5' 'dog --sigma 1' 'sharpen --sigma 1' 'gradient --roi 5:50,:,:' \
        'kernel cube.txt' 'kernel cross.txt --boundary wrap' 'kernel long.txt' 'kernel five.txt --boundary border:3'; do
        same 1e-5 "$vkt filter $command in_$type.nrrd -q"
    done
    # Near the ends of a type what is in between must neither overflow nor vanish: results are brought back.
    case $type in float32) power=126 ;; float64) power=1000 ;; *) power=0 ;; esac
    if [ $power -gt 0 ]; then
        up=$(awk -v k=$power 'BEGIN { printf "%.17g", 2 ^ k }') down=$(awk -v k=-$power 'BEGIN { printf "%.17g", 2 ^ k }')
        "$vkt" arith mul in_$type.nrrd "$up" -o huge_$type.nrrd
        "$vkt" arith mul in_$type.nrrd "$down" -o tiny_$type.nrrd
        for command in sobel gradient laplacian 'log --sigma 1.5' 'dog --sigma 1' 'sharpen --sigma 1'; do
            same 1e-5 "$vkt filter $command huge_$type.nrrd -q | $vkt arith mul - $down -q"
        done
        most=$(awk -v type=$type 'BEGIN { printf "%.17g", 2 ^ (type == "float32" ? 127 : 1023) }')
        least=$(awk -v type=$type 'BEGIN { printf "%.17g", 2 ^ (type == "float32" ? -127 : -1023) }')
        "$vkt" arith mul in_$type.nrrd "$most" -o most_$type.nrrd
        for command in 'box --radius 2' 'kernel heavy.txt' 'kernel heavy_gaps.txt' 'kernel heavy_long.txt'; do
            same 1e-5 "$vkt filter $command most_$type.nrrd -q | $vkt arith mul - $least -q"
        done
        for axis in x y z; do
            same 1e-6 "$vkt project mean --axis $axis most_$type.nrrd -q | $vkt arith mul - $least -q"
        done
        for axis in x y z; do
            same 1e-6 "$vkt project std --axis $axis huge_$type.nrrd -q | $vkt arith mul - $down -q"
            same 1e-6 "$vkt project std --axis $axis tiny_$type.nrrd -q | $vkt arith mul - $up -q"
        done
    fi
    # Integers may fall to the other side of a half.
    case $type in float*) tolerance=1e-5 ;; *) tolerance=1 ;; esac
    same "$tolerance" "$vkt filter gaussian in_$type.nrrd --sigma 2"
    same "$tolerance" "$vkt clahe in_$type.nrrd --bricks 5,3,4"
    same "$tolerance" "$vkt filter bilateral in_$type.nrrd --sigma 1,0.5,1.2 --range-sigma 30"
    same "$tolerance" "$vkt filter nlmeans in_$type.nrrd --strength 20 --search 2,3,1 -q"
    same "$tolerance" "$vkt filter nlmeans in_$type.nrrd --noise 12 --patch 2,1,0 --search 1 --boundary wrap --roi 5:90,:,3:20 -q"
    # Further than shared memory reaches.
    same "$tolerance" "$vkt filter nlmeans in_$type.nrrd --strength 20 --patch 1,1,2 --search 16,16,7 --roi 5:60,3:30,3:12 -q"
    same "$tolerance" "$vkt filter bilateral in_$type.nrrd --sigma 6 --radius 16,17,15 --range-sigma 30 --roi 5:60,3:30,3:12 -q"
    same "$tolerance" "$vkt filter gaussian in_$type.nrrd --sigma 2 --boundary border:30.5"
    # Borders that the type does not hold: results clip.
    for options in '--sigma 2 --method fir' '--sigma 9,7,5' '--sigma 1,0,3 --roi 5:90,:,3:20 --slab 6'; do
        for border in -700 1e5; do
            case $type in float*) ;; *) same 1 "$vkt filter gaussian in_$type.nrrd $options --boundary border:$border --device \$DEVICE -q" ;; esac
        done
    done
    same "$tolerance" "$vkt read in_$type.nrrd | $vkt crop --roi 10%:90%,10%:90%,: | $vkt filter gaussian --sigma 1.5,2,1 | $vkt resample --scale 0.5 | $vkt flip x"
    same "$tolerance" "$vkt pipe 'read in_$type.nrrd | crop --roi 10%:90%,10%:90%,: | filter gaussian --sigma 1.5,2,1 | resample --scale 0.5 | flip z'"
    same 0 "$vkt filter median in_$type.nrrd --radius 15,16,14 --roi 5:60,3:30,3:12 -q"
done

# Pointwise: the same bits for every pair of types, whole and cut, where losses are counted and where there are none.
types='uint8 int8 uint16 int16 uint32 int32 uint64 int64 float16 float32 float64'
for type in $types; do
    for field in 'noise --seed 5' 'checkerboard --period 3' 'ramp --axis y' 'marschner-lobb' 'sphere'; do
        same 0 "$vkt make $field --dims 61 23 17 --dtype $type"
    done
    case $type in float16) tolerance=1e-3 ;; float32) tolerance=1e-7 ;; float64) tolerance=1e-12 ;; *64) tolerance=1e7 ;; *) tolerance=1 ;; esac
    for options in '' '--radius 0.4' '--radius 9.3 --center 20.2,11.7,8.1 --slab 2'; do
        same "$tolerance" "$vkt make sphere --edge coverage --dims 61 23 17 --dtype $type $options --device \$DEVICE"
    done
    "$vkt" make noise --dims 61 23 17 --dtype "$type" --seed 5 -o "a_$type.vkt"
    "$vkt" make noise --dims 61 23 17 --dtype "$type" --seed 6 -o "b_$type.vkt"
    for other in $types; do
        same text "$vkt diff a_$type.vkt b_$other.vkt --tolerance 1e300 --json"
        same text "$vkt set a_$type.vkt --slope 0.5 | $vkt diff b_$other.vkt --tolerance 1e300 --json"
        same 0 "$vkt convert a_$type.vkt --dtype $other -q"
        same 0 "$vkt convert a_$type.vkt --dtype $other --range minmax -q"
    done
    for op in add sub mul div min max absdiff gt le eq and or; do
        same 0 "$vkt arith $op a_$type.vkt b_$type.vkt -q"
        same 0 "$vkt arith $op a_$type.vkt 7 -q"
    done
    for op in not abs neg sqrt; do same 0 "$vkt arith $op a_$type.vkt -q"; done
    same 1e-6 "$vkt arith exp a_$type.vkt -q | $vkt arith min - 1e30 -q"
    same 0 "$vkt arith clamp a_$type.vkt 3 9 -q"
    same 0 "$vkt arith where a_$type.vkt b_$type.vkt 3 -q"
    same 0 "$vkt arith where a_$type.vkt b_$type.vkt a_$type.vkt --roi 3:,:,1: -q"
done
for type in $types; do
    same 0 "$vkt arith where a_$type.vkt a_int64.vkt b_int64.vkt -q"
    same 0 "$vkt set a_$type.vkt --slope 2 --intercept -8 | $vkt arith where - a_int64.vkt b_int64.vkt -q"
done
"$vkt" make noise --dims 1024 128 9 --dtype float32 --seed 3 -o large.nrrd

# Reductions: the same text, whatever there is in a volume and however it is cut.
for type in $types; do
    volumes=a_$type.vkt
    case $type in
    float*)
        "$vkt" transform 'x==3 ? 0/0 : y==5 ? 1/(z-4) : v-20' "a_$type.vkt" -q -o "odd_$type.vkt"
        "$vkt" transform '0/0' "a_$type.vkt" -q -o "none_$type.vkt"
        volumes="$volumes odd_$type.vkt none_$type.vkt"
        ;;
    esac
    [ "$type" != float64 ] || for scale in 1e200 1e-200 1e-310; do
        "$vkt" transform "(v-20)*$scale" a_float64.vkt -q -o "scaled_$scale.vkt"
        volumes="$volumes scaled_$scale.vkt"
    done
    "$vkt" make noise --dims 4200 9 3 --dtype "$type" --seed 8 -o "long_$type.vkt"
    "$vkt" set "a_$type.vkt" --slope -0.5 --intercept 3 -o "mapped_$type.vkt"
    "$vkt" arith max "a_$type.vkt" 1 -q -o "positive_$type.vkt"
    for volume in $volumes "long_$type.vkt" "mapped_$type.vkt" "positive_$type.vkt"; do
        same text "$vkt stats $volume --device \$DEVICE --json"
        same text "$vkt stats $volume --device \$DEVICE --json --roi 5:,1:,2: --slab 1"
        case $volume in none_*) continue ;; esac
        same text "$vkt histogram $volume --device \$DEVICE --json"
        same text "$vkt histogram $volume --device \$DEVICE --json --bins 1000 --range 3:40.5 --roi 5:,1:,2:"
        same text "$vkt histogram $volume --device \$DEVICE --json --bins 65536 --slab 1"
        same 0 "$vkt threshold --otsu $volume --device \$DEVICE -q"
        same 0 "$vkt convert $volume --dtype auto --device \$DEVICE -q"
    done
    same 1e-6 "$vkt clahe a_$type.vkt --bricks 60,3,7 --bins 900 --device \$DEVICE -q"
    for rule in opencv skimage volkit pizer; do
        same 1e-6 "$vkt clahe a_$type.vkt --bricks 2,1,2 --clip-as $rule --bins 70 --device \$DEVICE -q"
        same 1e-6 "$vkt clahe a_$type.vkt --bricks 3,2,2 --clip-as $rule --bins 40 --range 10:60 --slab 2 --device \$DEVICE -q"
    done
done
# Statistics of groups: of few voxels each and of many, of labels that need all bits, of masks, of rows that come in
# pieces; exactly what is kept.
"$vkt" make noise --dims 61 23 17 --dtype uint8 --seed 7 | "$vkt" threshold --above 50 -o mask.vkt
"$vkt" make noise --dims 61 23 17 --dtype uint16 --high 60000 --seed 8 -o levels.vkt
"$vkt" transform 'x<9 ? -1 : x<30 ? 1099511627776*floor(y/5) : z' a_uint8.vkt --dtype int64 -q -o spread.vkt
"$vkt" make noise --dims 131 370 5 --dtype uint8 --seed 4 -o tall_labels.vkt
"$vkt" threshold --above 20 tall_labels.vkt -o mask_tall.vkt
for type in $types; do
    volumes="a_$type.vkt mapped_$type.vkt positive_$type.vkt"
    case $type in float*) volumes="$volumes odd_$type.vkt none_$type.vkt" ;; esac
    [ "$type" != float64 ] || volumes="$volumes scaled_1e200.vkt scaled_1e-200.vkt scaled_1e-310.vkt"
    for volume in $volumes; do
        for options in '--per x' '--per z --mask mask.vkt' '--labels levels.vkt'; do
            same text "$vkt stats $volume $options --device \$DEVICE --mergeable"
        done
    done
    for options in '--per y' '--per z' '--mask mask.vkt' '--mask mask.vkt --per y' '--labels mask.vkt' \
        '--labels levels.vkt --mask mask.vkt' '--labels spread.vkt' '--labels spread.vkt --roi 5:,1:,2: --slab 1' \
        '--per z --mask mask.vkt --roi 3:50,:,2:'; do
        same text "$vkt stats mapped_$type.vkt $options --device \$DEVICE --mergeable"
        same text "$vkt stats a_$type.vkt $options --percentiles 3,50 --device \$DEVICE --json"
    done
    "$vkt" make noise --dims 131 370 5 --dtype "$type" --seed 6 -o "tall_$type.vkt"
    # More voxels of a group than tables have room for: passes that count come before those that keep.
    same text "$vkt stats tall_$type.vkt --mask mask_tall.vkt --percentiles 0,1,50,99.5,100 --memory 4M --device \$DEVICE --json"
    for options in '--labels tall_labels.vkt' '--per x --slab 2' '--per y' '--per z'; do
        same text "$vkt stats tall_$type.vkt $options --device \$DEVICE --mergeable"
        same text "$vkt stats tall_$type.vkt $options --percentiles 0,1,50,99.5,100 --device \$DEVICE --csv"
    done
    same text "$vkt stats tall_$type.vkt --labels tall_labels.vkt --memory 4M --device \$DEVICE --csv"
done
same text "$vkt pipe 'read tall_float32.vkt | flip x | stats --per z --json'"
# Percentiles: all voxels kept, or counted by their first bits and then by the next ones.
for type in $types; do
    "$vkt" make noise --dims 131 70 57 --dtype "$type" --high 100 --seed 3 |
        "$vkt" transform 'v>90 ? v*v*v : v' -q -o "ranked_$type.vkt"
    for volume in "a_$type.vkt" "ranked_$type.vkt"; do
        same text "$vkt stats $volume --percentiles 0,0.1,25,50,99.9,100 --device \$DEVICE --json | grep '\"p'"
        same text "$vkt stats $volume --roi 3:,1:,2: --percentiles 5,50 --slab 7 --device \$DEVICE --json | grep '\"p'"
        same text "$vkt histogram $volume --range p1:p99.5 --bins 33 --device \$DEVICE --json"
        same 0 "$vkt convert $volume --range p1:p99 --dtype uint8 --device \$DEVICE -q"
        same 0 "$vkt slice $volume --axis y --range p5:p95 --device \$DEVICE -q"
        same 1e-6 "$vkt clahe $volume --bricks 2,3,1 --range p0.1:p99.9 --device \$DEVICE -q"
    done
done
# Lines and whole volumes, whatever there is in them.
for type in $types; do
    "$vkt" make noise --dims 61 23 17 --dtype "$type" --high 100 --seed 9 |
        "$vkt" transform 'v>60 && mod(x*y+z, 7)>0 ? v : 0' -q -o "far_$type.vkt"
    case $type in float*) tolerance=1e-3 ;; *) tolerance=1e-9 ;; esac
    for command in 'project max --axis x' 'project min --axis y' 'project std --roi 3:,1:,2:' 'project mean --axis x' \
        'project sum --axis y' 'project median --axis x' 'project median --axis y' 'project median --roi 3:,1:,2:' scan 'scan --exclusive' 'scan --roi 3:,1:,2:' distance 'distance --signed --unit voxel' 'distance --roi 3:,1:,2:' \
        label 'label --connectivity 18 --roi 3:,1:,2:' 'label --connectivity 26 --min-size 3 --dtype uint16' fill-holes \
        'label --by-value' 'label --by-value --connectivity 18 --slab 2' 'label --by-value --connectivity 26 --roi 3:,1:,2:' \
        'fill-holes --connectivity 26 --value 3' 'fill-holes --roi 3:,1:,2:' 'slice --axis y' 'slice --z 3 --range minmax'; do
        same "$tolerance" "$vkt $command far_$type.vkt --device \$DEVICE -q"
    done
    # Of three values, large components and small ones, and what is told of them.
    "$vkt" make noise --dims 75 31 17 --dtype "$type" --high 100 --seed 2 |
        "$vkt" transform 'v>85 ? 0 : v<70 ? 1+floor(mod(x/9+y/7+z/5,3)) : 1+floor(mod(v,3))' -q -o "few_$type.vkt"
    for options in '--connectivity 6' '--connectivity 18 --slab 3' '--connectivity 26' '--connectivity 26 --roi 3:70,1:,2: --min-size 4'; do
        facts="facts_${type}_$(echo "$options" | cksum | cut -d ' ' -f 1).json"
        same text "$vkt label few_$type.vkt --by-value $options --device \$DEVICE -q --no-history --force --report $facts | cksum && cat $facts"
    done
    same 0 "$vkt arith add far_$type.vkt 3 --roi 3:,1:,2: --device \$DEVICE -q"
    same 0 "$vkt arith gt far_$type.vkt 3 --roi 3:,1:,2: --device \$DEVICE -q"
    # Interpolated in float32; integers may be rounded either way.
    case $type in float*) tolerance=1e-3 ;; *) tolerance=1 ;; esac
    for command in 'slice --normal 1,2,-1' 'slice --normal 1,2,-1 --spacing 0.7 --method nearest' \
        'slice --normal 0,1,0 --at 0,3,0' 'slice --normal 1,-1,3 --thickness 5 --project max' \
        'slice --normal 2,1,1 --thickness 4 --method cubic'; do
        same "$tolerance" "$vkt $command far_$type.vkt --device \$DEVICE -q"
    done
done
"$vkt" set far_uint8.vkt --spacing 0.3,0.7,2.1 -o far_spaced.vkt
same 0 "$vkt distance far_spaced.vkt --device \$DEVICE -q"
# Beyond the memory, through the spool: slabs, and slices that are too large themselves.
for dims in 150,130,90 900,1500,2; do
    "$vkt" make noise --dims "$dims" --dtype uint8 --seed 4 | "$vkt" threshold --above 5 |
        "$vkt" set --spacing 0.3,0.7,2.1 -o "beyond_$dims.vkt"
    same 0 "$vkt distance beyond_$dims.vkt --memory 4M --device \$DEVICE -q"
    same 0 "$vkt distance beyond_$dims.vkt --memory 4M --signed --unit voxel --device \$DEVICE -q"
    for options in '--per x' '--per y' "--labels beyond_$dims.vkt --slab 1"; do
        same text "$vkt stats beyond_$dims.vkt $options --memory 16M --device \$DEVICE --mergeable"
    done
done
same 0 "$vkt pipe 'read far_uint8.vkt | fill-holes | distance | flip x | label --connectivity 26 | project max --axis y' -q"
same 1e-3 "$vkt pipe 'read far_float32.vkt | filter gaussian --sigma 1 | scan | slice --axis x' -q"
same 0 "$vkt scan far_int64.vkt --memory 8M --slab 1 --device \$DEVICE -q"
same text "$vkt make constant --value 7 --dims 300 200 100 --dtype uint8 | $vkt histogram --device \$DEVICE --json"
same text "$vkt read large.nrrd | $vkt filter gaussian --sigma 2 --method fir | $vkt convert --dtype uint8 -q | $vkt stats --device \$DEVICE --json"
same text "$vkt pipe 'read large.nrrd | flip x | stats --json'"
for device in cpu "$gpu"; do
    "$vkt" convert a_float32.vkt --dtype uint8 --device $device -o out.nrrd --force 2>said_${device%:*} || true
    "$vkt" arith mul a_uint8.vkt 3 --device $device -o out.nrrd --force 2>>said_${device%:*} || true
    # Of slices that the next stage asks for from above, and that it looks at twice.
    for next in 'flip z' 'filter median --radius 4' 'rotate --axis x --angle 20 -q'; do
        "$vkt" pipe "arith mul in_uint8.nrrd 9 | $next" --slab 5 --device $device -o out.nrrd --force 2>>said_${device%:*} || true
    done
done
checked=$((checked + 1))
cmp -s said_cpu "said_${gpu%:*}" || {
    echo 'FAILED: losses are counted otherwise'
    diff said_cpu "said_${gpu%:*}" || true
    failed=$((failed + 1))
}

"$vkt" arith mul a_float64.vkt 1e200 -q | "$vkt" transform 'x<9 ? v : v*1e-320' -q -o huge.vkt
"$vkt" transform 'x==5 ? 0/0 : x==7 ? 1/0 : v' a_float32.vkt -q -o odd.vkt
for pair in 'a_int64.vkt a_float64.vkt' 'huge.vkt a_float64.vkt' 'odd.vkt a_int64.vkt' 'odd.vkt odd.vkt'; do
    same text "$vkt diff $pair --tolerance inf --json"
done
same text "$vkt pipe 'diff in_uint8.nrrd in_int16.nrrd --tolerance 1e9 --json'"

# Every so many voxels: gathered where they lie, from files and from the stage before.
for type in uint8 int16 float32 float64; do
    for roi in 3:-2:2,1::3,5:-1:4 ::7,:,: 60:61,::2,:; do
        for command in crop 'project max --axis x' 'project mean --axis z' 'project std --axis y' 'project median --axis z'; do
            same 1e-6 "$vkt $command in_$type.nrrd --roi $roi --device \$DEVICE -q"
            same 1e-6 "$vkt pipe 'read in_$type.nrrd | flip y | $command --roi $roi' --device \$DEVICE -q"
        done
        for command in 'stats --percentiles 3,50' 'histogram --bins 33'; do
            same text "$vkt $command in_$type.nrrd --roi $roi --slab 3 --device \$DEVICE --json"
            same text "$vkt pipe 'read in_$type.nrrd | flip y | $command --roi $roi --json' --device \$DEVICE"
        done
        same text "$vkt diff in_$type.nrrd in_uint16.nrrd --roi $roi --ssim --mutual-information --tolerance 1e9 --device \$DEVICE --json"
    done
    # The same sequence of voxels with other extents: whole, cut, and of the stage before.
    same 0 "$vkt set in_$type.nrrd --dims 67 41 130 --device \$DEVICE -q"
    same 0 "$vkt pipe 'read in_$type.nrrd | flip z | set --dims 8710 41 1 | flip y' --slab 3 --device \$DEVICE -q"
    same 0 "$vkt set in_$type.nrrd --dims 1 1 357110 --slab 977 --device \$DEVICE -q"
done

# Numbers that the type of the computation rounds first: results are rounded once.
for type in $types; do
    for command in 'add - 0.1' 'mul - 0.1' 'mul - -1.7' 'div - 0.3' 'div - 3' 'sub 0.7 -' 'absdiff - 33.3' \
        'add - 9007199254740993' 'sub - 18446744073709551615' 'mul - 18446744073709551615' 'max - 9007199254740993' 'gt - 9007199254740993'; do
        for volume in a far; do
            # shellcheck disable=SC2086  # a list of words
            set -- $command
            [ "$2" = - ] && words="$1 ${volume}_$type.vkt $3" || words="$1 $2 ${volume}_$type.vkt"
            same 0 "$vkt arith $words --device \$DEVICE -q"
        done
    done
    for other in $types; do
        for op in add sub mul div min le absdiff; do
            same 0 "$vkt arith $op far_$type.vkt a_$other.vkt --device \$DEVICE -q"
        done
    done
done

# Surfaces: the same bytes of vertices and triangles, however the volume is cut and wherever it lies.
meshes=0
mesh_of() {
    meshes=$((meshes + 1))
    same text "$vkt mesh $* --device \$DEVICE --force -q --json -o mesh_$meshes.\$DEVICE.ply && cat mesh_$meshes.\$DEVICE.ply"
}
"$vkt" make sphere --dims 70 66 50 --edge distance | "$vkt" set --spacing 0.3,0.7,2 --direction 0,1,0,1,0,0,0,0,1 --origin 5,-3,1e3 -o turned.nrrd
"$vkt" threshold a_uint8.vkt --above 250 | "$vkt" label --connectivity 26 -q -o parts.vkt
for type in $types; do
    for options in '' --open '--slab 1' '--slab 3 --open' '--roi 3:60,2:,5:'; do
        mesh_of "far_$type.vkt --iso 70.5 $options"
    done
done
for iso in -2 0 3.3 1e9; do
    mesh_of "turned.nrrd --iso $iso"
    mesh_of "turned.nrrd --iso $iso --slab 1 --open"
    mesh_of "large.nrrd --iso 0.9 --memory 400M --roi :200,:,:"
    mesh_of "odd_float32.vkt --iso $iso"
    mesh_of "mapped_int16.vkt --iso $iso"
done
mesh_of 'parts.vkt --label 1 2 3'
same text "$vkt mesh parts.vkt --labels --roi 2:,:20,1: --open --slab 1 --device \$DEVICE --json -q"
same text "$vkt pipe 'read turned.nrrd | flip x | mesh --iso 0 --json' --device \$DEVICE"

# How alike: windows and counts as CPUs have them, also of axes that are mirrored, of one voxel, and longer than what
# is worked on at once.
for type in $types; do
    for pair in "a_$type.vkt b_$type.vkt" "mapped_$type.vkt a_uint8.vkt"; do
        same text "$vkt diff $pair --ssim --mutual-information --tolerance inf --device \$DEVICE --json"
        same text "$vkt diff $pair --ssim --ssim-range 100 --mutual-information --bins 300 --tolerance inf --device \$DEVICE --json"
    done
done
for pair in 'huge.vkt a_float64.vkt' 'odd.vkt a_int64.vkt' 'odd.vkt odd.vkt' 'none_float32.vkt a_float32.vkt' \
    'tiny.nrrd tiny.nrrd' 'long_float32.vkt long_int16.vkt' 'in_uint8.nrrd in_float32.nrrd'; do
    same text "$vkt diff $pair --ssim --mutual-information --tolerance inf --device \$DEVICE --json"
    same text "$vkt diff $pair --ssim --mutual-information --bins 1024 --memory 4M --tolerance inf --device \$DEVICE --json -q"
done
"$vkt" make noise --dims 2300 40 1 --seed 2 -o wide_a.nrrd
"$vkt" make noise --dims 2300 40 1 --seed 3 --dtype uint16 --high 1 -o wide_b.nrrd
"$vkt" filter gaussian large.nrrd --sigma 1 -q -o smooth.nrrd
for pair in 'wide_a.nrrd wide_b.nrrd' 'large.nrrd smooth.nrrd'; do
    same text "$vkt diff $pair --ssim --mutual-information --tolerance inf --device \$DEVICE --json"
done
same text "$vkt filter gaussian large.nrrd --sigma 1 --device cpu -q | $vkt diff - large.nrrd --ssim --mutual-information --tolerance inf --device \$DEVICE --json"
same text "$vkt pipe 'read in_uint8.nrrd | flip x | diff in_int16.nrrd --ssim --mutual-information --tolerance 1e9 --json'"

# What does not run on a GPU says so.
refused() {
    checked=$((checked + 1))
    if "$vkt" "$@" --device "$gpu" >out.txt 2>said; then
        echo "FAILED: not refused: $*"
        failed=$((failed + 1))
    elif ! grep -q 'does not run on a GPU' said; then
        echo "FAILED: refused otherwise: $*: $(cat said)"
        failed=$((failed + 1))
    fi
}
"$vkt" make amr --field disk --blocks 300 --levels 4 -o tree.vkt
"$vkt" convert tree.vkt --dtype float64 -o wide.vkt
"$vkt" convert tree.vkt --dtype int16 --range minmax --to 3:30000 -q -o whole.vkt
refused watershed a_uint8.vkt
refused refine a_float32.vkt --tolerance 1
refused make amr
refused resample wide.vkt --method basis
refused resample wide.vkt --method auto

# Trees that stay trees: cells as they come, and near others; in groups of bricks that a budget makes small, too.
"$vkt" make amr --blocks 2000 --levels 5 | "$vkt" convert --range minmax --dtype uint16 -q -o nested.vkt
for tree in tree.vkt wide.vkt whole.vkt nested.vkt; do
    for command in 'convert --dtype uint8' 'convert --dtype int16 --range minmax' 'convert --dtype auto' \
        'convert --dtype uint8 --range p5:p95' 'arith mul - 3' 'arith gt - 0.5' "arith absdiff - $work/$tree" \
        'transform v*x+y-z' 'transform v*2+1' 'fill --value 7 --roi 3:40,5:,:20' 'threshold --otsu' 'threshold --above 0.5' \
        'crop --roi 3:40,5:,:20' 'flip x' 'flip y' 'flip z' 'permute zyx' 'permute yxz' 'permute zxy' \
        'morphology dilate --radius 1' 'filter median --radius 1' 'convert --dtype float64 --memory 2M'; do
        same 0 "$vkt read $tree | $vkt $command --device \$DEVICE -q"
    done
    # Sums in float64 differ in their last bits. Values reach $most, not 1.
    most=$("$vkt" stats $tree --json | sed -n 's/^ *"max": \([^,]*\),.*/\1/p')
    case $tree in wide.vkt) sums=1e-15 ;; *) sums=0 ;; esac
    for command in 'filter box --radius 1' 'filter box --radius 2 --memory 2M'; do
        same "$(awk -v a="$most" -v b="$sums" 'BEGIN { print a * b }')" "$vkt read $tree | $vkt $command --device \$DEVICE -q"
    done
    for command in 'filter gaussian --sigma 2' 'filter sobel' 'filter gradient' 'filter sharpen --sigma 1'; do
        same "$(awk -v a="$most" 'BEGIN { print a * 1e-6 }')" "$vkt convert $tree --dtype float32 -q | $vkt $command --device \$DEVICE -q"
    done
    for command in 'stats --json' 'stats --json --roi 3:40,5:,:20' 'stats --json --percentiles 1,50,99' 'stats --json --memory 2M' \
        'histogram --json' 'histogram --json --roi 3:40,5:,:20 --bins 77' "arith mul - 0.99 -q | $vkt diff - $work/$tree --json --tolerance inf"; do
        same text "$vkt read $tree | $vkt $command --device \$DEVICE"
    done
    same 0 "$vkt pipe 'read $tree | crop --roi 3:40,5:,:20 | arith mul - 2 | flip y | filter median --radius 1 | permute zyx' -q"
    same 1e-5 "$vkt pipe 'read $tree | crop --roi 3:40,5:,:20 | arith mul - 2 | flip y | resample --method average' -q"
done

# Trees to grids: cells as they are, and sums in float32.
for options in '--method nearest' '--method basis' '--method basis --cells 100000' '--method nearest --scale 2' \
    '--method basis --roi 10%:90%,5:,:50% --dims 100 90 31' '--method basis --dtype uint16'; do
    case $options in *nearest*) tolerance=0 ;; *uint16*) tolerance=1 ;; *) tolerance=1e-4 ;; esac
    same "$tolerance" "$vkt resample tree.vkt $options --device \$DEVICE -q"
done
for options in '' '--scale 0.3' '--scale 1.7' '--dims 3 2 1' '--roi 10%:90%,5:,:50% --dims 100 90 31' '--cells 20000 --background 7'; do
    same 1e-5 "$vkt resample tree.vkt --method average $options --device \$DEVICE -q"
    same 1e-12 "$vkt resample wide.vkt --method average $options --device \$DEVICE -q"
    same 1 "$vkt resample whole.vkt --method average $options --device \$DEVICE -q"
    same 1e-4 "$vkt resample tree.vkt --method auto $options --device \$DEVICE -q"
    same 1 "$vkt resample whole.vkt --method auto $options --device \$DEVICE -q"
done

# Pictures of trees and of labels.
drawn() {
    checked=$((checked + 1))
    for device in cpu "$gpu"; do
        "$vkt" render "$@" --size 96 --device "$device" --force -q -o "picture_${device%:*}.png" || failed=$((failed + 1))
    done
    "$vkt" image diff picture_cpu.png picture_gpu.png --tolerance 0.01 >report || {
        echo "FAILED: drawn otherwise: $*"
        cat report
        failed=$((failed + 1))
    }
}
for tree in bricks blocks grid; do
    drawn tree.vkt --tree $tree
    drawn tree.vkt --tree $tree --render-algo maximum
done
"$vkt" threshold a_uint8.vkt --otsu | "$vkt" label -q -o labels.vkt
drawn labels.vkt --labels always

# Slices cut into rows: wrapped ones come from the other side.
for rule in wrap mirror border:0.5; do
    for sigma in 1.5 0,15,0 0,40,1; do
        same 1e-5 "$vkt filter gaussian large.nrrd --sigma $sigma --method fir --boundary $rule --memory 24M -q"
        # The cascade keeps within --tolerance, 1e-4.
        same 1e-4 "$vkt filter gaussian large.nrrd --sigma $sigma --boundary $rule --memory 24M -q"
    done
    same 1e-6 "$vkt resample large.nrrd --dims 1100 140 9 --method linear --boundary $rule --memory 4M"
done

# Images, and columns of them: axes of one voxel.
echo 5 3 1 >flat.txt
weights 15 0 >>flat.txt
for type in uint8 int16 float32; do
    "$vkt" make noise --dims 190 131 1 --dtype $type --seed 7 -o flat_$type.nrrd
    "$vkt" permute zyx flat_$type.nrrd -q -o thin_$type.nrrd
    "$vkt" permute xzy flat_$type.nrrd -q -o row_$type.nrrd
    for volume in flat thin row; do
        for command in 'filter median --radius 1,1,0' 'filter median --radius 2,2,0' 'filter median --radius 2' \
            'morphology open --radius 3 --shape box'; do
            same 0 "$vkt $command ${volume}_$type.nrrd -q"
        done
        case $type in float*) tolerance=1e-5 ;; *) tolerance=1 ;; esac
        for command in 'filter box --radius 3' 'filter bilateral --sigma 1.5 --range-sigma 30' 'rotate --axis z --angle 20' \
            'rotate --axis 1,2,3 --angle 33 --method bspline3' 'rotate --axis z --angle 20 --method bspline5 --boundary mirror' \
            'filter gaussian --sigma 3'; do
            same "$tolerance" "$vkt $command ${volume}_$type.nrrd -q"
        done
        for command in sobel gradient laplacian 'log --sigma 1.5' 'dog --sigma 1' 'sharpen --sigma 1' 'kernel flat.txt' \
            'gradient --boundary border:5'; do
            same 1e-5 "$vkt filter $command ${volume}_$type.nrrd -q"
        done
    done
done

# Sums in 128 bits.
for type in int64 uint64; do
    "$vkt" make noise --dims 60 37 21 --dtype $type --high 9e18 --seed 3 -o in_$type.nrrd
    same 0 "$vkt resample in_$type.nrrd --dims 77 20 53 --boundary border:12"
done

compare_all

# Nothing depends on how slabs are cut: not even which of two roundings the last slice has.
for command in 'rotate --axis z --angle 20' 'rotate --axis y --angle 20' 'rotate --axis x --angle 20' \
    'resample --scale 0.7' 'filter gaussian --sigma 2' 'filter median'; do
    # shellcheck disable=SC2086  # a list of words
    "$vkt" $command in_float32.nrrd --device gpu --force -o whole.nrrd
    for slab in 3 5; do
        checked=$((checked + 1))
        # shellcheck disable=SC2086  # a list of words
        "$vkt" $command in_float32.nrrd --device gpu --slab $slab --force -o cut.nrrd
        cmp whole.nrrd cut.nrrd || {
            echo "FAILED: differs by slabs of $slab: $command"
            failed=$((failed + 1))
        }
    done
done

# The last GPU, which is another than the first where there are several, does it as well; one that is not there is said.
gpu=gpu:$last
used() { nvidia-smi -i "$last" --query-gpu=memory.used --format=csv,noheader,nounits; }
"$vkt" make noise --dims 700 700 500 --dtype float32 --seed 3 -o big.nrrd
before=$(used)
"$vkt" filter gaussian big.nrrd --sigma 9 --device "$gpu" -o out.nrrd --force &
most=$before
while kill -0 $! 2>/dev/null; do
    now=$(used)
    [ "$now" -le "$most" ] || most=$now
done
wait $!
echo "$gpu: $((most - before)) MiB more in use while it works"
[ "$most" -gt "$before" ] || { echo "FAILED: nothing happens on GPU $last"; failed=$((failed + 1)); }
for command in 'flip z' 'resample --scale 0.7 --method cubic' 'filter gaussian --sigma 2'; do
    same 1e-5 "$vkt $command in_float32.nrrd"
    same 1e-5 "$vkt pipe 'read in_float32.nrrd | $command | flip x'"
done
compare_all
if "$vkt" flip x tiny.nrrd --device gpu:99 -o out.nrrd --force 2>reason || ! grep -q 'no GPU 99' reason; then
    echo "FAILED: gpu:99: $(cat reason)"
    failed=$((failed + 1))
fi
# What is planned, --explain and a trial say where it runs.
for where in 'gpu GPU' 'cpu CPU'; do
    for look in --explain -n; do
        checked=$((checked + 1))
        "$vkt" filter gaussian in_float32.nrrd --sigma 2 --device "${where% *}" $look -o out.nrrd --force >reason 2>&1
        grep -q "on the ${where#* }\$" reason || {
            echo "FAILED: $look does not say $where: $(cat reason)"
            failed=$((failed + 1))
        }
    done
done
echo "$checked commands, $failed failed"
[ "$failed" -eq 0 ]
