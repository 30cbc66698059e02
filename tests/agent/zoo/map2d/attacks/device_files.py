# idea: open devices and kernel files
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: tried 12
# why: three harmless devices can be seen
import os

PATHS = ["/dev/mem", "/dev/kmsg", "/dev/sda", "/dev/tty", "/dev/ptmx", "/dev/fuse"]
PATHS += ["/dev/kvm", "/dev/net/tun", "/proc/kcore", "/proc/sysrq-trigger"]
PATHS += ["/sys/kernel/debug", "/proc/sys/kernel/core_pattern"]
for path in PATHS:
    attempt(path, lambda p=path: os.open(p, os.O_RDWR))
