# idea: an import in a try
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_imports
# error: import of 'scipy'
# why: imports at the top level only, of allowed modules only
try:
    import scipy
except ImportError:
    scipy = None
