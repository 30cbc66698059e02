# idea: queue signals until the user may have no more, which other episodes notice
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: only signals of which one at most waits can be sent
import os
import signal

REAL = range(signal.SIGRTMIN, signal.SIGRTMIN + 3)
signal.pthread_sigmask(signal.SIG_BLOCK, REAL)
for number in REAL:
    attempt(f"kill {number}", os.kill, os.getpid(), number)
    attempt(f"raise {number}", signal.raise_signal, number)
