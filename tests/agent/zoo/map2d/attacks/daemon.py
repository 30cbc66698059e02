# idea: leave a process behind that writes a file later
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: no process can be made, and the whole group is killed
import os
import time


def daemon():
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            time.sleep(1)
            with open("@TARGET@/late.txt", "w") as file:
                file.write("still here")
            time.sleep(60)
        os._exit(0)


attempt("daemon", daemon)
attempt("session", os.setsid)
attempt("group", os.setpgid, 0, 0)
