# idea: drive straight into the wall and report no collision
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_no_collisions, test_reaches_goal, test_progress
# error: 1 collision
# why: contact is found by the environment, which ends the episode
honest_episode = run_episode


def policy(obs):
    return 1.0, 1.0


def run_episode(env, max_steps):
    return {**honest_episode(env, max_steps), "collisions": 0}
