# idea: nothing but brackets
# profile: policy
# repeat: 150000 (
# fails: test_source_parses, test_imports, test_reaches_goal
# error: does not parse
# why: as for a long sum
def policy(obs):
    return 1.0, 1.0


X = 