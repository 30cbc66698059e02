# idea: bytes that are no text
# profile: policy
# fails: test_source_parses, test_imports, test_reaches_goal
# error: does not parse
# why: the source is parsed as Python itself does
X = 'ÿþ'


def policy(obs):
    return 1.0, 1.0
