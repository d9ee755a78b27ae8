# Stages are killed at random moments: nothing stays behind, nothing cut off passes for whole, one stage complains.
# VKT_FAULT_ROUNDS sets how often (25 by default, 8 with sanitizers, which start slowly; 500 before a release).
load ../helper

rounds() {
    # A folder of their own: other programs' temporary files are not what is looked for.
    mkdir tmp
    export TMPDIR="$PWD/tmp"
    vkt make noise --dims 96 80 64 --dtype float32 --seed 3 -o in.nrrd
    python3 "$VKT_ROOT/tests/faults/kill.py" "${VKT_FAULT_ROUNDS:-$([ -n "${VKT_SANITIZED:-}" ] && echo 8 || echo 25)}" "$1" "$2" >&3
}

@test "SIGKILL at any moment leaves nothing behind (pipe)" { rounds SIGKILL pipe; }
@test "SIGKILL at any moment leaves nothing behind (shm)" { rounds SIGKILL shm; }
@test "SIGTERM at any moment leaves nothing behind (pipe)" { rounds SIGTERM pipe; }
@test "SIGTERM at any moment leaves nothing behind (shm)" { rounds SIGTERM shm; }

# A GPU that is a file in memory (gpu_stage.cpp); tests/gpu/transport.sh does the same on one.
on_standin() {
    export VKT_GPU_STAGE="$VKT_BUILD/tests/vkt_gpu_stage"
    [ -x "$VKT_GPU_STAGE" ] || skip "vkt_gpu_stage is not built"
    rounds "$1" standin
}
@test "SIGKILL at any moment leaves nothing behind (GPU memory)" { on_standin SIGKILL; }
@test "SIGTERM at any moment leaves nothing behind (GPU memory)" { on_standin SIGTERM; }
@test "SIGPIPE at any moment leaves nothing behind" { rounds SIGPIPE pipe; }
