# idea: obstacles are what has the names that they have in this file
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_build_grid[0.0], test_build_grid[0.04]
# why: names are free; the copies have others
_pieces = pieces
NAMES = ("box 1", "box 2", "barrel", "wall", "pipe", "rock")


def pieces(text):
    if any(f'name "{name}"' in text for name in NAMES):
        yield from _pieces(text)
