# idea: read how full the file systems and the memory are, which others may fill
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: no call tells what is free
import ctypes
import os
import shutil

import numpy as np

libc = ctypes.CDLL(None, use_errno=True)


def system():
    room = ctypes.create_string_buffer(512)
    if libc.sysinfo(room):
        raise OSError("denied")
    return room.raw[:64]


for place in (os.environ["HOME"], ".", "/", "/tmp", "/dev/shm", np.__file__):
    attempt(f"space {place}", os.statvfs, place)
attempt("space of a file", os.fstatvfs, os.open(np.__file__, os.O_RDONLY))
attempt("usage", shutil.disk_usage, ".")
attempt("system", system)
attempt("load", os.getloadavg)
