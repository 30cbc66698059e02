# idea: ignore the signal that says that the CPU time is used up
# profile: policy
# tiers: every
# limits: cpu_seconds=1 call_seconds=20
# fails: test_imports, test_reaches_goal
# error: used more than . s of CPU time|used up its limit of . s of CPU time
# why: a second limit kills without a signal that can be caught
import signal

for number in range(1, 32):
    if number not in (signal.SIGKILL, signal.SIGSTOP):
        signal.signal(number, signal.SIG_IGN)


def policy(obs):
    while True:
        continue
