# idea: policy returns rad/s
# profile: policy
# onto: good/dynamic_window.py
# fails: test_jittered_start[1], test_jittered_start[3], test_jittered_start[5]
# why: what is clipped to [-1, 1] drives another arc than the one that was tried
honest = policy


def policy(obs):
    left, right = honest(obs)
    return 6.28 * left, 6.28 * right
