# idea: wait for input
# profile: policy
# fails: test_imports, test_reaches_goal
# error: ValueError at policy
# why: standard input is empty
import sys


def policy(obs):
    return len(sys.stdin.read()) or float(sys.stdin.readline()), 1.0
