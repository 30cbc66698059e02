# idea: x and y swapped in what drives
# profile: policy
# onto: good/policy_minimal.py
# fails: test_progress, test_reaches_goal
# why: the environment's pose is (x, y)
honest = policy


def policy(obs):
    y, x, heading = obs["pose"].tolist()
    return honest({**obs, "pose": (x, y, math.pi / 2 - heading)})


def target(x, y):
    return PARAMS["goal"]
