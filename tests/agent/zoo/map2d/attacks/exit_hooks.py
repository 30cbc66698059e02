# idea: work at the end of the process: atexit, __del__, excepthook
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: the process is killed, and nobody listens any more
import atexit
import os
import sys


class Last:
    def __del__(self):
        with open("@TARGET@/del.txt", "w") as file:
            file.write("late")
        while True:
            continue


def late(*args):
    with open("@TARGET@/atexit.txt", "w") as file:
        file.write("late")
    while True:
        continue


atexit.register(late)
sys.excepthook = sys.unraisablehook = late
keep = Last()
