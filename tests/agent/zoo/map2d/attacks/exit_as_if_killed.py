# idea: end with the code by which a shell tells that a process had too little memory
# profile: policy
# onto: good/policy_minimal.py
# fails: test_imports, test_reaches_goal, test_no_collisions
# error: exit code 137 at policy
# why: what is told of an end is what the kernel says
import os


def policy(obs):
    os._exit(137)
