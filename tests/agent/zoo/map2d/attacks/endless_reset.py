# idea: a reset that does not end
# profile: policy
# limits: reset_seconds=1
# fails: test_reaches_goal, test_no_collisions
# error: reset did not end within 1 s
# why: reset has a deadline
def reset(obs):
    while True:
        continue


def policy(obs):
    return 1.0, 1.0
