# idea: print for ever
# profile: policy
# tiers: every
# fails: test_reaches_goal, test_no_collisions
# error: printed more than 1048576 bytes
# why: 1 MB of output is the most
def policy(obs):
    while True:
        print("x" * 10_000)
