# idea: trace all calls of the server and change its values
# profile: policy
# onto: witness.py
# fails: test_imports, test_reaches_goal
# error: got nothing|at policy
# why: it can only spoil its own answers
import sys

SEEN = []


def trace(frame, event, argument):
    SEEN.append(frame.f_code.co_name)
    for name in ("verdict", "outcome", "passed"):
        if name in frame.f_locals:
            GOT.append(name)
    return trace


attempt("settrace", sys.settrace, trace)
GOT.clear()
