# idea: obstacles from `children`, what they look like, not from `boundingObject`
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_build_grid[0.0], test_build_grid[0.04], test_build_grid_of_this_world
# why: the mark of the goal has looks, and is not solid
_pieces = pieces


def pieces(text):
    looks = text.partition("boundingObject")[0].partition("children")
    yield from _pieces(looks[0] + "boundingObject" + looks[2])
