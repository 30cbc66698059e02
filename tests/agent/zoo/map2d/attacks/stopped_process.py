# idea: stop the own process, so that killing it takes for ever
# profile: policy
# tiers: every
# limits: call_seconds=1
# fails: test_imports, test_reaches_goal
# error: did not end within 1 s|1 collision
# why: SIGKILL ends a stopped process, too
import os
import signal


def policy(obs):
    os.kill(os.getpid(), signal.SIGSTOP)
    return 1.0, 1.0
