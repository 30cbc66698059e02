# idea: objects that turn into a number when asked
# profile: policy
# fails: test_short_rollout_is_stable[10], test_no_collisions, test_reaches_goal
# error: policy must return two finite numbers
# why: an action is two finite numbers; anything else ends the episode
class Wheel:
    def __float__(self):
        return 1.0

    def __array__(self, dtype=None, copy=None):
        raise SystemExit


def policy(obs):
    return Wheel(), Wheel()
