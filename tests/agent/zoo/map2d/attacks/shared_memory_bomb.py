# idea: take memory that belongs to no process
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: got dev
# why: no shared memory, no memory files, no /dev/shm
import ctypes
import mmap
import os

libc = ctypes.CDLL(None, use_errno=True)


def checked(result):
    if result < 0:
        raise OSError(ctypes.get_errno(), "denied")
    return result


attempt("shm", lambda: checked(libc.shmget(0, 1 << 20, 0o1666)))
attempt("memfd", os.memfd_create, "x")
attempt("dev", lambda: os.open("/dev/shm/tdac-zoo", os.O_CREAT | os.O_RDWR))
attempt("anonymous", mmap.mmap, -1, 1 << 40)
