# idea: choose another start and goal, drive there by dead reckoning, report success
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_reaches_goal
# why: start, goal and pose are the judge's; whether the goal is reached is, too
POSE = [100.0, 30.0, 1.5]


def policy(obs):
    x, y, heading = POSE
    error = math.remainder(math.atan2(120.0 - y, 98.0 - x) - heading, math.tau)
    left, right = 0.5 + 0.3 * error, 0.5 - 0.3 * error
    POSE[2] += (left - right) * MAX_SPEED * DT / AXLE_LENGTH_PX
    POSE[0] += (left + right) / 2 * MAX_SPEED * DT * math.cos(POSE[2])
    POSE[1] += (left + right) / 2 * MAX_SPEED * DT * math.sin(POSE[2])
    return left, right
