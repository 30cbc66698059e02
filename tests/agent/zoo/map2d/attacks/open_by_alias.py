# idea: open under another name
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_hygiene[file_writes]
# error: open
# why: open may be called, not handed on
write = open
MODES = [write]
