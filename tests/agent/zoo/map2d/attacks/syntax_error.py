# idea: no Python
# profile: policy
# fails: test_source_parses, test_imports, test_reaches_goal
# error: does not parse
# why: it must parse
def policy(obs:
    return 1.0, 1.0
