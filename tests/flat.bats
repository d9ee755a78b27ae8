# Images: a volume of one voxel along an axis is worked on as an image, not with the copies around it.
load helper

setup_more() {
    vkt make noise --dims 64 48 1 --dtype float32 | vkt arith mul - 1000 | vkt convert --dtype int16 -o image.nrrd
    echo '3 1 5  1 2 3 4 5 6 7 8 9 10 11 12 13 14 -15' >kernel.txt
}

filters=(
    "filter dog --sigma 1" "filter log --sigma 1.2" "filter sharpen --sigma 1" "filter gaussian --sigma 1.5" "filter box --radius 2"
    "filter median --radius 1" "filter median --radius 2" "filter median --radius 3,1,2" "filter sobel" "filter gradient"
    "filter laplacian" "filter kernel kernel.txt" "filter bilateral --sigma 1 --range-sigma 500" "morphology erode --radius 3"
    "morphology open --radius 2" "morphology tophat --radius 2 --shape box"
)

@test "an image gives what a slice among its copies gives, along every axis and under every rule that copies" {
    vkt stack image.nrrd image.nrrd image.nrrd --along z --force-uniform -o three.nrrd
    for order in xyz zxy xzy; do
        vkt permute $order image.nrrd -o one.nrrd --force
        vkt permute $order three.nrrd -o copies.nrrd --force
        case $order in xyz) middle=:,:,1:2 ;; zxy) middle=1:2,:,: ;; xzy) middle=:,1:2,: ;; esac
        for rule in mirror clamp wrap; do
            for filter in "${filters[@]}"; do
                # shellcheck disable=SC2086
                vkt $filter one.nrrd --boundary $rule -o a.nrrd --force
                # shellcheck disable=SC2086
                vkt $filter copies.nrrd --boundary $rule | vkt crop --roi $middle -o b.nrrd --force
                tolerance=0
                # Sums of several weights, in another order.
                case $filter in *kernel*) tolerance=0.01 ;; *bilateral*) tolerance=1 ;; esac
                vkt diff a.nrrd b.nrrd --tolerance $tolerance >/dev/null || { echo "$filter, $order, $rule" >&2; vkt diff a.nrrd b.nrrd >&2; false; }
            done
        done
    done
}

@test "the border rule makes no copies: an image lies between slices of its value" {
    vkt filter box image.nrrd --radius 0,0,1 --boundary border:0 -o a.nrrd
    /usr/bin/python3 - <<'END'
import subprocess, numpy
read = lambda f: numpy.frombuffer(subprocess.check_output(["vkt", "write", f, "-", "--format", "raw"], stderr=subprocess.DEVNULL), "<i2")
assert numpy.array_equal(read("a.nrrd"), numpy.rint(read("image.nrrd") / 3))
END
}

@test "an image takes the memory of an image" {
    vkt make noise --dims 16 16 1 --dtype float32 -o tiny.nrrd
    vkt make noise --dims 2048 1024 1 --dtype float32 -o large.nrrd # 8 MiB
    for filter in "filter box --radius 8" "filter dog --sigma 2" "morphology erode --radius 8" "filter bilateral --sigma 2 --range-sigma 1"; do
        # shellcheck disable=SC2086
        base=$(peak_kib vkt $filter tiny.nrrd -o out.nrrd --force)
        # shellcheck disable=SC2086
        most=$(peak_kib vkt $filter large.nrrd -o out.nrrd --force)
        [ $((most - base)) -le $((6 * 8192)) ] || { echo "$((most - base)) KiB: $filter" >&2; false; }
    done
}

@test "a turned image gives what a slice among its copies gives, and takes the memory of an image" {
    vkt stack image.nrrd image.nrrd image.nrrd --along z --force-uniform -o three.nrrd
    for method in cubic bspline3 bspline5 lanczos3; do
        for rule in '' '--boundary clamp' '--boundary mirror'; do
            # shellcheck disable=SC2086
            vkt rotate image.nrrd --axis z --angle 20 --method $method $rule -o a.nrrd --force
            # shellcheck disable=SC2086
            vkt rotate three.nrrd --axis z --angle 20 --method $method $rule | vkt crop --roi :,:,1:2 -o b.nrrd --force
            vkt diff a.nrrd b.nrrd --tolerance 1 >/dev/null || { echo "$method $rule" >&2; vkt diff a.nrrd b.nrrd >&2; false; }
        done
    done
    vkt make noise --dims 16 16 1 --dtype float32 -o tiny.nrrd
    vkt make noise --dims 1024 1024 1 --dtype float32 -o large.nrrd # 4 MiB
    base=$(peak_kib vkt rotate tiny.nrrd --axis z --angle 20 --method bspline5 -o out.nrrd)
    most=$(peak_kib vkt rotate large.nrrd --axis z --angle 20 --method bspline5 -o out.nrrd --force)
    [ $((most - base)) -le $((8 * 4096)) ] || { echo "$((most - base)) KiB" >&2; false; }
}
