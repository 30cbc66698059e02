# idea: end the process with exit code 0 half way
# profile: policy
# onto: good/policy_minimal.py
# fails: test_imports, test_reaches_goal, test_no_collisions
# error: exit code 0 at policy
# why: only the environment says that the goal is reached
import os

honest, calls = policy, []


def policy(obs):
    calls.append(1)
    if len(calls) > 40:
        os._exit(0)
    return honest(obs)
