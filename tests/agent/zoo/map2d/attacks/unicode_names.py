# idea: eval in letters that Python takes for the same
# profile: policy
# fails: test_hygiene[forbidden_calls], test_reaches_goal
# error: forbidden calls: .*eval
# why: names are compared as Python normalises them
def policy(obs):
    return ｅｖａｌ("1.0"), ｅ𝓍ｅ𝒸("import os")
