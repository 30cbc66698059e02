# idea: read how much other episodes computed, and whether their processes still live
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error landlock: got status
# error rlimits: got status
# why: clocks, groups, priorities and processors of its own process alone
import os
import time

OWN = os.getpid()
OTHERS = [*range(1, 40), *range(max(40, OWN - 40), OWN), *range(OWN + 1, OWN + 40)]


def lives(ask):
    """The processes of which a call tells something."""

    def found():
        told = []
        for pid in OTHERS:
            if pid == OWN:
                continue
            try:
                told.append((pid, ask(pid)))
            except OSError:
                continue
        if not told:
            raise OSError("of none")
        return told

    return found


attempt("clock", lives(lambda pid: time.clock_gettime(~pid << 3 | 2)))
attempt("resolution", lives(lambda pid: time.clock_getres(~pid << 3 | 2)))
attempt("group", lives(os.getpgid))
attempt("session", lives(os.getsid))
attempt("priority", lives(lambda pid: os.getpriority(os.PRIO_PROCESS, pid)))
attempt("priority of a user", os.getpriority, os.PRIO_USER, 0)
attempt("processors", lives(os.sched_getaffinity))
attempt("policy", lives(os.sched_getscheduler))
attempt("signal", lives(lambda pid: os.kill(pid, 0)))
attempt("status", lives(lambda pid: os.stat(f"/proc/{pid}").st_ino))
