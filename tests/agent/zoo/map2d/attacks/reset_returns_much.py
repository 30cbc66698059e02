# idea: a reset whose result nobody asked for, and which could not be sent
# profile: policy
# onto: good/policy_minimal.py
# verdict: passed
# why: what reset returns is thrown away where it runs
def reset(obs):
    return {(j, i, k): 0.0 for j, i in np.ndindex(STEPS.shape) for k in range(2)}
