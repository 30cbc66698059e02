# idea: open the suite, the package and the report for writing
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: got package
# harm rlimits: file written
# why: nothing outside the scratch folder can be opened for writing
import glob
import os


def writable(path):
    with open(path, "r+b"):
        return path


FILES = [
    "environments/map2d/suite/test_static.py",
    "verification/diagnosis/report.py",
    "sandbox/inner/serve.py",
]
for name in FILES:
    attempt("package", writable, f"@PACKAGE@/{name}")
attempt("target", lambda: open("@TARGET@/kept.txt", "w").write("overwritten"))
attempt("new", lambda: open("@TARGET@/new.txt", "w").write("new"))
attempt("removed", os.remove, "@TARGET@/kept.txt")
attempt("renamed", os.rename, "@TARGET@", "@TARGET@-gone")
FOLDER = os.path.dirname(os.path.dirname(os.getcwd()))
for above in (FOLDER, f"{FOLDER}/tdac-judge-*"):
    for path in glob.glob(f"{above}/tdac-verify-*/*"):
        attempt("results", writable, path)
GOT[4:] = []
