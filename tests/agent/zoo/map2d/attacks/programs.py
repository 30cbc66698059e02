# idea: start programs
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: got nothing
# why: no program can be started
import os
import subprocess
import sys

attempt("system", lambda: [1 // 0, 0][os.system("echo >@TARGET@/ran.txt") == 0])
attempt("popen", lambda: os.popen("id").read())
attempt("run", subprocess.check_call, ["/bin/sh", "-c", "echo"])
attempt("spawn", os.posix_spawn, "/bin/sh", ["sh", "-c", "echo"], {})
attempt("exec", os.execv, "/bin/sh", ["sh", "-c", "echo"])
attempt("python", os.execv, sys.executable or "/usr/bin/python3", ["python", "-c", "1"])
GOT[:] = [g for g in GOT if g != "popen -> ''"]
