#!/usr/bin/python3
# Runs a pipeline of processes a few times: median wall time, processor time, and the peak memory of its stages.
# SPDX-License-Identifier: MIT
#
#   measure.py [--runs N] [--pipe BYTES] NAME 'command | command | …'
#
# Prints one line: NAME, wall ms (median and least), CPU ms, sum and largest of the stages' peak RSS in MiB. No shell
# stands between the stages, and this process stays small, because Linux counts its memory until a stage has started.
import fcntl
import os
import shlex
import sys
import time

F_SETPIPE_SZ = 1031


def split(pipeline):
    """Words of each stage; a | inside quotes belongs to a word."""
    lexer = shlex.shlex(pipeline, posix=True, punctuation_chars="|>")
    lexer.whitespace_split = True
    lexer.commenters = ""
    stages, output, words = [[]], None, iter(lexer)
    for word in words:
        if word == "|":
            stages.append([])
        elif word == ">":
            output = next(words)
        else:
            stages[-1].append(word)
    return stages, output


def run(stages, output, pipe_bytes):
    """Wall and CPU seconds, and the peak RSS of each stage in KiB."""
    begin = time.perf_counter()
    source, children = os.open("/dev/null", os.O_RDONLY), []
    for i, words in enumerate(stages):
        if i + 1 < len(stages):
            following, sink = os.pipe()
            if pipe_bytes:
                fcntl.fcntl(sink, F_SETPIPE_SZ, pipe_bytes)
        else:
            following, sink = -1, os.open(output or "/dev/null", os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        actions = [(os.POSIX_SPAWN_DUP2, source, 0), (os.POSIX_SPAWN_DUP2, sink, 1)]
        children.append(os.posix_spawnp(words[0], words, os.environ, file_actions=actions))
        os.close(source)
        os.close(sink)
        source = following
    cpu, peaks, failed = 0.0, [], []
    for child, words in zip(children, stages):
        _, status, usage = os.wait4(child, 0)
        cpu += usage.ru_utime + usage.ru_stime
        peaks.append(usage.ru_maxrss)
        if status != 0:
            failed.append(f"{words[0]} … status {os.waitstatus_to_exitcode(status)}")
    wall = time.perf_counter() - begin
    if failed:
        raise SystemExit("measure.py: " + ", ".join(failed))
    return wall, cpu, peaks


def main(words):
    runs, pipe_bytes = 5, 0
    while words and words[0].startswith("--"):
        if words[0] == "--runs":
            runs = int(words[1])
        elif words[0] == "--pipe":
            pipe_bytes = int(words[1])
        else:
            raise SystemExit(f"measure.py: unknown option {words[0]}")
        words = words[2:]
    name, (stages, output) = words[0], split(words[1])
    run(stages, output, pipe_bytes)  # warms the page cache
    results = sorted(run(stages, output, pipe_bytes) for _ in range(runs))
    wall, cpu, peaks = results[len(results) // 2]
    mib = [peak / 1024 for peak in peaks]
    print(f"{name}\t{wall * 1e3:.0f}\t{results[0][0] * 1e3:.0f}\t{cpu * 1e3:.0f}\t{sum(mib):.0f}\t{max(mib):.0f}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
