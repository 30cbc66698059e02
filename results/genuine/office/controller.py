"""Differential-drive controller: clearance map, weighted A*, guarded pure pursuit."""

import heapq
import math

import numpy as np

import sensors

MAP_IMG = "occupancy.png"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"
AXLE_LENGTH_PX = 24.0
SENSOR_RANGE_PX = 220.0
SENSOR_FOV_DEG = 110.0
N_RAYS = 18

LOOKAHEAD = 30.0
STOP_DIST = 12.5
SLOW_DIST = 36.0

ROBOT_RADIUS = 12.0
MAX_WHEEL_SPEED = 75.59
DT = 0.05
STEP_PX = MAX_WHEEL_SPEED * DT
MAX_TURN = 2.0 * MAX_WHEEL_SPEED * DT / AXLE_LENGTH_PX

FIELD_MAX = 36.0
GRID_CELL = 2
PATH_SPACING = 2.0
PLAN_LIMITS = (13.5, 12.8, 12.3)
SAFE_CLEARANCE = 12.3
STUCK_STEPS = 60
MAX_REPLANS = 6

DIRECTIONS = (
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 1),
    (1, -1),
    (-1, 1),
    (-1, -1),
)

_STATE = {}


# ----------------------------------------------------------------------------
# Map
# ----------------------------------------------------------------------------


class OccMap2D:
    """Occupancy grid occ[y, x], True = occupied; the outside is occupied."""

    def __init__(self, occ):
        self.occ = np.array(occ, dtype=bool)
        self.height, self.width = self.occ.shape

    def is_occupied(self, x, y):
        x, y = float(x), float(y)
        if not (math.isfinite(x) and math.isfinite(y)):
            return True
        i, j = math.floor(x + 0.5), math.floor(y + 0.5)
        if i < 0 or j < 0 or i >= self.width or j >= self.height:
            return True
        return bool(self.occ[j, i])


def nearest_free(map2d, x, y, max_rad):
    """The free pixel nearest to (x, y), at most max_rad away."""
    x, y = float(x), float(y)
    i, j = math.floor(x + 0.5), math.floor(y + 0.5)
    if not map2d.is_occupied(i, j):
        return (int(i), int(j))
    height, width = map2d.occ.shape
    reach = min(float(max_rad), abs(x) + abs(y) + height + width + 2.0)
    if not reach >= 0.0:
        raise ValueError("no free pixel within max_rad")
    left = max(0, math.ceil(x - reach - 1e-9))
    right = min(width - 1, math.floor(x + reach + 1e-9))
    top = max(0, math.ceil(y - reach - 1e-9))
    bottom = min(height - 1, math.floor(y + reach + 1e-9))
    if left > right or top > bottom:
        raise ValueError("no free pixel within max_rad")
    rows, cols = np.nonzero(~map2d.occ[top : bottom + 1, left : right + 1])
    if rows.size == 0:
        raise ValueError("no free pixel within max_rad")
    d2 = (cols + left - x) ** 2 + (rows + top - y) ** 2
    best = int(np.argmin(d2))
    if float(d2[best]) > reach * reach + 1e-9:
        raise ValueError("no free pixel within max_rad")
    return (int(cols[best]) + left, int(rows[best]) + top)


def _clearance_field(occ):
    """Distance from each pixel's centre to the nearest occupied square (capped)."""
    solid = np.pad(np.asarray(occ, dtype=bool), 1, "constant", constant_values=True)
    height, width = solid.shape
    column = np.arange(width, dtype=np.int32)[None, :]
    far = 4 * width
    before = np.maximum.accumulate(np.where(solid, column, -far), axis=1)
    flipped = np.where(solid, column, far)[:, ::-1]
    after = np.minimum.accumulate(flipped, axis=1)[:, ::-1]
    gap = np.minimum(column - before, after - column).astype(np.float32)
    gap = np.clip(gap - np.float32(0.5), 0.0, FIELD_MAX).astype(np.float32)
    square = gap * gap
    best = square.copy()
    for dy in range(1, min(int(FIELD_MAX) + 1, height)):
        extra = np.float32((dy - 0.5) ** 2)
        best[dy:] = np.minimum(best[dy:], square[:-dy] + extra)
        best[:-dy] = np.minimum(best[:-dy], square[dy:] + extra)
    return np.sqrt(best)[1:-1, 1:-1].copy()


def _sample(field, xs, ys):
    """Bilinear value of the field at the points (xs, ys)."""
    height, width = field.shape
    xs = np.clip(np.asarray(xs, dtype=float), 0.0, width - 1.001)
    ys = np.clip(np.asarray(ys, dtype=float), 0.0, height - 1.001)
    i, j = xs.astype(np.int64), ys.astype(np.int64)
    u, v = xs - i, ys - j
    upper = field[j, i] * (1.0 - u) + field[j, i + 1] * u
    lower = field[j + 1, i] * (1.0 - u) + field[j + 1, i + 1] * u
    return upper * (1.0 - v) + lower * v


def _clearance(field, x, y):
    return float(_sample(field, np.array([x]), np.array([y]))[0])


def _segment_clearance(field, x0, y0, x1, y1):
    """Least clearance along a straight segment."""
    count = int(math.hypot(x1 - x0, y1 - y0)) + 3
    t = np.linspace(0.0, 1.0, count)
    return float(_sample(field, x0 + (x1 - x0) * t, y0 + (y1 - y0) * t).min())


# ----------------------------------------------------------------------------
# Search
# ----------------------------------------------------------------------------


def _shifted(padded, first_x, first_y, columns, rows, cell):
    """Lattice of `columns` x `rows` samples of a padded array."""
    return padded[
        first_y : first_y + (rows - 1) * cell + 1 : cell,
        first_x : first_x + (columns - 1) * cell + 1 : cell,
    ]


def _step_masks(free, x0, y0, cell):
    """Bit mask of the allowed steps of `cell` px at every lattice point."""
    height, width = free.shape
    columns = (width - 1 - x0) // cell + 1
    rows = (height - 1 - y0) // cell + 1
    padded = np.pad(free, cell, "constant", constant_values=False)
    bx, by = x0 + cell, y0 + cell
    masks = np.zeros((rows, columns), dtype=np.uint8)
    for bit, (dx, dy) in enumerate(DIRECTIONS):
        ok = _shifted(padded, bx, by, columns, rows, cell).copy()
        for t in range(1, cell + 1):
            ok &= _shifted(padded, bx + dx * t, by + dy * t, columns, rows, cell)
            if dx and dy:
                ok &= _shifted(
                    padded, bx + dx * t, by + dy * (t - 1), columns, rows, cell
                )
                ok &= _shifted(
                    padded, bx + dx * (t - 1), by + dy * t, columns, rows, cell
                )
        masks |= ok.astype(np.uint8) << np.uint8(bit)
    return masks


def _astar(masks, weights, cell, start, goal):
    """A* over a lattice; start and goal are (column, row). Returns (column, row)s."""
    rows, columns = masks.shape
    diagonal = math.sqrt(2.0)
    ax = np.abs(np.arange(columns) - goal[0])[None, :]
    ay = np.abs(np.arange(rows) - goal[1])[:, None]
    octile = np.maximum(ax, ay) + (diagonal - 1.0) * np.minimum(ax, ay)
    heuristic = (octile * (1.001 * cell)).ravel().tolist()
    moves = []
    for mask in range(256):
        steps = []
        for bit, (dx, dy) in enumerate(DIRECTIONS):
            if (mask >> bit) & 1:
                length = cell * (diagonal if dx and dy else 1.0)
                steps.append((dy * columns + dx, length))
        moves.append(tuple(steps))
    allowed = np.ascontiguousarray(masks).tobytes()
    total = rows * columns
    cost = [math.inf] * total
    parent = [-1] * total
    closed = bytearray(total)
    first = start[1] * columns + start[0]
    last = goal[1] * columns + goal[0]
    cost[first] = 0.0
    heap = [(heuristic[first], first)]
    pop, push = heapq.heappop, heapq.heappush
    found = False
    while heap:
        node = pop(heap)[1]
        if closed[node]:
            continue
        closed[node] = 1
        if node == last:
            found = True
            break
        base = cost[node]
        for offset, length in moves[allowed[node]]:
            other = node + offset
            value = base + length * weights[other]
            if value < cost[other] and not closed[other]:
                cost[other] = value
                parent[other] = node
                push(heap, (value + heuristic[other], other))
    if not found:
        return []
    chain = []
    node = last
    while node >= 0:
        chain.append((node % columns, node // columns))
        node = parent[node]
    chain.reverse()
    return chain


def plan_path(map2d, start, goal, cell):
    """Shortest 8-connected path for a point in steps of exactly `cell` px."""
    sx, sy = math.floor(float(start[0]) + 0.5), math.floor(float(start[1]) + 0.5)
    gx, gy = math.floor(float(goal[0]) + 0.5), math.floor(float(goal[1]) + 0.5)
    cell = int(cell)
    if cell < 1:
        raise ValueError("cell must be at least 1")
    if map2d.is_occupied(sx, sy) or map2d.is_occupied(gx, gy):
        return []
    if sx == gx and sy == gy:
        return [(int(sx), int(sy))]
    if (gx - sx) % cell or (gy - sy) % cell:
        return []
    free = ~map2d.occ
    height, width = free.shape
    if cell >= max(height, width):
        return []
    x0, y0 = sx % cell, sy % cell
    masks = _step_masks(free, x0, y0, cell)
    chain = _astar(
        masks,
        [1.0] * masks.size,
        cell,
        ((sx - x0) // cell, (sy - y0) // cell),
        ((gx - x0) // cell, (gy - y0) // cell),
    )
    return [(int(x0 + c * cell), int(y0 + r * cell)) for c, r in chain]


# ----------------------------------------------------------------------------
# Route of the body
# ----------------------------------------------------------------------------


def _snap(field, x, y, limit, radius, floor, x0, y0, cell):
    """Nearest lattice pixel with enough clearance, if possible in plain sight."""
    height, width = field.shape
    xs = np.arange(x0, width, cell)
    ys = np.arange(y0, height, cell)
    xs = xs[np.abs(xs - x) <= radius]
    ys = ys[np.abs(ys - y) <= radius]
    if xs.size == 0 or ys.size == 0:
        return None
    d2 = (xs[None, :] - x) ** 2 + (ys[:, None] - y) ** 2
    good = (field[ys[:, None], xs[None, :]] >= limit) & (d2 <= radius * radius)
    rows, cols = np.nonzero(good)
    if rows.size == 0:
        return None
    order = np.argsort(d2[rows, cols], kind="stable")
    for n in order[:400]:
        px, py = int(xs[cols[n]]), int(ys[rows[n]])
        if _segment_clearance(field, x, y, px, py) >= floor:
            return (px, py)
    n = order[0]
    return (int(xs[cols[n]]), int(ys[rows[n]]))


def _route(field, x, y, gx, gy, limit):
    """Weighted route from (x, y) to (gx, gy) as an array of points, or None."""
    here = _clearance(field, x, y)
    floor = min(12.2, here - 0.1)
    start = _snap(field, x, y, limit, 40.0, floor, 0, 0, 1)
    if start is None:
        return None
    cell = GRID_CELL
    x0, y0 = start[0] % cell, start[1] % cell
    goal = _snap(field, gx, gy, limit, 17.0, 0.3, x0, y0, cell)
    if goal is None:
        return None
    masks = _step_masks(field >= limit, x0, y0, cell)
    lattice = field[y0::cell, x0::cell].astype(float)
    wide = np.clip((30.0 - lattice) / 18.0, 0.0, 1.0)
    tight = np.clip((16.5 - lattice) / 3.0, 0.0, 1.0)
    weights = (1.0 + 1.5 * wide * wide + 8.0 * tight * tight).ravel().tolist()
    chain = _astar(
        masks,
        weights,
        cell,
        ((start[0] - x0) // cell, (start[1] - y0) // cell),
        ((goal[0] - x0) // cell, (goal[1] - y0) // cell),
    )
    if not chain:
        return None
    points = [(x, y)]
    for c, r in chain:
        points.append((float(x0 + c * cell), float(y0 + r * cell)))
    near = math.hypot(points[-1][0] - gx, points[-1][1] - gy) < 3.0
    if near and _clearance(field, gx, gy) >= 12.8:
        points[-1] = (gx, gy)
    return np.array(points, dtype=float)


def _resample(points, spacing):
    """The polyline at equal distances of about `spacing`."""
    delta = np.diff(points, axis=0)
    s = np.concatenate(([0.0], np.cumsum(np.hypot(delta[:, 0], delta[:, 1]))))
    count = max(2, int(math.ceil(float(s[-1]) / spacing)) + 1)
    t = np.linspace(0.0, float(s[-1]), count)
    xs = np.interp(t, s, points[:, 0])
    ys = np.interp(t, s, points[:, 1])
    return np.stack((xs, ys), axis=1)


def _smooth(field, raw):
    """Elastic band: shorter and rounder, but never closer to a wall than needed."""
    points = _resample(raw, 4.0)
    if len(points) < 4:
        return points
    for _ in range(200):
        inner = points[1:-1]
        x, y = inner[:, 0], inner[:, 1]
        pull = 0.5 * (points[:-2] + points[2:]) - inner
        here = _sample(field, x, y)
        gx = 0.5 * (_sample(field, x + 1.0, y) - _sample(field, x - 1.0, y))
        gy = 0.5 * (_sample(field, x, y + 1.0) - _sample(field, x, y - 1.0))
        tangent = points[2:] - points[:-2]
        norm = np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-6)
        tx, ty = tangent[:, 0] / norm, tangent[:, 1] / norm
        along = gx * tx + gy * ty
        gain = 0.5 * np.clip((26.0 - here) / 14.0, 0.0, 1.0)
        push = np.stack((gain * (gx - along * tx), gain * (gy - along * ty)), axis=1)
        keep = np.minimum(here, 17.0) - 1e-6
        both = inner + 0.5 * pull + push
        only = inner + push
        both_ok = _sample(field, both[:, 0], both[:, 1]) >= keep
        only_ok = _sample(field, only[:, 0], only[:, 1]) >= keep
        moved = np.where(only_ok[:, None], only, inner)
        moved = np.where(both_ok[:, None], both, moved)
        points = np.concatenate((points[:1], moved, points[-1:]))
    return points


def _make_path(field, x, y, gx, gy):
    """Smooth path and its clearances, or (None, None)."""
    raw = None
    for limit in PLAN_LIMITS:
        raw = _route(field, x, y, gx, gy, limit)
        if raw is not None:
            break
    if raw is None:
        return None, None
    plain = _resample(raw, PATH_SPACING)
    smooth = _resample(_smooth(field, raw), PATH_SPACING)
    plain_clear = _sample(field, plain[:, 0], plain[:, 1])
    smooth_clear = _sample(field, smooth[:, 0], smooth[:, 1])
    skip = 15
    if len(plain) > skip + 2 and len(smooth) > skip + 2:
        worst = float(plain_clear[skip:].min())
        if float(smooth_clear[skip:].min()) < min(worst, 14.0) - 0.3:
            return plain, plain_clear
    return smooth, smooth_clear


# ----------------------------------------------------------------------------
# Control
# ----------------------------------------------------------------------------


def _load_map():
    """The map; the array file is quicker to read than the picture."""
    try:
        return sensors.load_occupancy("occupancy.npy")
    except (OSError, ValueError):
        return sensors.load_occupancy(MAP_IMG)


def _replan(state, x, y):
    gx, gy = state["goal"]
    path, clear = _make_path(state["field"], x, y, gx, gy)
    state["path"] = path
    state["path_clear"] = clear
    state["index"] = 0
    state["best"] = 0
    state["since"] = 0


def reset(obs):
    """Plans the path of an episode."""
    state = _STATE
    if "field" not in state:
        state["field"] = _clearance_field(_load_map())
    state["goal"] = (float(obs["goal"][0]), float(obs["goal"][1]))
    state["forced"] = 0
    state["side"] = 1.0
    state["replans"] = 0
    _replan(state, float(obs["pose"][0]), float(obs["pose"][1]))


def _wrap(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


def _clip(value, low, high):
    return max(low, min(high, value))


def _wheels(forward, turn):
    """Wheel fractions from a forward and a (positive = clockwise) turn fraction."""
    left = _clip(forward + turn, -1.0, 1.0)
    right = _clip(forward - turn, -1.0, 1.0)
    return (float(left), float(right))


def _is_safe(field, x, y, heading, forward, turn, floor):
    """Whether the arc of the next step (and a bit more) keeps its clearance."""
    t = np.array([0.25, 0.5, 0.75, 1.0, 1.25])
    angle = heading + 0.5 * turn * MAX_TURN * t
    reach = forward * STEP_PX * t
    xs, ys = x + reach * np.cos(angle), y + reach * np.sin(angle)
    return bool(_sample(field, xs, ys).min() >= floor)


def _drive(state, x, y, heading, alpha, forward, turn, side):
    """Slows the command down until it is safe; else turns in place."""
    field = state["field"]
    here = _clearance(field, x, y)
    floor = max(12.1, SAFE_CLEARANCE - 0.05 * state["replans"])
    if here < floor:
        floor = here - 0.0005
    for scale in (1.0, 0.6, 0.35, 0.15, 0.05):
        if _is_safe(field, x, y, heading, forward * scale, turn, floor):
            return _wheels(forward * scale, turn)
    if abs(alpha) > 0.05:
        return _wheels(0.0, _clip(alpha / MAX_TURN, -1.0, 1.0))
    return _wheels(0.0, 0.5 * side)


def _pick_target(state, x, y):
    """The farthest point of the path ahead that is safe to head for."""
    field, path, clear = state["field"], state["path"], state["path_clear"]
    last = len(path) - 1
    k = state["index"]
    far = min(k + max(2, int(LOOKAHEAD / PATH_SPACING)), last)
    lowest = np.minimum.accumulate(clear[k : far + 1])
    here = _clearance(field, x, y)
    for j in range(far, k + 1, -1):
        need = max(min(17.0, float(lowest[j - k]) - 0.4), 12.3)
        need = min(need, here - 0.1)
        tx, ty = float(path[j, 0]), float(path[j, 1])
        if _segment_clearance(field, x, y, tx, ty) >= need:
            return tx, ty
    j = min(k + 2, last)
    return float(path[j, 0]), float(path[j, 1])


def _advance(state, x, y):
    """Moves the index to the nearest path point; returns its distance."""
    path = state["path"]
    k = state["index"]
    low, high = max(0, k - 5), min(len(path), k + 16)
    part = path[low:high]
    d2 = (part[:, 0] - x) ** 2 + (part[:, 1] - y) ** 2
    n = int(np.argmin(d2))
    state["index"] = low + n
    if state["index"] > state["best"]:
        state["best"] = state["index"]
        state["since"] = 0
    else:
        state["since"] += 1
    return math.sqrt(float(d2[n]))


def _reactive(state, x, y, heading, front, side):
    """Without a path: towards the goal, away from walls."""
    gx, gy = state["goal"]
    alpha = _wrap(math.atan2(gy - y, gx - x) - heading)
    if front < 2.0 * ROBOT_RADIUS:
        return _wheels(0.0, 0.5 * side)
    if abs(alpha) > 0.5 and front > 4.0 * ROBOT_RADIUS:
        return _wheels(0.0, _clip(alpha / MAX_TURN, -1.0, 1.0))
    turn = _clip(0.3 * alpha / MAX_TURN, -0.3, 0.3)
    return _drive(state, x, y, heading, alpha, 0.3, turn, side)


def policy(obs):
    """One command (left, right) from one observation."""
    x, y, heading = float(obs["pose"][0]), float(obs["pose"][1]), float(obs["pose"][2])
    goal_x, goal_y = float(obs["goal"][0]), float(obs["goal"][1])
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(heading)):
        return (0.0, 0.0)
    state = _STATE
    if "goal" not in state:
        reset(obs)
    elif math.hypot(goal_x - state["goal"][0], goal_y - state["goal"][1]) > 1.0:
        reset(obs)

    front, side = SENSOR_RANGE_PX, 1.0
    if "ranges" in obs:
        ranges = [float(value) for value in obs["ranges"]]
        count = len(ranges)
        if count >= 3:
            front = min(ranges[count // 3 : count - count // 3])
            half = count // 2
            side = -1.0 if sum(ranges[:half]) > sum(ranges[count - half :]) else 1.0

    if state["path"] is None:
        return _reactive(state, x, y, heading, front, side)

    if state["forced"] > 0:
        state["forced"] -= 1
        if state["forced"] == 0 and state["replans"] < MAX_REPLANS:
            state["replans"] += 1
            _replan(state, x, y)
        return _wheels(0.0, 0.7 * state["side"])

    away = _advance(state, x, y)
    if away > 30.0 and state["replans"] < MAX_REPLANS:
        state["replans"] += 1
        _replan(state, x, y)
        if state["path"] is None:
            return _reactive(state, x, y, heading, front, side)
        _advance(state, x, y)
    if state["since"] > STUCK_STEPS:
        state["since"] = 0
        state["forced"] = 5
        state["side"] = side
        return _wheels(0.0, 0.7 * side)

    target_x, target_y = _pick_target(state, x, y)
    distance = math.hypot(target_x - x, target_y - y)
    if distance < 0.5:
        target_x, target_y = goal_x, goal_y
        distance = math.hypot(target_x - x, target_y - y)
    if distance < 0.01:
        return (0.0, 0.0)
    alpha = _wrap(math.atan2(target_y - y, target_x - x) - heading)

    k = state["index"]
    ahead = float(state["path_clear"][k : k + 18].min())
    ahead = min(ahead, _clearance(state["field"], x, y))
    limit = 0.2 if ahead < 16.5 else 0.45
    if abs(alpha) > limit:
        return _wheels(0.0, _clip(alpha / MAX_TURN, -1.0, 1.0))

    forward = float(np.interp(ahead, (12.5, 16.0, 24.0), (0.25, 0.5, 0.95)))
    forward = min(forward, 0.35 * distance / STEP_PX)
    if math.hypot(goal_x - x, goal_y - y) < SLOW_DIST:
        forward = min(forward, 0.6)
    if front < SLOW_DIST:
        forward = min(forward, max(0.3, 0.9 * front / SLOW_DIST))
    forward *= max(0.1, 1.0 - abs(alpha) / 0.5)
    turn = _clip(0.6 * alpha / MAX_TURN, -0.9, 0.9)
    forward = max(0.02, min(forward, 1.0 - abs(turn)))

    if front < STOP_DIST:
        if abs(alpha) > 0.05:
            return _wheels(0.0, _clip(alpha / MAX_TURN, -1.0, 1.0))
        return _wheels(0.0, 0.5 * side)
    return _drive(state, x, y, heading, alpha, forward, turn, side)


# ----------------------------------------------------------------------------
# Episode
# ----------------------------------------------------------------------------


def run_episode(env, max_steps):
    """Runs one episode and reports what the environment did."""
    obs, info = env.reset()
    reset(obs)
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    speeds = []
    collisions = int(info.get("collisions", 0)) if info else 0
    steps = 0
    terminated = False
    truncated = False
    while steps < max_steps and not terminated and not truncated:
        left, right = policy(obs)
        obs, reward, terminated, truncated, info = env.step((left, right))
        steps += 1
        applied_left = _clip(float(left), -1.0, 1.0)
        applied_right = _clip(float(right), -1.0, 1.0)
        speeds.append((applied_left + applied_right) / 2.0 * MAX_WHEEL_SPEED)
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        collisions = int(info.get("collisions", collisions))
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": collisions,
        "goal": goal,
        "dt": DT,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
