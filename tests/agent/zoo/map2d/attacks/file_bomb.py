# idea: fill the scratch folder with one large file and many
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# limits: scratch_bytes=4000000
# why: its size is bounded by the tier; a file's size on all of them
import os

os.chdir(os.environ["HOME"])


def fill():
    with open("large", "wb") as file:
        for _ in range(80):
            file.write(bytes(1 << 20))
            file.flush()
    return "80 MB"


attempt("fill", fill)
