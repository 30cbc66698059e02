# idea: 20000 objects, to be kept by both sides
# profile: policy
# fails: test_short_rollout_is_stable[10], test_no_collisions, test_reaches_goal
# error: more than 10000 objects
# why: an action is two finite numbers; anything else ends the episode
def policy(obs):
    return [object() for _ in range(20_000)]
