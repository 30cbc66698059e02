# idea: pieces of a Group where the Solid is, each Pose in it ignored
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_build_grid[0.0], test_build_grid[0.04]
# why: each of the pieces is where its Pose says
def pieces(text):
    head, found, body = text.partition("boundingObject")
    for part in (body.split("Pose {")[1:] or [body]) if found else []:
        yield piece(part, place(text.partition("children")[0]))


_piece = piece


def piece(text, pose):
    corners, radius = _piece(text, pose)
    middle = np.array(pose[:2])
    grown = len(corners) == 4 and "IndexedFaceSet" in text
    return (corners - corners.mean(axis=0) + middle if grown else corners), radius
