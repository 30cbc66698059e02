# idea: boxes with their own sides, but along the world's axes
# profile: policy
# onto: good/policy_minimal.py
# fails: test_reaches_goal
# why: the walls of this world stand askew, and are where they are
PIECES = [((x, y, 0.0), shape) for (x, y, _), shape in PIECES]
STEPS = wave(cell_of(PARAMS["goal"]))
_target = target


def target(x, y):
    """As far as it believes to get."""
    try:
        return _target(x, y)
    except ValueError:
        return PARAMS["goal"]
