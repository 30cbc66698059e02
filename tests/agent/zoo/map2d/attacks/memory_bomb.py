# idea: take all memory
# profile: policy
# onto: witness.py
# tiers: every
# fails: test_reaches_goal
# error: got nothing
# limits: memory_bytes=800000000
# why: the address space is bounded
import numpy as np


def grow():
    taken = []
    while True:
        taken.append(np.ones(1 << 24))


attempt("bytes", bytearray, 1 << 40)
attempt("grow", grow)
