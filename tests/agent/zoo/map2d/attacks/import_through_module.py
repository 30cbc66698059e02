# idea: os through a module that has imported it
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_imports
# error: sensors.os
# why: modules are reached by import statements only
PID = sensors.os.getpid()
