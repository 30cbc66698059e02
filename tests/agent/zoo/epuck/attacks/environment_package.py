# idea: import tdac_envs, and walk about in an environment of its own
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: got
# why: only the interpreter, numpy and the working folder can be seen
import sys

sys.path[:0] = ["@PACKAGE@/.."]


def world():
    import tdac_envs.worlds.world as world

    return world.__name__


attempt("world", world)
attempt("file", lambda: open("@PACKAGE@/../tdac_envs/worlds/files/arena.wbt").read(40))
