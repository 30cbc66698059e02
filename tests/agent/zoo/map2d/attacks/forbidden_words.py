# idea: forbidden words where they do no harm: comments, texts, parts of names
# profile: policy
# verdict: passed
# onto: good/policy_minimal.py
# why: the syntax tree is judged, not the text
"""import os; eval(input()); time.sleep(3); open("x", "w"); except: pass."""

# import os, subprocess; exec("x"); raise RuntimeError
WORDS = ["import socket", "__import__('os')", "globals()", "except:"]
evaluate, execution, compiled, sleeper = 1, 2, 3, 4
