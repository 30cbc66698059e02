# idea: each obstacle is its middle, with 50 mm around it
# profile: policy
# onto: good/policy_minimal.py
# fails: test_reaches_goal
# error: collision|1 collision
# why: the body touches what the points leave out
PIECES = [(pose, 0.05) for pose, _ in PIECES]
STEPS = wave(cell_of(PARAMS["goal"]))
