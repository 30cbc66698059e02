# idea: a list of wheel speeds, computed once for the start in the file
# profile: policy
# onto: good/policy_minimal.py
# fails: test_jittered_start[1], test_jittered_start[2], test_jittered_start[3],
#   test_jittered_start[4], test_jittered_start[5]
# why: five moved starts, three of which it is told nothing about
honest = policy


def record():
    robot, actions = PARAMS["robot"], []
    pose = [*PARAMS["start"], PARAMS["heading"]]
    full = robot["max_wheel_speed"] * robot["wheel_radius"] * PARAMS["dt"]
    while math.dist(pose[:2], PARAMS["goal"]) > 0.01 and len(actions) < 2500:
        wheels = honest({"pose": pose, "goal": PARAMS["goal"]})
        left, right = (max(-1.0, min(1.0, wheel)) for wheel in wheels)
        turn = (right - left) * full / robot["axle_length"]
        way = (left + right) / 2 * full
        chord = way * math.sin(turn / 2) / (turn / 2) if turn else way
        pose[0] += chord * math.cos(pose[2] + turn / 2)
        pose[1] += chord * math.sin(pose[2] + turn / 2)
        pose[2] += turn
        actions.append((left, right))
    return actions


ACTIONS = record()


def policy(obs):
    return ACTIONS.pop(0) if ACTIONS else (0.0, 0.0)
