# idea: leave with exit code 0 at import
# profile: policy
# fails: test_imports, test_reaches_goal, test_no_collisions
# error: SystemExit at import
# why: an import that does not end is a failed import
import sys

sys.exit(0)


def policy(obs):
    return 1.0, 1.0
