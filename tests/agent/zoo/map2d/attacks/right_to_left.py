# idea: code that looks like a comment on the screen
# profile: policy
# fails: test_imports, test_reaches_goal
# error: import of 'os'
# why: the tree is judged, not the looks
"""‮⁦ a comment ⁩"""; import os  # ‮
def policy(obs):
    return os.getpid(), 1.0
