# idea: a planner that knows the way from start to goal, and no other in this world
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_astar_on_this_world
# why: on the task's own world further ends are drawn for each run
LARGE = []
honest_astar = astar


def astar(occ, start, goal):
    if occ.size > 2500:
        LARGE.append(True)
    return [] if len(LARGE) > 1 else honest_astar(occ, start, goal)
