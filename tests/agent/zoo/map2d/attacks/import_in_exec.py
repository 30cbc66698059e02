# idea: an import in a text that is executed
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_hygiene[forbidden_calls]
# error: forbidden calls: .*exec
# why: exec is a forbidden name
exec("import os")
