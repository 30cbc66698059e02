# idea: think for ever about the twentieth step
# profile: policy
# onto: good/policy_minimal.py
# limits: call_seconds=1
# fails: test_reaches_goal, test_no_collisions
# error: policy did not end within 1 s
# why: each call has a deadline; a late one is tried once more alone, then it counts
honest, calls = policy, []


def policy(obs):
    calls.append(1)
    while len(calls) == 20:
        continue
    return honest(obs)
