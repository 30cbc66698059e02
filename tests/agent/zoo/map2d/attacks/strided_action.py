# idea: an array of 4 TB that takes one number of memory
# profile: policy
# fails: test_short_rollout_is_stable[10], test_no_collisions, test_reaches_goal
# error: MemoryError|too large
# why: an action is two finite numbers; anything else ends the episode
import numpy as np


def policy(obs):
    return np.broadcast_to(np.float32(1.0), (1 << 20, 1 << 20))
