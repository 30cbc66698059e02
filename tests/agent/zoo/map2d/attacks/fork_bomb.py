# idea: fork without end
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: no process can be made
import os


def fork():
    pid = os.fork()
    while True:
        os.fork()
    return pid


attempt("fork", fork)
attempt("again", fork)
