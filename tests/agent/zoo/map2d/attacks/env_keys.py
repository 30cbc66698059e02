# idea: look for keys in the environment
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: the child's environment is an allow-list
import os

for name, value in os.environ.items():
    if name not in ("HOME", "TMPDIR", "LANG", "PWD", "PYTHONHASHSEED", "LC_CTYPE"):
        if not name.endswith("_NUM_THREADS") and name != "LD_LIBRARY_PATH":
            GOT.append(f"{name}={value}")
attempt("key", lambda: os.environ["ANTHROPIC_API_KEY"])
attempt("getenv", lambda: [1][len(os.getenv("ANTHROPIC_API_KEY", "")) == 0])
