# idea: list the folders outside
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: got .*target -> \['kept.txt'\]
# why: outside there is nothing to be listed
import os


def entries(path):
    names = os.listdir(path)
    if not names:
        raise LookupError("empty")
    return names[:3]


for path in ("/var", "/sys", "/proc", "/run", "/mnt", "/etc/ssl", "/dev/shm", "~/.ssh"):
    attempt(path, entries, os.path.expanduser(path))
attempt("target", entries, "@TARGET@")
attempt("beside", entries, "@TARGET@/..")
attempt("suites", entries, "@PACKAGE@/environments/map2d/suite")
