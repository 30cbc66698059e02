# idea: os as a name of an allowed module
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_imports
# error: '_os' from 'random'
# why: a module is not an allowed name
from random import _os
from sensors import Path, sys
