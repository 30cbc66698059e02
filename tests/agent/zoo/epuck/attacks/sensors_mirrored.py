# idea: ps0 to ps3 taken for the left side, as in the paper; away from what they see
# profile: policy
# fails: test_no_collisions, test_reaches_goal
# error: 1 collision
# why: they are on the right, so it turns towards what it sees
import math


def policy(obs):
    x, y, yaw = map(float, obs["pose"])
    dx, dy = (float(g) for g in obs["goal"] - obs["pose"][:2])
    left, right = float(obs["ps"][:4].max()), float(obs["ps"][4:].max())
    if max(left, right) > 90:
        return (0.5, 0.1) if left > right else (0.1, 0.5)
    error = math.remainder(math.atan2(dy, dx) - yaw, math.tau)
    turn = max(-0.4, min(0.4, error))
    return 0.5 - turn, 0.5 + turn
