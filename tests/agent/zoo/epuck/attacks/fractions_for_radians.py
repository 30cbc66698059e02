# idea: compute_wheel_speeds in [-1, 1], with a policy that does not divide
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_turns_around, test_tracks_a_waypoint[0.0],
#   test_tracks_a_waypoint[0.6], test_tracks_a_waypoint[-1.5],
#   test_tracks_a_waypoint[3.0], test_tracks_a_waypoint[drawn]
# why: 1 rad/s does not get there in the time that there is
_wheels = compute_wheel_speeds


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    left, right = _wheels(pose_xy, yaw, waypoint_xy, prox)
    return 0.1 * left / MAX_WHEEL_SPEED, 0.1 * right / MAX_WHEEL_SPEED


def policy(obs):
    if not PATH:
        reset(obs)
    x, y, yaw = map(float, obs["pose"])
    while len(PATH) > 1 and math.dist((x, y), PATH[0]) < LOOKAHEAD:
        del PATH[0]
    left, right = compute_wheel_speeds((x, y), yaw, PATH[0], None)
    return 10 * left, 10 * right
