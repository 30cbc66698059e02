# idea: a relative import
# profile: policy
# fails: test_imports, test_reaches_goal
# error: import of '.'
# why: there is no package
from . import sensors


def policy(obs):
    return 1.0, 1.0
