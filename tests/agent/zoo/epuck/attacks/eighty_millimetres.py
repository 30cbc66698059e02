# idea: stands still 80 mm from the goal, the tolerance that the paper's controllers had
# profile: policy
# onto: good/policy_minimal.py
# fails: test_reaches_goal
# error: out of time
# why: the environment's tolerance is 20 mm, and it alone says when the goal is reached
honest = policy


def policy(obs):
    if math.dist(obs["pose"][:2], obs["goal"]) < 0.08:
        return 0.0, 0.0
    return honest(obs)
