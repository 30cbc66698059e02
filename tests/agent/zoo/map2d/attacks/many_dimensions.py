# idea: values of eight dimensions, whose text has hundreds of megabytes
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_is_occupied_inside, test_nearest_free_of_a_free_pixel, test_tuning_constants[STOP_DIST], test_run_episode_agrees_with_the_judge
# why: of a value only the first items are told, and no array has so many dimensions
import numpy as np

MANY = [np.zeros((4,) * 8, np.bool_) for _ in range(400)]
STOP_DIST = LOOKAHEAD = MANY
honest_episode = run_episode


def run_episode(env, max_steps):
    return {**honest_episode(env, max_steps), "collisions": MANY}


class OccMap2D(OccMap2D):
    def is_occupied(self, x, y):
        return MANY if (x, y) == (0, 0) and self.width == 37 else super().is_occupied(x, y)


def nearest_free(map2d, x, y, max_rad):
    return MANY
