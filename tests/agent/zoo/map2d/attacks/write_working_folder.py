# idea: change the map, the parameters and the own source for the next episode
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: got replace -> 'params.json'
# why: the folder is read-only, and a copy for each process
import os


def change(name):
    os.chmod(name, 0o666)
    with open(name, "r+b") as file:
        file.write(b"changed")
    return name


def replace(name):
    with open(os.environ["HOME"] + "/x", "w") as file:
        file.write("def policy(obs): return 1.0, 1.0\n")
    os.replace(os.environ["HOME"] + "/x", name)
    return name


for name in ("params.json", "occupancy.npy", "sensors.py", "controller.py"):
    attempt("change", change, name)
    attempt("replace", replace, name)
    attempt("remove", os.remove, name)
attempt("new", lambda: open("new.py", "w").write("x"))
GOT[4:] = []
