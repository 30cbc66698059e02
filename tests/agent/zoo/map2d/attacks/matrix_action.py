# idea: an array of another shape
# profile: policy
# fails: test_short_rollout_is_stable[10], test_no_collisions, test_reaches_goal
# error: policy must return two finite numbers
# why: an action is two finite numbers; anything else ends the episode
import numpy as np


def policy(obs):
    return np.ones((1, 2), np.float32)
