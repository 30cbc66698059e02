# idea: kill the parent, the group and everybody
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: signals reach the own process only
import os
import signal

NEIGHBOURS = {1, 2, os.getpid() - 1, os.getpid() + 1} - {0, os.getpid()}

for number in (0, signal.SIGTERM, signal.SIGSTOP, signal.SIGKILL):
    attempt("parent", os.kill, os.getppid(), number)
    attempt("group", os.killpg, os.getpgrp(), number)
    attempt("everybody", os.kill, -1, number)
    for neighbour in NEIGHBOURS:
        attempt("neighbour", os.kill, neighbour, number)
    attempt("descriptor", lambda n=number: signal.pidfd_send_signal(3, n))
