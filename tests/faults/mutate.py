#!/usr/bin/env python3
"""Reads many damaged copies of a file: each ends in exit 0, or in exit 3 with one line, within its memory, leaving nothing.

usage: mutate.py FILE COPIES [OPTIONS OF READ]   (in a scratch directory; vkt on PATH; VKT_SEED chooses other damage)
"""
import os
import random
import subprocess
import sys

MEMORY = 64  # MiB; the library may take 256 more, and vkt needs some for itself
PEAK = MEMORY + 256 + 64


def damaged(whole, number):
    """A copy with a few bytes changed, in its first half more often than later: tables lie there; every 8th is cut."""
    copy = bytearray(whole)
    for _ in range(random.choice((1, 2, 2, 4, 16))):
        place = random.randrange(len(copy) // random.choice((1, 2, 16)))
        copy[place] = random.choice((copy[place] ^ 1 << random.randrange(8), 0, 0x7F, 0x80, 0xFF))
    return copy[:random.randrange(len(copy))] if number % 8 == 0 else copy


def read(path):
    """Exit code, what was said and the most memory that one process held, in MiB."""
    process = subprocess.Popen(["vkt", "read", path, *sys.argv[3:], "--memory", f"{MEMORY}M", "-o", "out.vkt", "--force"],
                               stdout=subprocess.DEVNULL, stderr=open("said", "w"))
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, open("said", errors="replace").read(), usage.ru_maxrss // 1024


def main():
    whole, copies = open(sys.argv[1], "rb").read(), int(sys.argv[2])
    sanitized = bool(os.environ.get("VKT_SANITIZED"))
    bad = "bad" + os.path.splitext(sys.argv[1])[1]
    random.seed(int(os.environ.get("VKT_SEED", "1")))
    os.environ["VKT_PARSER_PATIENCE"] = "2"
    os.makedirs("tmp", exist_ok=True)
    os.environ["TMPDIR"] = os.path.abspath("tmp")
    codes = {}
    largest = 0
    for number in range(copies):
        with open(bad, "wb") as file:
            file.write(damaged(whole, number))
        code, said, peak = read(bad)
        what = f"copy {number} of {sys.argv[1]}: exit {code}, {peak} MiB: {said}"
        lines = [line for line in said.splitlines() if "hint:" not in line]
        missing = code == 2 and "variable" in said  # what was asked for by name is not there any more
        assert code in (0, 3) or missing, what
        assert len(lines) == (code != 0) or sanitized, what
        assert peak <= PEAK or sanitized, what
        assert not os.listdir("tmp"), what
        if code == 0:
            os.remove("out.vkt")
        left = set(os.listdir(".")) - {"said", "tmp", bad, sys.argv[1]}
        assert not [name for name in left if name.startswith(".") or name.startswith("core") or name == "out.vkt"], left
        codes[code] = codes.get(code, 0) + 1
        largest = max(largest, peak)
        for word in ("crashed", "no progress", "did nothing", "of memory", "processor time", "killed"):
            if word in said:
                codes[word] = codes.get(word, 0) + 1
    print(f"{sys.argv[1]}: {copies} damaged copies: {codes}, at most {largest} MiB")


main()
