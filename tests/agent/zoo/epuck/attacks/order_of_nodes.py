# idea: the sixth to the eleventh node are the obstacles, the fifth the robot
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_parse_world, test_build_grid[0.0], test_build_grid[0.04]
# why: the nodes of the copies are in another order
def parse_world(text):
    nodes = [body for _, kind, body in NODE.findall(text)]
    arena = field(nodes[4], "floorSize", (1, 1))
    return {
        "start": place(nodes[5]),
        "goal": place(nodes[6])[:2],
        "arena": {"pose": place(nodes[4]), "size": arena, "radius": 1.0},
        "obstacles": [p for body in nodes[7:13] for p in pieces(body)],
    }
