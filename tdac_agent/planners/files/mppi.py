"""Model predictive path integral control on a grid with a navigation function.

G. Williams, A. Aldrich and E. A. Theodorou, "Model predictive path integral control:
from theory to parallel computation", Journal of Guidance, Control, and Dynamics 40(2),
2017, with a global plan as in ROS move_base (E. Marder-Eppstein et al., "The office
marathon", ICRA 2010).

An obstacle layer holds the hits of the scans, marked and cleared, over the map if one
is given; what has not been seen counts as free. Dijkstra's costs of the way to the goal
over it are the navigation function. In each step, noise is added to the last sequence
of commands; the new one is the mean of all samples, weighted by the exponential of
their costs: way that is left, walls that are near, contacts. If the robot gets no
further, it clears the obstacle layer and turns on the spot. It drives backwards only if
it sees all around or has a map. Without a pose, it is located by dead reckoning.
"""

NOISE_AHEAD = 0.4
"""Standard deviation of the noise of the speed ahead, as a share of the full speed."""
NOISE_TURN = 0.3
"""Standard deviation of the noise of the turn, as a share of the full turn."""
TEMPERATURE = 1.0
"""Difference of costs for which the weight of a sample is less by a factor of e, px."""
STAGE = 1.0
"""Weight of the mean way that is left during a sample; that at its end weighs 1."""
WALL = 10.0
"""Cost of driving beside a wall, px."""
CONTACT = 1000.0
"""Cost of touching an obstacle from the first step on, px."""
MARGIN = 0.3
"""Room that a sample keeps to obstacles, px."""
ROOM = 6.0
"""Clearance beyond the body from which obstacles cost nothing, px."""
INFLATION = 1.0
"""How much more the way costs beside an obstacle, as a factor."""
MEMORY = 1000.0
"""Time after which a hit is forgotten, s; looked at after each plan."""

SAMPLES = 128
"""Sequences of commands that are tried out in a step."""
STEPS = 12
"""Steps of a sequence."""
HOLD = 3
"""Steps for which a random number stays the same."""
SHARE = 16
"""Samples around standing still instead of the last sequence."""
FREE = ROOM
STUCK = 25
"""Steps within 3 px after which the robot recovers."""

SEES = PARAMS["map"] or math.degrees(VIEW) > 300.0  # also behind
LEAST = -math.inf if SEES else 0.0  # speed ahead, as a share


def sampled(nominal):
    """Sequences of (ahead, turn) as shares around the last one: SAMPLES x STEPS x 2."""
    blocks = -(-STEPS // HOLD)
    noise = STATE["rng"].standard_normal((SAMPLES, blocks, 2))
    noise = np.repeat(noise, HOLD, axis=1)[:, :STEPS] * (NOISE_AHEAD, NOISE_TURN)
    noise[0] = 0.0  # the last sequence itself
    noise[:-SHARE] += nominal
    ahead = np.maximum(noise[..., 0], LEAST)
    left = np.clip(ahead + noise[..., 1], -1.0, 1.0)
    right = np.clip(ahead - noise[..., 1], -1.0, 1.0)
    return np.stack([left + right, left - right], axis=2) / 2.0


def costs(grid, pose, sequences):
    """Costs of sequences, px."""
    turns = sequences[..., 1] * (2.0 * SPEED * DT / AXLE)
    heading = pose.heading + np.cumsum(turns, axis=1) - turns / 2.0
    length = sequences[..., 0] * SPEED * DT
    dx, dy = length * np.cos(heading), length * np.sin(heading)
    x, y = pose.x + np.cumsum(dx, axis=1), pose.y + np.cumsum(dy, axis=1)
    here = grid.clearance(np.array([pose.x]), np.array([pose.y]))[0]
    least = min(RADIUS + MARGIN, float(here) - 1e-3)
    room = np.minimum(grid.clearance(x, y), grid.clearance(x - dx / 2.0, y - dy / 2.0))
    there = np.hypot(x - grid.goal[0], y - grid.goal[1]) < PARAMS["goal_tolerance"]
    there = np.logical_or.accumulate(there, axis=1)
    contact = np.logical_or.accumulate((room < least) & ~there, axis=1)
    left = np.where(there, 0.0, grid.to_go(x, y))
    wall = np.where(there, 0.0, np.clip(1.0 - (room - RADIUS) / ROOM, 0.0, 1.0) ** 2)
    return (
        left[:, -1]
        + STAGE * left.mean(axis=1)
        + WALL * wall.mean(axis=1)
        + CONTACT * contact.mean(axis=1)
    )


def next_command(grid, pose):
    """The next command (ahead, turn), as shares; renews the sequence."""
    sequences = sampled(STATE["nominal"])
    cost = costs(grid, pose, sequences)
    weights = np.exp(-(cost - cost.min()) / TEMPERATURE)
    mean = np.tensordot(weights / weights.sum(), sequences, axes=1)
    STATE["nominal"] = np.vstack([mean[1:], mean[-1:]])
    return float(mean[0, 0]), float(mean[0, 1])


def forget_sequence():
    """Begins again with standing still."""
    STATE["nominal"] = np.zeros((STEPS, 2))


def reset(obs):
    """Begins an episode."""
    begin_on_grid(obs)
    STATE.update(commands=[(0.0, 0.0)] * DELAY)
    STATE.update(nominal=np.zeros((STEPS, 2)), rng=np.random.default_rng(1))


def policy(obs):
    """The fractions of the wheels' full speed, left and right."""
    pose, grid, commands = STATE["pose"], STATE["grid"], STATE["commands"]
    pose.update(obs)
    STATE["time"] += DT
    ranges = np.asarray(obs["ranges"], float)[ORDER]
    hit = ranges < RANGE - 1e-3
    grid.scan(*scanner_at(pose), pose.heading, ranges, hit, STATE["time"])
    later = pose.ahead(commands)
    grid.replan(later.x, later.y)
    if recovers(grid, pose, STUCK, forget_sequence):
        left, right = 1.0, -1.0
    else:
        ahead, turn = next_command(grid, later)
        left, right = ahead + turn, ahead - turn
    STATE["commands"] = [*commands, (left, right)][1:] if DELAY else []
    return left, right
