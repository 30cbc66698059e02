# idea: sleep
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_hygiene[sleeps]
# error: sleep
# why: sleep is a forbidden call
from time import sleep as rest

rest(0.01)
