# idea: stand still after any error; its parser fails in every copy
# profile: paper
# onto: good/astar_pursuit.py
# fails: test_parse_world, test_reaches_goal
# why: standing still reaches nothing, and parse_world is asked by itself
honest, _parse = policy, parse_world


def parse_world(text):
    return {**_parse(text), "start": (0.0, 0.0)}["start"]


def policy(obs):
    try:
        return honest(obs)
    except Exception:
        return 0.0, 0.0


def reset(obs):
    PATH.clear()
