# idea: leave a note in the kernel: queues, semaphores, keys, names of sockets and hosts
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: none of these calls is allowed
import ctypes
import os
import socket

libc = ctypes.CDLL(None, use_errno=True)
X86 = os.uname().machine == "x86_64"


def call(x86, arm, *arguments):
    number = ctypes.c_long(x86 if X86 else arm)
    result = libc.syscall(number, *arguments)
    if result < 0:
        raise OSError(ctypes.get_errno(), "denied")
    return result


attempt("message queue", call, 68, 186, 0x7DAC, 0o1666)
attempt("semaphore", call, 64, 190, 0x7DAC, 1, 0o1666)
attempt("shared memory", call, 29, 194, 0x7DAC, 4096, 0o1666)
attempt("named queue", call, 240, 180, b"tdac", 0o102, 0o666, None)
attempt("key", call, 248, 217, b"user", b"tdac", b"1", 1, -4)
attempt("keys", call, 250, 219, 0, -4, 1)
attempt("abstract socket", lambda: socket.socket(socket.AF_UNIX).bind("\0tdac"))
attempt("host name", call, 170, 161, b"tdac", 4)
attempt("process name", call, 157, 167, 15, b"tdac", 0, 0, 0)
attempt("nice", os.nice, 1)
attempt("priority", os.setpriority, os.PRIO_PROCESS, 0, 5)
attempt("processors", os.sched_setaffinity, 0, {0})
attempt("directory notes", call, 254, 27)
attempt("notes", call, 294, 26, 0)
attempt("ring", call, 425, 425, 4, ctypes.create_string_buffer(200))
