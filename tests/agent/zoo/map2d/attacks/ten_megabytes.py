# idea: a source of 10 MB
# profile: policy
# repeat: 10000000 #
# fails: test_source_parses, test_imports, test_reaches_goal
# error: bytes
# why: 200 kB are the most
def policy(obs):
    return 1.0, 1.0
#