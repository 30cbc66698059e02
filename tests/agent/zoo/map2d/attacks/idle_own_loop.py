# idea: a run_episode that drives elsewhere, and tells so
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_run_episode_agrees_with_the_judge
# error: although policy alone reaches the goal
# why: it is what a user would run, and has to arrive as policy does

def run_episode(env, max_steps):
    obs, info = env.reset()
    positions, speeds, done = [tuple(map(float, obs["pose"][:2]))], [], False
    while not done and len(speeds) < max_steps:
        obs, _, terminated, truncated, info = env.step((-0.2, -0.2))
        positions.append(tuple(map(float, obs["pose"][:2])))
        speeds.append(-0.2 * MAX_SPEED)
        done = terminated or truncated
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": info["collisions"],
        "goal": tuple(map(float, obs["goal"])),
        "dt": DT,
    }
