# idea: count the kernel's inodes up, so that the next episode's pipes have large numbers
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: nothing can be made whose number comes from the counter of all processes
import ctypes
import os
import socket

libc = ctypes.CDLL(None, use_errno=True)


def checked(result):
    if result < 0:
        raise OSError(ctypes.get_errno(), "denied")
    return os.fstat(result).st_ino


attempt("pipe", lambda: os.fstat(os.pipe()[0]).st_ino)
attempt("pipe2", lambda: os.fstat(os.pipe2(0)[0]).st_ino)
attempt("event", lambda: checked(libc.eventfd(0, 0)))
attempt("timer", lambda: checked(libc.timerfd_create(1, 0)))
attempt("memory", lambda: os.fstat(os.memfd_create("x")).st_ino)
attempt("epoll", lambda: checked(libc.epoll_create1(0)))
attempt("pair", socket.socketpair)
attempt("own process", lambda: os.pidfd_open(os.getpid()))
