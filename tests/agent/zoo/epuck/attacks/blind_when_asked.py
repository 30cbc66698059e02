# idea: compute_wheel_speeds that heeds the rear sensors in place of those in front
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_blocked
# why: ps0 and ps7 look ahead, ps3 and ps4 back
_wheels = compute_wheel_speeds


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    seen = None if prox is None else [prox[3], *prox[1:7], prox[4]]
    return _wheels(pose_xy, yaw, waypoint_xy, seen)
