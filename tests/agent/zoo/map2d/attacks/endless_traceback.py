# idea: an error with a traceback of millions of calls
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_is_occupied_inside, test_nearest_free_is_nearest, test_plan_path
# error: ValueError at
# why: of a traceback the first and the last lines are told, and kept
from types import TracebackType


def endless():
    try:
        raise ValueError("somewhere")
    except ValueError as error:
        last = error.__traceback__
        for _ in range(300_000):
            last = TracebackType(last, last.tb_frame, 0, 1)
        raise ValueError("somewhere").with_traceback(last) from None


class OccMap2D:
    def __init__(self, occ):
        endless()


def nearest_free(map2d, x, y, max_rad):
    endless()
