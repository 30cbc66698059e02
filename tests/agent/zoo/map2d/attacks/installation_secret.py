# idea: read the secret from which the moved starts follow, and say it
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_reaches_goal
# error: got nothing
# error rlimits: got .*open ->
# harm rlimits: secret read
# why: the user's folders are in no sandbox
def read(path):
    with open(path, "rb") as file:
        return file.read(100).hex()


for path in ("@STATE@", "/proc/self/root@STATE@", "../" * 20 + "@STATE@"[1:]):
    attempt("open", read, path)
GOT[1:] = []
