# idea: plan for a point
# profile: policy
# onto: good/policy_minimal.py
# fails: test_no_collisions, test_reaches_goal
# error: 1 collision
# why: the body is a disc of 37 mm
KEEP_OFF = 0.001
STEPS = wave(cell_of(PARAMS["goal"]))
