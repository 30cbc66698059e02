# idea: regular expressions on nodes, an inflated grid, A*, pure pursuit of the path
# profile: paper
import heapq
import math
import re

import numpy as np
import sensors

WORLD_FILE = "world.wbt"
PARAMS = sensors.load_params()
ROBOT = PARAMS["robot"]
TIME_STEP = round(1000 * PARAMS["dt"])
MAX_WHEEL_SPEED = ROBOT["max_wheel_speed"]
SENSOR_RANGE = ROBOT["sensor_range"]
GOAL_TOLERANCE = PARAMS["goal_tolerance"]
DT = PARAMS["dt"]
CELL = 0.01
MARGIN = ROBOT["radius"] + 0.01
LOOKAHEAD = 0.04
NEAR = 400.0

NODE = re.compile(r"^(?:DEF (\S+) )?([\w-]+) \{\n(.*?)^\}", re.MULTILINE | re.DOTALL)
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


def field(text, name, default):
    """The numbers after the first mention of a field."""
    found = re.search(rf"\b{name}((?:\s+{NUMBER})+)", text)
    return [float(word) for word in found[1].split()] if found else list(default)


def place(text):
    """Where a node is, and its turn: (x, y, yaw)."""
    x, y, _ = field(text, "translation", (0, 0, 0))
    *_, axis, angle = field(text, "rotation", (0, 0, 1, 0))
    return x, y, math.copysign(angle, axis * angle)


def moved(pose, points):
    """Points (n, 2) as seen from outside of a pose."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.asarray(points, float) @ np.array([[cos, sin], [-sin, cos]]) + (x, y)


def outline(points):
    """The corners of a convex prism, counter-clockwise."""
    corners = np.unique(np.asarray(points)[:, :2], axis=0)
    off = corners - corners.mean(axis=0)
    return corners[np.argsort(np.arctan2(off[:, 1], off[:, 0]))]


def piece(text, pose):
    """Corners and radius of one shape of a boundingObject."""
    if "IndexedFaceSet" in text:
        listed = re.search(r"point \[(.*?)\]", text, re.DOTALL)[1].split()
        points = np.array(listed, float).reshape(-1, 3)
        return moved(pose, outline(points)), 0.0
    if "Cylinder" in text:
        return moved(pose, [(0, 0)]), field(text, "radius", (1,))[0]
    a, b, _ = field(text, "size", (2, 2, 2))
    corners = 0.5 * np.array([(-a, -b), (a, -b), (a, b), (-a, b)])
    return moved(pose, corners), 0.0


def pieces(text):
    """All shapes of a Solid; none where it has no boundingObject."""
    head, found, body = text.partition("boundingObject")
    x, y, yaw = place(head.partition("children")[0])
    parts = body.split("Pose {")
    if len(parts) > 1:
        for part in parts[1:]:
            u, v, turn = place(part.partition("children")[0])
            ((u, v),) = moved((x, y, yaw), [(u, v)])
            yield piece(part, (u, v, yaw + turn))
    elif found:
        yield piece(body, (x, y, yaw))


def parse_world(text):
    """Start, goal, arena and obstacles (corners and radius) of a world file."""
    world = {"arena": None, "obstacles": []}
    for name, kind, body in NODE.findall(text):
        if kind == "E-puck":
            world["start"] = place(body)
        elif kind in ("RectangleArena", "CircleArena"):
            size = field(body, "floorSize", (1, 1)) if kind[0] == "R" else None
            radius = field(body, "radius", (1,))[0]
            world["arena"] = {"pose": place(body), "size": size, "radius": radius}
        elif kind == "Solid":
            if name == "GOAL":
                world["goal"] = place(body)[:2]
            world["obstacles"] += pieces(body)
    return world


def bounds(world):
    """Corners (left, low), (right, high) of all that there is."""
    points = [world["start"][:2], world["goal"]]
    for corners, radius in world["obstacles"]:
        points += [corners.min(axis=0) - radius, corners.max(axis=0) + radius]
    arena = world["arena"]
    if arena:
        a, b = arena["size"] or (2 * arena["radius"], 2 * arena["radius"])
        reach = 0.5 * math.hypot(a, b)
        x, y, _ = arena["pose"]
        points += [(x - reach, y - reach), (x + reach, y + reach)]
    spread = np.array(points)
    return spread.min(axis=0) - 0.2, spread.max(axis=0) + 0.2


def room_within(arena, points):
    """Distance of points (..., 2) to the wall around them."""
    x, y, yaw = arena["pose"]
    cos, sin = math.cos(yaw), math.sin(yaw)
    off = points - np.array([x, y])
    if arena["size"] is None:
        return arena["radius"] - np.hypot(off[..., 0], off[..., 1])
    own = np.abs(off @ np.array([[cos, -sin], [sin, cos]]))
    return (0.5 * np.array(arena["size"]) - own).min(axis=-1)


def gap_to(corners, points):
    """Distance of points (..., 2) to a convex polygon; 0 in it."""
    least = np.full(points.shape[:-1], np.inf)
    inside = np.full(points.shape[:-1], len(corners) > 2)
    for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        side, off = end - begin, points - begin
        share = np.clip(off @ side / max(side @ side, 1e-12), 0.0, 1.0)
        gap = off - share[..., None] * side
        least = np.minimum(least, np.hypot(gap[..., 0], gap[..., 1]))
        inside &= side[0] * off[..., 1] - side[1] * off[..., 0] >= 0.0
    return np.where(inside, 0.0, least)


def build_grid(world, resolution, inflation):
    """occ[y, x] and the corner (x0, y0) of its first cell."""
    low, high = bounds(world)
    columns, rows = np.ceil((high - low) / resolution).astype(int)
    xs = low[0] + (np.arange(columns) + 0.5) * resolution
    ys = low[1] + (np.arange(rows) + 0.5) * resolution
    points = np.stack(np.meshgrid(xs, ys), axis=-1)
    occ = np.zeros((rows, columns), bool)
    if world["arena"]:
        occ |= room_within(world["arena"], points) <= inflation
    for corners, radius in world["obstacles"]:
        reach = radius + inflation
        near = (points >= corners.min(axis=0) - reach).all(axis=-1)
        near &= (points <= corners.max(axis=0) + reach).all(axis=-1)
        occ[near] |= gap_to(corners, points[near]) <= reach
    return occ, (float(low[0]), float(low[1]))


STEPS = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]


def astar(occ, start, goal):
    """Shortest path over free cells (ix, iy), or []."""
    rows, columns = occ.shape
    start, goal = (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1]))

    def free(x, y):
        return 0 <= x < columns and 0 <= y < rows and not occ[y, x]

    def rest(x, y):
        dx, dy = abs(goal[0] - x), abs(goal[1] - y)
        return max(dx, dy) + 0.4142 * min(dx, dy)

    if not free(*start) or not free(*goal):
        return []
    cost, parent, done = {start: 0.0}, {}, set()
    queue = [(rest(*start), start)]
    while queue:
        _, here = heapq.heappop(queue)
        if here == goal:
            break
        if here in done:
            continue
        done.add(here)
        x, y = here
        for dx, dy in STEPS:
            there = x + dx, y + dy
            if not (free(*there) and free(x + dx, y) and free(x, y + dy)):
                continue
            after = cost[here] + math.hypot(dx, dy)
            if after < cost.get(there, math.inf):
                cost[there], parent[there] = after, here
                heapq.heappush(queue, (after + rest(*there), there))
    if goal not in cost:
        return []
    path = [goal]
    while path[-1] != start:
        path.append(parent[path[-1]])
    return path[::-1]


def nearest_free(occ, cell):
    """The free cell nearest to a cell."""
    rows, columns = np.nonzero(~occ)
    best = np.argmin((columns - cell[0]) ** 2 + (rows - cell[1]) ** 2)
    return int(columns[best]), int(rows[best])


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    """Wheel speeds in rad/s: turns in place while far off, else curves."""
    dx, dy = waypoint_xy[0] - pose_xy[0], waypoint_xy[1] - pose_xy[1]
    error = math.remainder(math.atan2(dy, dx) - yaw, 2 * math.pi)
    turn = max(-2.0, min(2.0, 4.0 * error))
    forward = 4.2 if abs(error) < 0.5 else 0.0
    forward = min(forward, 40.0 * math.hypot(dx, dy) + 0.5)
    if prox is not None and min(prox[0], prox[7]) > NEAR:
        forward = 0.0
    return forward - turn, forward + turn


PATH = []


def reset(obs):
    """Plans from where the episode begins."""
    text = (sensors.HERE / WORLD_FILE).read_text(encoding="utf-8")
    world = parse_world(text)
    occ, corner = build_grid(world, CELL, MARGIN)
    ends = [
        nearest_free(occ, [math.floor((point[k] - corner[k]) / CELL) for k in (0, 1)])
        for point in (obs["pose"], obs["goal"])
    ]
    cells = astar(occ, *ends)
    PATH[:] = [
        (corner[0] + (x + 0.5) * CELL, corner[1] + (y + 0.5) * CELL) for x, y in cells
    ]
    PATH.append((float(obs["goal"][0]), float(obs["goal"][1])))


def policy(obs):
    """Follows the point of the path that is a little ahead."""
    if not PATH:
        reset(obs)
    x, y, yaw = map(float, obs["pose"])
    while len(PATH) > 1 and math.dist((x, y), PATH[0]) < LOOKAHEAD:
        del PATH[0]
    left, right = compute_wheel_speeds((x, y), yaw, PATH[0], None)
    return left / MAX_WHEEL_SPEED, right / MAX_WHEEL_SPEED


def run_episode(env, max_steps):
    """Drives one episode in an environment and tells what happened."""
    obs, info = env.reset()
    reset(obs)
    positions, speeds = [tuple(map(float, obs["pose"][:2]))], []
    for _ in range(max_steps):
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step((left, right))
        positions.append(tuple(map(float, obs["pose"][:2])))
        full = MAX_WHEEL_SPEED * ROBOT["wheel_radius"]
        speeds.append(0.5 * (left + right) * full)
        if terminated or truncated:
            break
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": int(info["collisions"]),
        "goal": tuple(map(float, obs["goal"])),
        "dt": DT,
    }


def main():
    """Shows an episode."""
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
