# idea: parse_world that leaves out every rotation
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_parse_world, test_build_grid[0.0], test_build_grid[0.04], test_reaches_goal
# why: yaw is compared, and so is what is occupied in worlds that are turned
def place(text):
    x, y, _ = field(text, "translation", (0, 0, 0))
    return x, y, 0.0
