# idea: close the standard descriptors, so that the judge reads the end of the output
# profile: policy
# onto: good/policy_minimal.py
# tiers: every
# fails: only test_imports
# error: import of 'os'
# why: output that ends early is no end of the process; the honest rest passes
import os

for number in (0, 1, 2):
    os.close(number)
