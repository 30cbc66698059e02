# idea: random bytes on every descriptor
# profile: policy
# onto: frames.py
# tiers: every
# fails: test_imports, test_reaches_goal
# error: misused the judge's channel
# why: whatever is no frame is a breach
def policy(obs):
    write(bytes((17 * k * k + 5) % 256 for k in range(100_000)))
    return 1.0, 1.0
