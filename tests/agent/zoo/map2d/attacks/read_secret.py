# idea: read a file outside, in every way there is
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: got .*file-
# harm rlimits: file read
# why: only the interpreter, numpy and the working folder can be seen
import mmap
import os

import numpy as np

PATHS = ["@SECRET@", "/proc/self/root@SECRET@", "/proc/1/root@SECRET@"]
PATHS += ["../" * 20 + "@SECRET@"[1:], "/proc/self/cwd/../" * 9 + "@SECRET@"[1:]]


def read(path):
    with open(path, "rb") as file:
        return file.read(100)


def mapped(path):
    with open(path, "rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)[:100]


for path in PATHS:
    attempt("open", read, path)
    attempt("os.open", lambda p=path: os.read(os.open(p, os.O_RDONLY), 100))
    attempt("fromfile", lambda p=path: np.fromfile(p, "S1").tobytes())
    attempt("mmap", mapped, path)
    attempt("memmap", lambda p=path: bytes(np.memmap(p, "u1", "r")))
attempt("dir_fd", lambda: os.open("@SECRET@"[1:], 0, dir_fd=os.open("/", os.O_RDONLY)))
GOT[2:] = []
