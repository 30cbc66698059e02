# idea: an import that does not end
# profile: policy
# limits: import_seconds=1
# fails: test_reaches_goal, test_no_collisions
# error: import did not end within 1 s
# why: the import has a deadline; its time-out is tried once more, then it counts
while True:
    continue


def policy(obs):
    return 1.0, 1.0
