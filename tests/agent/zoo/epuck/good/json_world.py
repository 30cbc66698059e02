# idea: the file is turned into JSON; complex numbers; wave by numpy, greedy descent
# profile: paper
import json
import math
import re

import numpy as np
import sensors

WORLD_FILE = "world.wbt"
TIME_STEP, MAX_WHEEL_SPEED = 32, 6.28
SENSOR_RANGE, GOAL_TOLERANCE = 0.07, 0.02
CELL, KEEP = 0.012, 0.037 + 0.011

TOKENS = re.compile(r'"[^"]*"|[{}\[\]]|[^\s,{}\[\]"]+')
FIELD = re.compile(r"[a-z]\w*$")


def as_json(text):
    """The file as nested lists: ["Kind", "name", {field: [values]}]."""
    text = re.sub(r"^(#|EXTERNPROTO).*", "", text, flags=re.MULTILINE)
    out, name, depth = [], '""', []
    for token in TOKENS.findall(text):
        last = depth[-1] if depth else ""
        if token == "DEF" or name == "DEF":
            name = "DEF" if token == "DEF" else json.dumps(token)
        elif token == "{":
            out.append("{")
            depth.append("{")
        elif token == "}":
            depth.pop()
            out.append('"":[]}],')
        elif token == "[":
            depth.append("[")
        elif token == "]":
            depth.pop()
        elif FIELD.match(token) and last == "{":
            out.append(f'"":[]#{json.dumps(token)}:[')
        elif re.match(r"[-+.\d]", token):
            out.append(f"{float(token)},")
        elif token[0] == '"':
            out.append(f"{json.dumps(token[1:-1])},")
        elif token in ("TRUE", "FALSE", "NULL"):
            out.append("null,")
        else:
            out.append(f"[{json.dumps(token)},{name},")
            name = '""'
    return out


def nodes_of(text):
    """All nodes at the top of a file: [kind, name, fields]."""
    joined = "".join(as_json(text))
    # A field ends where the next one begins, or its node.
    joined = joined.replace('{"":[]#', "{").replace('"":[]#', "],")
    joined = joined.replace('"":[]}', "]}").replace("{]}", "{}")
    joined = re.sub(r",(?=[\]}])", "", joined)
    return json.loads("[" + joined.rstrip(",") + "]")


def pose_of(fields):
    """Place x + iy, and turn as a complex number."""
    x, y, _ = fields.get("translation", (0, 0, 0))
    *_, up, angle = fields.get("rotation", (0, 0, 1, 0))
    return complex(x, y), np.exp(1j * math.copysign(angle, angle * up))


def pieces(node, at, turn):
    """(corners, radius) of each shape; corners are complex numbers."""
    kind, _, fields = node
    if kind in ("Group", "Pose"):
        to, more = pose_of(fields)
        for child in fields.get("children", []):
            yield from pieces(child, at + turn * to, turn * more)
    elif kind == "Box":
        a, b, _ = fields["size"]
        corners = np.array([-a - b * 1j, a - b * 1j, a + b * 1j, b * 1j - a]) / 2
        yield at + turn * corners, 0.0
    elif kind == "Cylinder":
        yield np.array([at]), fields["radius"][0]
    elif kind == "IndexedFaceSet":
        points = np.reshape(fields["coord"][0][2]["point"], (-1, 3))
        flat = np.unique(points[:, 0] + 1j * points[:, 1])
        yield at + turn * flat[np.argsort(np.angle(flat - flat.mean()))], 0.0


def parse_world(text):
    """start, goal, arena and obstacles."""
    world = {"obstacles": [], "arena": None}
    for kind, name, fields in nodes_of(text):
        at, turn = pose_of(fields)
        if kind == "E-puck":
            world["start"] = (at.real, at.imag, float(np.angle(turn)))
        if name == "GOAL":
            world["goal"] = (at.real, at.imag)
        if kind == "RectangleArena":
            half = [side / 2 for side in fields["floorSize"]]
            world["arena"] = (at.real, at.imag, float(np.angle(turn)), half)
        if kind == "CircleArena":
            world["arena"] = (at.real, at.imag, 0.0, fields["radius"])
        for body in fields.get("boundingObject", []):
            for corners, radius in pieces(body, at, turn):
                flat = np.column_stack([corners.real, corners.imag])
                world["obstacles"].append((flat, radius))
    return world


def inside(arena, places):
    """How far places are from the wall around them."""
    x, y, yaw, half = arena
    off = (places - complex(x, y)) * np.exp(-1j * yaw)
    if len(half) == 1:
        return half[0] - abs(off)
    return np.minimum(half[0] - abs(off.real), half[1] - abs(off.imag))


def away(corners, places):
    """Distance of places to a convex polygon, negative inside."""
    if len(corners) == 1:
        return abs(places - corners[0])
    least, depth = np.inf, -np.inf
    for begin, end in zip(corners, np.roll(corners, -1), strict=True):
        side = end - begin
        seen = (places - begin) / side
        near = seen - np.clip(seen.real, 0.0, 1.0)
        least = np.minimum(least, abs(near * side))
        depth = np.maximum(depth, -seen.imag * abs(side))
    return np.where(depth < 0, depth, least)


def build_grid(world, resolution, inflation):
    """occ[y, x], and the corner (x0, y0)."""
    places = [complex(*world["start"][:2]), complex(*world["goal"])]
    for flat, _ in world["obstacles"]:
        places += (flat[:, 0] + 1j * flat[:, 1]).tolist()
    far = 0.5
    if world["arena"]:
        places, far = [complex(*world["arena"][:2])], math.hypot(*world["arena"][3])
    x0, x1 = min(p.real for p in places) - far, max(p.real for p in places) + far
    y0, y1 = min(p.imag for p in places) - far, max(p.imag for p in places) + far
    xs = np.arange(x0 + resolution / 2, x1, resolution)
    ys = np.arange(y0 + resolution / 2, y1, resolution)
    grid = xs[None, :] + 1j * ys[:, None]
    occ = np.zeros(grid.shape, bool)
    if world["arena"]:
        occ = inside(world["arena"], grid) <= inflation
    for flat, radius in world["obstacles"]:
        corners = flat[:, 0] + 1j * flat[:, 1]
        occ |= away(corners, grid) <= inflation + radius
    return occ, (x0, y0)


SHIFTS = [(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]


def shifted(padded, dx, dy):
    """A padded array seen from cells that are moved."""
    rows, columns = padded.shape
    return padded[1 + dy : rows - 1 + dy, 1 + dx : columns - 1 + dx]


def lengths(occ, goal):
    """Length of the shortest way from every cell to the goal, by relaxing all."""
    known = np.full(occ.shape, np.inf)
    known[goal[1], goal[0]] = 0.0
    free = np.pad(~occ, 1)
    while True:
        ring, best = np.pad(known, 1, constant_values=np.inf), known.copy()
        for dx, dy in SHIFTS:
            ok = shifted(free, dx, 0) & shifted(free, 0, dy) & ~occ
            step = np.where(ok, shifted(ring, dx, dy) + math.hypot(dx, dy), np.inf)
            best = np.minimum(best, step)
        if np.array_equal(best, known):
            return known
        known = np.where(occ, np.inf, best)


def astar(occ, start, goal):
    """The path along which these lengths fall."""
    here, goal = (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1]))
    rows, columns = occ.shape
    for x, y in (here, goal):
        if not (0 <= x < columns and 0 <= y < rows) or occ[y, x]:
            return []
    known, path = lengths(occ, goal), [here]
    if np.isinf(known[here[1], here[0]]):
        return []
    while path[-1] != goal:
        x, y = path[-1]
        options = []
        for dx, dy in SHIFTS:
            a, b = x + dx, y + dy
            if not (0 <= a < columns and 0 <= b < rows):
                continue
            if not (occ[b, a] or occ[y, a] or occ[b, x]):
                options.append((known[b, a] + math.hypot(dx, dy), a, b))
        _, a, b = min(options)
        path.append((a, b))
    return path


def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    """Speed falls with the cosine of the error."""
    off = complex(waypoint_xy[0] - pose_xy[0], waypoint_xy[1] - pose_xy[1])
    error = float(np.angle(off * np.exp(-1j * yaw)))
    forward = 4.4 * max(math.cos(error), 0.0) ** 3 * min(1.0, abs(off) / 0.03)
    turn = 1.6 * math.tanh(3 * error)
    if prox is not None and prox[0] + prox[7] > 800:
        forward = 0.0
    return forward - turn, forward + turn


MAP = {}


def reset(obs):
    """The field of lengths for the goal."""
    world = parse_world((sensors.HERE / WORLD_FILE).read_text(encoding="utf-8"))
    occ, corner = build_grid(world, CELL, KEEP)
    i, j = (int((obs["goal"][k] - corner[k]) / CELL) for k in (0, 1))
    MAP["field"], MAP["corner"] = lengths(occ, (i, j)), corner


def policy(obs):
    """To the best of the cells nearby."""
    if not MAP:
        reset(obs)
    x, y, yaw = map(float, obs["pose"])
    aim = (float(obs["goal"][0]), float(obs["goal"][1]))
    if math.dist(aim, (x, y)) > 0.03:
        field, (x0, y0) = MAP["field"], MAP["corner"]
        i, j = int((x - x0) / CELL), int((y - y0) / CELL)
        low_i, low_j = max(i - 2, 0), max(j - 2, 0)
        near = field[low_j : j + 3, low_i : i + 3]
        b, a = np.unravel_index(np.argmin(near), near.shape)
        aim = (x0 + (low_i + a + 0.5) * CELL, y0 + (low_j + b + 0.5) * CELL)
    left, right = compute_wheel_speeds((x, y), yaw, aim, None)
    return left / MAX_WHEEL_SPEED, right / MAX_WHEEL_SPEED


def run_episode(env, max_steps):
    """Until the end, or for so many steps."""
    obs, info = env.reset()
    reset(obs)
    track, speeds, over = [obs["pose"][:2].tolist()], [], False
    while len(speeds) < max_steps and not over:
        wheels = policy(obs)
        obs, _, terminated, truncated, info = env.step(wheels)
        over = terminated or truncated
        track.append(obs["pose"][:2].tolist())
        speeds.append(MAX_WHEEL_SPEED * 0.02 * (wheels[0] + wheels[1]) / 2)
    return {
        "positions": [(x, y) for x, y in track],
        "speeds": speeds,
        "collisions": int(info["collisions"]),
        "goal": (float(obs["goal"][0]), float(obs["goal"][1])),
        "dt": 0.032,
    }


def main():
    """Shows an episode."""
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
