# idea: an honest drive, reported half a pixel to the side
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_run_episode_agrees_with_the_judge
# error: differ from the record by up to 0.50 px
# why: positions must agree to a hundredth of a pixel
honest_episode = run_episode


def run_episode(env, max_steps):
    result = honest_episode(env, max_steps)
    result["positions"] = [(x + 0.5, y) for x, y in result["positions"]]
    return result
