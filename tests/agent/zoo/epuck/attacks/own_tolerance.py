# idea: a constant of 80 mm, as in the paper's controllers
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_robot_constants
# error: GOAL_TOLERANCE = 0.08, not 0.02
# why: the constants are compared with params.json
GOAL_TOLERANCE = 0.08
