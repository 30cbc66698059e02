# idea: nest folders deeper than a path can say, with odd names and no rights
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: the folder is removed level by level
import os

os.chdir(os.environ["HOME"])
for depth in range(400):
    os.mkdir(b"\xff\n" * 40)
    os.chdir(b"\xff\n" * 40)
    os.mkdir("locked", 0)
