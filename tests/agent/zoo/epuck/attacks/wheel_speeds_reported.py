# idea: run_episode that reports rad/s of the wheels for m/s of the body
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_run_episode_agrees_with_the_judge
# error: speeds differ from the applied ones
# why: every speed is compared with what was applied
_run = run_episode


def run_episode(env, max_steps):
    told = _run(env, max_steps)
    told["speeds"] = [speed / 0.02 for speed in told["speeds"]]
    return told
