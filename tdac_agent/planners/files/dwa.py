"""Dynamic window approach on a grid with a navigation function.

D. Fox, W. Burgard and S. Thrun, "The dynamic window approach to collision avoidance",
IEEE Robotics & Automation Magazine 4(1), 1997, with a global plan as in ROS move_base
(E. Marder-Eppstein et al., "The office marathon", ICRA 2010; O. Brock and O. Khatib,
"High-speed navigation using the global dynamic window approach", ICRA 1999).

An obstacle layer holds the hits of the scans, marked and cleared, over the map if one
is given; what has not been seen counts as free. Dijkstra's costs of the way to the goal
over it are the navigation function. Of the velocities that are free for a while, the
one with the best sum of heading, clearance, velocity and progress is driven. The robot
has no inertia, so the dynamic window is the whole range of velocities. If it gets no
further, it clears the obstacle layer, turns on the spot, and keeps no margin for a
while. Without a pose, it is located by dead reckoning.
"""

HEADING = 0.3
"""Weight of the heading to the way-point after a step, as a share of half a turn."""
CLEARANCE = 0.1
"""Weight of the least clearance of a course, as a share of ROOM."""
VELOCITY = 0.05
"""Weight of the speed ahead, as a share of the full speed."""
PROGRESS = 1.0
"""Weight of the progress to the goal, as a share of that at full speed."""
SIM_TIME = 0.8
"""Length of a course, s."""
STOP_TIME = 0.5
"""Time for which a velocity must be free, s."""
MARGIN = 0.3
"""Room that a course keeps to obstacles, px."""
ROOM = 6.0
"""Clearance beyond the body from which obstacles cost nothing, px."""
INFLATION = 1.0
"""How much more the way costs beside an obstacle, as a factor."""
LOOKAHEAD = 12.0
"""Distance of the way-point along the planned way, px."""
MEMORY = 1000.0
"""Time after which a hit is forgotten, s; looked at after each plan."""

FREE = ROOM
NOISE = PARAMS["disturbances"]["range_noise"]
MARKED = min(RANGE - 1e-3, 1.0 / max(NOISE, 1e-9))
"""Ranges from here on mark nothing: there is no hit, or it is not known to a px."""
STUCK = 25
"""Steps within 3 px after which the robot recovers."""


def window():
    """Velocities (ahead in px/s, turn in rad/s) that the wheels can drive."""
    ahead = SPEED * np.linspace(0.0, 1.0, 10) ** 1.5
    turn = 2.0 * SPEED / AXLE * np.linspace(-1.0, 1.0, 25) ** 3
    ahead, turn = (part.ravel() for part in np.meshgrid(ahead, turn))
    fits = ahead + np.abs(turn) * AXLE / 2.0 < SPEED + 1e-6
    return ahead[fits], turn[fits]


AHEAD, TURN = window()
TIMES = np.linspace(0.0, SIM_TIME, math.ceil(SIM_TIME * SPEED / 1.5) + 1)[1:]
CHORDS = np.sinc(TURN[:, None] * TIMES / math.tau) * AHEAD[:, None] * TIMES
ALONG = CHORDS * np.cos(TURN[:, None] * TIMES / 2.0)
ASIDE = CHORDS * np.sin(TURN[:, None] * TIMES / 2.0)
NEXT = min(int(np.searchsorted(TIMES, DT)), len(TIMES) - 1)


def best_velocity(grid, pose):
    """The velocity (ahead, turn) whose objective is best."""
    cosine, sine = math.cos(pose.heading), math.sin(pose.heading)
    x = pose.x + cosine * ALONG - sine * ASIDE
    y = pose.y + sine * ALONG + cosine * ASIDE
    room = grid.clearance(x, y)
    here = grid.clearance(np.array([pose.x]), np.array([pose.y]))[0]
    margin = MARGIN if STATE["slim"] < 0 else 0.0
    least = min(RADIUS + margin, float(here) - 1e-3)
    there = np.hypot(x - grid.goal[0], y - grid.goal[1]) < PARAMS["goal_tolerance"]
    stops = (room < least) | there
    count = np.where(stops.any(axis=1), stops.argmax(axis=1), len(TIMES))
    rows = np.arange(len(AHEAD))
    done = there[rows, np.minimum(count, len(TIMES) - 1)]
    end = np.where(done, count, np.maximum(count - 1, 0))
    free = done | (count * TIMES[0] >= min(STOP_TIME, SIM_TIME) - 1e-9)
    before = np.arange(len(TIMES)) <= end[:, None]
    kept = np.where(before, room, np.inf).min(axis=1) - RADIUS
    a, b = grid.way_point(pose.x, pose.y, LOOKAHEAD)
    off = np.arctan2(b - y[:, NEXT], a - x[:, NEXT]) - pose.heading - TURN * DT
    off = np.abs(np.remainder(off + math.pi, math.tau) - math.pi)
    start = grid.to_go(np.array([pose.x]), np.array([pose.y]))
    progress = start - grid.to_go(x[rows, end], y[rows, end])
    objective = (
        HEADING * (1.0 - off / math.pi)
        + CLEARANCE * np.clip(kept / ROOM, 0.0, 1.0)
        + VELOCITY * AHEAD / SPEED
        + PROGRESS * np.clip(progress / (SPEED * SIM_TIME), -2.0, 2.0)
    )
    best = int(np.where(free | (AHEAD == 0.0), objective, -np.inf).argmax())
    return AHEAD[best], TURN[best]


def keep_no_margin():
    """Keeps no margin while the robot recovers, and somewhat longer."""
    STATE["slim"] = STATE["turns"] + STUCK


def reset(obs):
    """Begins an episode."""
    begin_on_grid(obs)
    STATE.update(slim=0, commands=[(0.0, 0.0)] * DELAY)


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    pose, grid, commands = STATE["pose"], STATE["grid"], STATE["commands"]
    pose.update(obs)
    STATE["time"] += DT
    ranges = np.asarray(obs["ranges"], float)[ORDER]
    there = scanner_at(pose)
    grid.scan(*there, pose.heading, ranges, ranges < MARKED, STATE["time"])
    later = pose.ahead(commands)
    grid.replan(later.x, later.y)
    turns = recovers(grid, pose, STUCK, keep_no_margin)
    STATE["slim"] -= 1
    if turns:
        left, right = 1.0, -1.0
    else:
        ahead, turn = best_velocity(grid, later)
        left = float(ahead + turn * AXLE / 2.0) / SPEED
        right = float(ahead - turn * AXLE / 2.0) / SPEED
    STATE["commands"] = [*commands, (left, right)][1:] if DELAY else []
    return left, right
