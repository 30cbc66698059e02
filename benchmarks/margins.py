"""Controllers that fail at a known deviation, in a corridor that is soon crossed."""

from pathlib import Path

import numpy as np
import yaml

RADIUS, GAP = 15, 2.5
LATE = 3
TURN = 0.12


def write_corridor(folder: Path, **changes) -> Path:
    """A corridor; a robot on the line y = 60 passes `GAP` px beside the lower wall."""
    folder.mkdir(parents=True, exist_ok=True)
    cells = np.zeros((130, 260), np.bool_)
    cells[:4] = cells[:, :4] = cells[:, -4:] = True
    # The edge of the pixels of row r is at r - 0.5.
    cells[int(60.5 + RADIUS + GAP) :, 90:170] = True
    cells[-4:] = True
    np.save(folder / "map.npy", cells)
    content = {
        "schema": 1,
        "map": "map.npy",
        "start": [45, 60, 0.0],
        "goal": [215, 60],
        "robot": {"radius": RADIUS},
        "name": "corridor",
        "horizon": 400,
    }
    (folder / "task.yaml").write_text(yaml.safe_dump(content | changes))
    return folder


_START = """\
import json
import math

with open("params.json") as file:
    ROBOT = json.load(file)["robot"]

calls, seen, late, lost = 0, None, None, False


def reset(obs):
    global calls, seen, late, lost
    calls, seen, late, lost = 0, None, None, False


def along(obs, line=60.0):
    x, y, heading = (float(v) for v in obs["pose"])
    aim = math.atan2(0.6 * (line - y), 30.0)
    error = math.remainder(aim - heading, math.tau)
    turn = max(-0.4, min(0.4, 1.2 * error))
    if abs(error) > 0.5:
        return turn, -turn
    # The wheels: y points down, a positive turn is to the right.
    return 0.6 + turn, 0.6 - turn
"""
CAREFUL = _START + "\n\ndef policy(obs):\n    return along(obs)\n"
"""Fails only where the line that it follows is not where it seems to be."""
BREAKS_WHEN_LATE = (
    _START
    + f"""

def policy(obs):
    global calls, late
    calls += 1
    if late is None and float(max(obs["wheel_speeds"])) > 0.02:
        late = calls - 2
    if (late or 0) >= {LATE}:
        return 0.0, 0.0
    return along(obs, 50.0)
"""
)
"""Stops if its first action took effect `LATE` steps late or more."""
KNOWS_ITS_AXLE = (
    _START
    + f"""

def policy(obs):
    global calls, seen, lost
    calls += 1
    heading = float(obs["pose"][2])
    if calls == 21:
        seen = heading
    if calls == 81:
        turned = (heading - seen) % math.tau
        told = 0.4 * ROBOT["max_wheel_speed"] * 0.05 * 60 / ROBOT["axle_length"]
        lost = abs(turned / told - 1.0) > {TURN}
    if calls < 81:
        return 0.2, -0.2
    return (0.0, 0.0) if lost else along(obs, 50.0)
"""
)
"""Turns on the spot first, and stops if it turned otherwise than its axle tells."""
