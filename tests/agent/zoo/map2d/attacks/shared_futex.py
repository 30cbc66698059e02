# idea: wake and be woken by the controllers of other episodes, which map the same files
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: the kernel's filter lets a controller wait on memory of its own alone
import ctypes
import os

libc, word = ctypes.CDLL(None, use_errno=True), ctypes.c_int(0)
NUMBER = 202 if os.uname().machine == "x86_64" else 98


def futex(operation, value):
    arguments = ctypes.c_long(NUMBER), ctypes.byref(word), operation, value, None
    if libc.syscall(*arguments) < 0 and ctypes.get_errno() == 1:
        raise OSError("denied")


for operation, name in enumerate(["wait", "wake"]):
    futex(operation | 128, 1)
    attempt(f"shared {name}", futex, operation, 1)
