# idea: a list nested ten thousand times
# profile: policy
# fails: test_short_rollout_is_stable[10], test_no_collisions, test_reaches_goal
# error: nested deeper
# why: an action is two finite numbers; anything else ends the episode
NEST = []
for _ in range(10_000):
    NEST = [NEST]


def policy(obs):
    return NEST
