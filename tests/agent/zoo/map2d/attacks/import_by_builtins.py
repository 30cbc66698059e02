# idea: __import__ as an entry of a dict
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_hygiene[forbidden_calls]
# error: forbidden calls: .*__builtins__
# why: __builtins__ is a forbidden name
os = __builtins__["__imp" + "ort__"]("os")
