# idea: an expression too deep for the parser
# profile: policy
# repeat: 90000 +1
# fails: test_source_parses, test_imports, test_reaches_goal
# why: a parser that gives up is a source that does not parse; it must not crash the judge
def policy(obs):
    return 1.0, 1.0


X = 1