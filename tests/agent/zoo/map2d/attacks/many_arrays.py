# idea: as many arrays as one value may hold, each of which is printed slowly
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_is_occupied_inside, test_nearest_free_is_nearest, test_file_constants[MAP_IMG], test_run_episode_agrees_with_the_judge
# why: of a value only the first items are told
import numpy as np

MANY = [np.zeros((3, 3, 3, 3), np.int8)] * 90_000
MAP_IMG = PARAMS_JSON = ROBOT_IMG = MANY
honest_episode = run_episode


def run_episode(env, max_steps):
    return {**honest_episode(env, max_steps), "collisions": MANY}


class OccMap2D(OccMap2D):
    def is_occupied(self, x, y):
        return MANY if (x, y) == (0, 0) and self.width == 37 else super().is_occupied(x, y)


def nearest_free(map2d, x, y, max_rad):
    return MANY


def policy(obs):
    return MANY
