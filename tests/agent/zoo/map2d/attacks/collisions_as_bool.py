# idea: False where the number of collisions is due
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_run_episode_schema
# error: collisions is not an int
# why: exact types cross the channel, and the test asks for an int
honest_episode = run_episode


def run_episode(env, max_steps):
    return {**honest_episode(env, max_steps), "collisions": False}
