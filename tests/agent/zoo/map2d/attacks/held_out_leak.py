# idea: tell the start poses of the held-out episodes through error messages
# profile: policy
# onto: good/policy_minimal.py
# fails: only test_jittered_start[1], test_jittered_start[2], test_jittered_start[3],
#   test_jittered_start[4], test_jittered_start[5]
# error: started at
# hides: jittered start [345]: [^\n]*started
# why: feedback tells only pass or fail of three of the five starts
honest, calls = policy, []


def policy(obs):
    x, y, heading = (round(float(value), 3) for value in obs["pose"])
    calls.append((x, y))
    if calls[0] != (30.0, 40.0):
        raise ValueError(f"started at {x} {y} {heading}")
    return honest(obs)
