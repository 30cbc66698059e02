# idea: start threads without end
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: no thread can be started
import threading


def threads():
    for _ in range(10_000):
        threading.Thread(target=threading.Event().wait, daemon=True).start()


attempt("threads", threads)
