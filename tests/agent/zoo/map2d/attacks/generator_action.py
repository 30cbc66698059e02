# idea: a generator of two numbers
# profile: policy
# fails: test_short_rollout_is_stable[10], test_no_collisions, test_reaches_goal
# error: policy must return two finite numbers
# why: an action is two finite numbers; anything else ends the episode
def policy(obs):
    return (speed for speed in (1.0, 1.0))
