#!/usr/bin/env python3
"""Runs a pipeline many times, sends a signal to a random stage after a random while, and looks for losses and leftovers.

usage: kill.py ROUNDS SIGNAL TRANSPORT   (in a scratch directory that holds in.nrrd; vkt on PATH)

With the transport `standin` the stages in the middle are those of tests/faults/gpu_stage.cpp, $VKT_GPU_STAGE.
"""
import os
import random
import signal
import subprocess
import sys
import time

# Two stages that change no voxel: over shared memory they pass on the slots of the stage before them.
STAGES = [["read", "in.nrrd", "--slab", "2"], ["filter", "gaussian", "--sigma", "1.5", "--slab", "2"],
          ["convert", "--dtype", "float32", "-q"], ["set", "--spacing", "1,2,3"], ["flip", "z"], ["write", "out.nrrd"]]
MIDDLE = ["copy"], ["pass"], ["copy"], ["pass"]  # on a GPU that is none


def start():
    """The stages joined by anonymous pipes, as a shell joins them."""
    processes, upstream = [], None
    standin = os.environ["VKT_TRANSPORT"] == "standin"
    stages = [["vkt", *stage] for stage in STAGES]
    if standin:
        stages[1:-1] = [[os.environ["VKT_GPU_STAGE"], *stage] for stage in MIDDLE]
    for i, stage in enumerate(stages):
        last = i == len(stages) - 1
        environment = dict(os.environ, VKT_TRANSPORT="shm") if standin else None
        process = subprocess.Popen(stage, env=environment, stdin=upstream, stdout=None if last else subprocess.PIPE,
                                   stderr=subprocess.PIPE, restore_signals=True)
        if upstream is not None:
            upstream.close()
        upstream = process.stdout
        processes.append(process)
    return processes


def leftovers(processes=()):
    # LLVM's OpenMP names a segment after each process.
    found = [name for name in os.listdir("/dev/shm")
             if any(name.startswith(f"__KMP_REGISTERED_LIB_{process.pid}_") for process in processes)]
    found += [name for name in os.listdir(".") if name.startswith(".") or name == "out.nrrd"]
    for folder in ("/dev/shm", os.environ.get("TMPDIR", "/tmp")):
        # Volumes kept in memory by name are another test's: no stage here has one.
        found += [os.path.join(folder, name) for name in os.listdir(folder) if "vkt-" in name and name.startswith((".", "vkt"))
                  and not name.startswith(f".vkt.{os.getuid()}.") and not os.path.isdir(os.path.join(folder, name))]
    return found


def main():
    rounds, number, transport = int(sys.argv[1]), getattr(signal, sys.argv[2]), sys.argv[3]
    os.environ["VKT_TRANSPORT"] = transport
    random.seed(int(os.environ.get("VKT_SEED", "1")))
    durations = []
    for _ in range(5):  # the first run is slower than those that follow
        begin = time.time()
        for process in start():
            process.communicate()
        durations.append(time.time() - begin)
        expected = open("out.nrrd", "rb").read()
        os.remove("out.nrrd")
    cut = whole = 0
    for _ in range(rounds):
        processes = start()
        time.sleep(random.random() * min(durations))
        victim = random.choice(processes)
        victim.send_signal(number)
        messages = [process.communicate(timeout=60)[1].decode(errors="replace") for process in processes]
        codes = [process.returncode for process in processes]
        if os.path.exists("out.nrrd"):
            assert open("out.nrrd", "rb").read() == expected, f"a damaged file passed for whole: {codes}"
            os.remove("out.nrrd")
            whole += 1
        else:
            assert codes[-1] != 0, f"no file, but the last stage says 0: {codes} {messages}"
            cut += 1
        for code, process in zip(codes, processes):
            assert code in (0, 1, 2, 3, 4, 5) or code in (-number, -signal.SIGPIPE), f"{process.args} exited {code}: {messages}"
        lines = [line for message in messages for line in message.splitlines() if "hint:" not in line and "voxels go through" not in line]
        assert len(lines) <= 1, f"more than one stage complains: {lines}"
        assert not leftovers(processes), f"left behind: {leftovers(processes)}"
    print(f"{sys.argv[2]} over {transport}: {rounds} rounds, {cut} cut off, {whole} whole, 0 losses, 0 leftovers")


main()
