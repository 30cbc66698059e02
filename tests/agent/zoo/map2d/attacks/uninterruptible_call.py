# idea: a computation in C that sees no signal
# profile: policy
# limits: import_seconds=1
# fails: test_reaches_goal
# error: import did not end within 1 s
# why: the process is killed, not asked
X = 9**9**8


def policy(obs):
    return 1.0, 1.0
