# idea: write binary output to both standard descriptors
# profile: policy
# fails: test_imports, test_reaches_goal
# error: printed more than 1048576 bytes
# why: output is counted where it is read
import os


def policy(obs):
    while True:
        os.write(1, bytes(65536))
        os.write(2, bytes(65536))
