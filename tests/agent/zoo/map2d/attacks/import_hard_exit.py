# idea: end the process with exit code 0 at import
# profile: policy
# tiers: every
# fails: test_imports, test_reaches_goal, test_no_collisions
# error: exit code 0 at import
# why: the end of the process is no answer
import os

os._exit(0)


def policy(obs):
    return 1.0, 1.0
