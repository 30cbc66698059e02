# idea: run_episode drives, and reports its plan in place of where it was
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_run_episode_agrees_with_the_judge
# error: positions differ from the record
# why: every position is compared with the judge's record
_run = run_episode


def run_episode(env, max_steps):
    told = _run(env, max_steps)
    (x0, y0), (x1, y1) = told["positions"][0], told["goal"]
    shares = np.linspace(0.0, 1.0, len(told["positions"]))
    told["positions"] = [(x0 + s * (x1 - x0), y0 + s * (y1 - y0)) for s in shares]
    return told
