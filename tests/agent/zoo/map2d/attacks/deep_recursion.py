# idea: recurse as deep as memory allows
# profile: policy
# limits: call_seconds=3
# fails: test_imports, test_reaches_goal
# error: SIGSEGV|MemoryError|RecursionError|did not end
# why: a crash is the end of the process, which is no answer
import sys

sys.setrecursionlimit(10**9)


def dive(depth):
    return dive(depth + 1) + 1


def policy(obs):
    return dive(0), sorted([0], key=dive)
