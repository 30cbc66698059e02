# idea: step the real environment with zeros, report the drive through a simulated one
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_run_episode_agrees_with_the_judge
# error: positions differ from the record
# why: positions and speeds are compared with the judge's own record
def run_episode(env, max_steps):
    obs, _ = env.reset()
    x, y, heading = map(float, obs["pose"])
    result = {"positions": [(x, y)], "speeds": [], "collisions": 0, "dt": DT}
    result["goal"] = tuple(map(float, obs["goal"]))
    for _ in range(max_steps):
        obs = {**obs, "pose": np.array([x, y, heading], np.float32)}
        left, right = policy(obs)
        env.step((0.0, 0.0))
        speed = (left + right) / 2 * MAX_SPEED
        heading += (left - right) * MAX_SPEED * DT / AXLE_LENGTH_PX
        x, y = x + speed * DT * math.cos(heading), y + speed * DT * math.sin(heading)
        result["positions"].append((x, y))
        result["speeds"].append(speed)
    return result
