# idea: a chain of signs
# profile: policy
# repeat: 150000 ~
# fails: test_source_parses, test_imports, test_reaches_goal
# why: as for a long sum
def policy(obs):
    return 1.0, 1.0


X = 0 if 1 else 