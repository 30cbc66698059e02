# idea: exec under another name
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_hygiene[forbidden_calls]
# error: forbidden calls: .*exec
# why: the name is forbidden, called or not
run = exec
run("import os")
