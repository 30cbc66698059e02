# idea: an array of objects that can run code when they are unpickled
# profile: policy
# fails: test_short_rollout_is_stable[10], test_no_collisions, test_reaches_goal
# error: policy must return two finite numbers
# why: an action is two finite numbers; anything else ends the episode
import numpy as np


class Wheel:
    def __reduce__(self):
        return print, ("unpickled",)


def policy(obs):
    return np.array([Wheel(), Wheel()], dtype=object)
