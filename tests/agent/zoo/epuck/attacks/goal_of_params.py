# idea: start and goal from params.json, whatever the file is
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_parse_world
# why: the copies have another start and goal
_parse = parse_world


def parse_world(text):
    world = _parse(text)
    world["start"] = (*PARAMS["start"], PARAMS["heading"])
    world["goal"] = tuple(PARAMS["goal"])
    return world
