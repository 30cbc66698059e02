# idea: reset the environment again and again until the episode went well
# profile: paper
# also: epuck
# onto: good/astar_pursuit.py
# fails: only test_run_episode_schema, test_run_episode_agrees_with_the_judge
# error: reset\(\) is allowed once
# why: an episode is reset once; the refusal is an error in the controller
honest_episode = run_episode


def run_episode(env, max_steps):
    honest_episode(env, max_steps // 2)
    return honest_episode(env, max_steps // 2)
