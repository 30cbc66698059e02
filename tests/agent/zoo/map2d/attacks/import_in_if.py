# idea: an import in an if
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_imports
# error: import of 'os'
# why: imports at the top level only, of allowed modules only
if PARAMS:
    import os
