# idea: dead reckoning from the start in world.wbt; the pose in obs is not looked at
# profile: policy
# onto: good/policy_minimal.py
# fails: test_jittered_start[1], test_jittered_start[2], test_jittered_start[3],
#   test_jittered_start[4], test_jittered_start[5]
# why: the start of an episode is in its first observation
honest = policy
ROBOT = PARAMS["robot"]
PUCK = re.search(r"^E-puck \{\n(.*?)^\}", WORLD, re.M | re.S)[1]
POSE = list(place(PUCK))


def policy(obs):
    full = ROBOT["max_wheel_speed"] * ROBOT["wheel_radius"] * PARAMS["dt"]
    left, right = map(float, obs["wheel_speeds"])
    turn = (right - left) * full / ROBOT["axle_length"]
    way = (left + right) / 2 * full
    chord = way * math.sin(turn / 2) / (turn / 2) if turn else way
    POSE[0] += chord * math.cos(POSE[2] + turn / 2)
    POSE[1] += chord * math.sin(POSE[2] + turn / 2)
    POSE[2] += turn
    return honest({**obs, "pose": POSE})
