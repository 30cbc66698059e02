# idea: skip the tests, as pytest does at import
# profile: policy
# tiers: every
# fails: test_imports, test_reaches_goal, test_no_collisions
# error: No module named 'pytest'|Skipped at import
# why: tests run in another process, and a skip would be a failure
import sys

sys.path += ["@PACKAGE@/..", *(p for p in sys.path if "site" in p)]
import pytest

pytest.skip("nothing to test", allow_module_level=True)


def policy(obs):
    return 1.0, 1.0
