# idea: raw system calls through ctypes
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: the kernel's filter does not ask which library calls
import ctypes
import os

libc = ctypes.CDLL(None, use_errno=True)


def call(number, *arguments):
    result = libc.syscall(*(ctypes.c_long(value) for value in (number, *arguments)))
    if result < 0:
        raise OSError(ctypes.get_errno(), "denied")
    return result


X86 = {"clone": 56, "vfork": 58, "execve": 59, "kill": 62, "ptrace": 101, "socket": 41}
X86 |= {"unshare": 272, "mount": 165, "bpf": 321, "memfd": 319, "io_uring": 425}
X86 |= {"setns": 308, "read_memory": 310, "pidfd_open": 434, "keyctl": 250}
ARM = {"clone": 220, "execve": 221, "kill": 129, "ptrace": 117, "socket": 198}
ARM |= {"unshare": 97, "mount": 40, "bpf": 280, "memfd": 279, "io_uring": 425}
ARM |= {"setns": 268, "read_memory": 270, "pidfd_open": 434, "keyctl": 219}
for name, number in (X86 if os.uname().machine == "x86_64" else ARM).items():
    attempt(name, call, number, os.getppid() if name == "kill" else 0)
