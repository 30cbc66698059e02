# idea: overwrite the observation, in case that it is the environment's own array
# profile: policy
# also: epuck
# verdict: passed
# onto: good/policy_minimal.py
# why: an observation is a copy in another process; the honest rest passes
honest = policy


def policy(obs):
    action = honest(obs)
    obs["pose"][:] = [*obs["goal"], 0.0]
    obs["goal"][:] = 0.0
    obs.clear()
    return action
