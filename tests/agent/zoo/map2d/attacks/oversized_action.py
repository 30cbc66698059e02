# idea: a text of 40 MB
# profile: policy
# fails: test_short_rollout_is_stable[10], test_no_collisions, test_reaches_goal
# error: too large
# why: an action is two finite numbers; anything else ends the episode
def policy(obs):
    return "x" * 40_000_000
