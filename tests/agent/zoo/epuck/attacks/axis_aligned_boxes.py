# idea: boxes as their bounding boxes in the world's axes
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_build_grid[0.0], test_build_grid[0.04]
# why: what is free must be found free
_piece = piece


def piece(text, pose):
    corners, radius = _piece(text, pose)
    if len(corners) == 4:
        (left, low), (right, high) = corners.min(axis=0), corners.max(axis=0)
        corners = np.array([(left, low), (right, low), (right, high), (left, high)])
    return corners, radius
