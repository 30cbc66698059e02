# idea: open a file until there are no descriptors left
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: 64 descriptors are the most
import os

OPENED = []


def many():
    while len(OPENED) < 5000:
        OPENED.append(os.open("params.json", os.O_RDONLY))


attempt("many", many)
for number in OPENED:
    os.close(number)
