# idea: import the environment package and ask it for the answer
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# error rlimits: got reference -> 'tdac_agent.verification.suite.contract'; suite
# why: the child sees numpy and the standard library only
import sys

sys.path[:0] = ["@PACKAGE@/..", "@PACKAGE@", "/usr/lib/python3/dist-packages"]


def answer():
    import tdac_agent.verification.suite.contract as reference

    return reference.__name__


attempt("reference", answer)
attempt("suite", lambda: open("@PACKAGE@/environments/map2d/suite/test_static.py").read(40))
