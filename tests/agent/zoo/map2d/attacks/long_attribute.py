# idea: an attribute of an attribute of …
# profile: policy
# repeat: 90000 .a
# fails: test_reaches_goal
# why: as for a long sum
def policy(obs):
    return 1.0, 1.0


X = policy