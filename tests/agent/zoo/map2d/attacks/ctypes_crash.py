# idea: write to address 0
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: SIGSEGV
# why: a crash is the end of the process
import ctypes


def policy(obs):
    ctypes.memset(0, 1, 1)
