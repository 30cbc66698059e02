# idea: replace the map in the own process by an empty one
# profile: policy
# onto: good/policy_minimal.py
# fails: test_no_collisions, test_reaches_goal
# why: the world is the judge's
sensors.load_occupancy = lambda *path: np.zeros((150, 200), bool)
STEPS = wave(coarse_map(), cell_of(PARAMS["goal"]))
