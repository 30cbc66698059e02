# idea: nodes with DEF are taken for marks, and only those without are solid
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_build_grid[0.0], test_build_grid[0.04]
# why: DEF may stand before any node, and does in the copies
_parse = parse_world


def parse_world(text):
    bare = re.sub(r"^DEF (?!GOAL)\S+ Solid \{\n(.*?)^\}\n", "", text, flags=re.M | re.S)
    return _parse(bare)
