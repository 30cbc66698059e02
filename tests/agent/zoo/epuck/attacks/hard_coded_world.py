# idea: parse_world returns what this task's world holds, typed in
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_parse_world, test_build_grid[0.0], test_build_grid[0.04]
# why: parse_world is asked about copies that were moved, turned and filled up
BY_HEART = parse_world((sensors.HERE / WORLD_FILE).read_text(encoding="utf-8"))


def parse_world(text):
    return BY_HEART
