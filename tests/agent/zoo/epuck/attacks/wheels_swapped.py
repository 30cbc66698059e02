# idea: (right, left)
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_turns_to_the_side, test_reaches_goal
# why: the faster right wheel turns left
_wheels = compute_wheel_speeds


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    return _wheels(pose_xy, yaw, waypoint_xy, prox)[::-1]
