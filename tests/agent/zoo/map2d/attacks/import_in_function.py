# idea: an allowed import in a function
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_imports
# error: not at the top level
# why: imports at the top level only
def late():
    import heapq

    return heapq
