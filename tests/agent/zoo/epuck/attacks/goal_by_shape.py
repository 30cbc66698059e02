# idea: the goal is the first thing that is a cylinder
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_parse_world
# why: barrels are cylinders, too, and may come first
_parse = parse_world


def parse_world(text):
    world = _parse(text)
    for _, kind, body in NODE.findall(text):
        if kind == "Solid" and "Cylinder" in body:
            world["goal"] = place(body)[:2]
            break
    return world
