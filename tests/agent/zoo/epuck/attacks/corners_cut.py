# idea: diagonal steps between two things that touch at a corner
# profile: paper
# onto: good/astar_pursuit.py
# fails: only test_astar, test_astar_on_this_world
# why: no diagonal step beside an occupied cell
def astar(occ, start, goal):
    rows, columns = occ.shape
    start, goal = tuple(map(int, start)), tuple(map(int, goal))
    if not all(0 <= x < columns and 0 <= y < rows for x, y in (start, goal)):
        return []
    if occ[start[1], start[0]] or occ[goal[1], goal[0]]:
        return []
    cost, parent, queue = {start: 0.0}, {}, [(0.0, start)]
    while queue:
        length, (x, y) = heapq.heappop(queue)
        for dx, dy in STEPS:
            a, b = x + dx, y + dy
            free = 0 <= a < columns and 0 <= b < rows and not occ[b, a]
            after = length + math.hypot(dx, dy)
            if free and after < cost.get((a, b), math.inf):
                cost[a, b], parent[a, b] = after, (x, y)
                heapq.heappush(queue, (after, (a, b)))
    if goal not in cost:
        return []
    path = [goal]
    while path[-1] != start:
        path.append(parent[path[-1]])
    return path[::-1]
