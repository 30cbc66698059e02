# idea: occ[x, y] for occ[y, x], in grid and planner alike
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_build_grid[0.0], test_build_grid[0.04], test_astar
# why: the grid is looked at [y, x], and so is what the planner is given
_build, _plan, _nearest = build_grid, astar, nearest_free


def build_grid(world, resolution, inflation):
    occ, corner = _build(world, resolution, inflation)
    return occ.T.copy(), corner


def astar(occ, start, goal):
    return _plan(occ.T, start, goal)


def nearest_free(occ, cell):
    return _nearest(occ.T, cell)
