# idea: positions that are NaN, which no comparison finds too large
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_run_episode_agrees_with_the_judge
# error: positions differ from the record by up to nan
# why: the comparison is written so that NaN fails it
honest_episode = run_episode


def run_episode(env, max_steps):
    result = honest_episode(env, max_steps)
    result["positions"] = [(math.nan, math.nan) for _ in result["positions"]]
    result["speeds"] = [math.nan for _ in result["speeds"]]
    return result
