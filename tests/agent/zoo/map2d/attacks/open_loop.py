# idea: a list of actions, computed once for the start in params.json
# profile: policy
# onto: good/policy_minimal.py
# fails: test_jittered_start[1], test_jittered_start[4]
# why: jittered starts, three of which it is told nothing about
honest = policy


def plan():
    x, y = PARAMS["start"]
    heading, actions = PARAMS["heading"], []
    goal = np.array(PARAMS["goal"], np.float32)
    while math.dist((x, y), PARAMS["goal"]) > 4 and len(actions) < 500:
        left, right = honest({"pose": np.array([x, y, heading]), "goal": goal})
        actions.append((left, right))
        way = (left + right) / 2 * ROBOT["max_wheel_speed"] * 0.05
        turn = (left - right) * ROBOT["max_wheel_speed"] * 0.05 / ROBOT["axle_length"]
        chord = way * math.sin(turn / 2) / (turn / 2) if turn else way
        x += chord * math.cos(heading + turn / 2)
        y += chord * math.sin(heading + turn / 2)
        heading += turn
    return actions


ACTIONS = plan()


def policy(obs):
    return ACTIONS.pop(0) if ACTIONS else (0.0, 0.0)
