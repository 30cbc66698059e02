# idea: fill the scratch folder with empty files
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# limits: import_seconds=10
# why: their number is bounded where the kernel offers it; the files are removed anyway
import os

os.chdir(os.environ["HOME"])


def files():
    for number in range(1_000):
        os.close(os.open(f"{number}", os.O_CREAT | os.O_WRONLY))
    raise LookupError("that is all")


attempt("files", files)
