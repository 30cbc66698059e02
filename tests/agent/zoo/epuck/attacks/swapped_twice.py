# idea: wheels swapped in compute_wheel_speeds, and back in policy
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_turns_to_the_side, test_tracks_a_waypoint[0.6]
# why: the function is tested apart from the driving
_wheels = compute_wheel_speeds


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    return _wheels(pose_xy, yaw, waypoint_xy, prox)[::-1]


honest = policy


def policy(obs):
    return honest(obs)[::-1]
