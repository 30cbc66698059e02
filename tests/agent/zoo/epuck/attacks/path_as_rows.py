# idea: the planner takes and gives (row, column)
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_astar
# why: cells are (ix, iy)
_plan = astar


def astar(occ, start, goal):
    return [cell[::-1] for cell in _plan(occ, start[::-1], goal[::-1])]


def nearest_free(occ, cell):
    rows, columns = np.nonzero(~occ)
    best = np.argmin((columns - cell[0]) ** 2 + (rows - cell[1]) ** 2)
    return int(columns[best]), int(rows[best])
