"""System calls that a controller may make, by number and processor.

Left out on purpose: calls that make processes, threads, sockets, links, devices, new
rights or shared memory, lock files that other children see, inspect another process, or
leave the process group. So are calls that could tell another child something: they move
pages of shared files in or out of memory, tell how full a file system or the memory is,
or take an inode number of the kernel's own counter, as pipes do.
"""

from __future__ import annotations

# Name, number on x86_64, number on aarch64 (`-` if it has none).
ALLOWED = """
read 0 63, write 1 64, readv 19 65, writev 20 66, pread64 17 67, pwrite64 18 68,
lseek 8 62, openat 257 56, open 2 -, creat 85 -, fstat 5 80, newfstatat 262 79,
stat 4 -, lstat 6 -, statx 332 291, access 21 -, faccessat 269 48, faccessat2 439 439,
readlink 89 -, readlinkat 267 78, getcwd 79 17, chdir 80 49, fchdir 81 50,
getdents 78 -, getdents64 217 61, mkdir 83 -, mkdirat 258 34, rmdir 84 -, unlink 87 -,
unlinkat 263 35, rename 82 -, renameat 264 38, renameat2 316 276, ftruncate 77 46,
truncate 76 45, fallocate 285 47, fsync 74 82, fdatasync 75 83, sendfile 40 71,
copy_file_range 326 285, umask 95 166, dup 32 23, poll 7 -, ppoll 271 73, select 23 -,
pselect6 270 72, mmap 9 222, munmap 11 215, mprotect 10 226, mremap 25 216,
msync 26 227, brk 12 214, rt_sigaction 13 134, rt_sigprocmask 14 135,
rt_sigreturn 15 139, rt_sigpending 127 136, rt_sigsuspend 130 133,
rt_sigtimedwait 128 137, sigaltstack 131 132, restart_syscall 219 128, alarm 37 -,
pause 34 -, setitimer 38 103, getitimer 36 102, nanosleep 35 101, gettimeofday 96 169,
time 201 -, times 100 153, getpid 39 172, gettid 186 178, getppid 110 173,
getpgrp 111 -, getuid 102 174, geteuid 107 175, getgid 104 176, getegid 108 177,
getgroups 115 158, getresuid 118 148, getresgid 120 150, getrlimit 97 163,
getrusage 98 165, uname 63 160, getcpu 309 168, sched_yield 24 124, getrandom 318 278,
wait4 61 260, waitid 247 95, exit 60 93, exit_group 231 94
"""
# Allowed only with the arguments listed in `seccomp`.
_GUARDED = """
close 3 57, dup2 33 -, dup3 292 24, fcntl 72 25, ioctl 16 29, kill 62 129,
tgkill 234 131, prlimit64 302 261, futex 202 98, madvise 28 233, clock_gettime 228 113,
clock_getres 229 114, clock_nanosleep 230 115, getpgid 121 155, getsid 124 156,
getpriority 140 141, sched_getaffinity 204 123
"""
# Used to confine the process; denied to the controller.
_SETUP = """
seccomp 317 277, landlock_create_ruleset 444 444, landlock_add_rule 445 445,
landlock_restrict_self 446 446, pivot_root 155 41, mount_setattr 442 442, capset 126 91
"""
# Machine: column in the tables, architecture number of the audit interface.
MACHINES = {"x86_64": (1, 0xC000003E), "aarch64": (2, 0xC00000B7)}


def _column(table: str, machine: str) -> dict[str, int]:
    rows = [row.split() for row in table.replace("\n", " ").split(",")]
    column = MACHINES[machine][0]
    return {row[0]: int(row[column]) for row in rows if row[column] != "-"}


def allowed(machine: str) -> list[int]:
    """Return the numbers of the calls that are allowed with any arguments."""
    return list(_column(ALLOWED, machine).values())


def guarded(machine: str) -> dict[str, int]:
    """Return name and number of the calls that are allowed with some arguments."""
    return _column(_GUARDED, machine)


def setup(machine: str) -> dict[str, int]:
    """Return name and number of the calls that the confinement needs."""
    return _column(_SETUP, machine)
