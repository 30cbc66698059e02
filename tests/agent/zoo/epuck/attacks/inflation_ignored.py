# idea: build_grid with the inflation that its own driving needs, whatever is asked
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_build_grid[0.0], test_build_grid[0.04]
# why: two inflations are asked for, and points are compared for each
_build = build_grid


def build_grid(world, resolution, inflation):
    return _build(world, resolution, MARGIN)
