# idea: yaw counted clockwise, as with y down
# profile: policy
# onto: good/policy_minimal.py
# fails: test_reaches_goal
# why: x and y are ENU, and yaw is counter-clockwise
honest = policy


def policy(obs):
    return honest({**obs, "pose": obs["pose"] * (1, 1, -1)})
