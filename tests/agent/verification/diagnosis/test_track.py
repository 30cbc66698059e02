"""The pieces of a track that lost most time, and where another one parts from it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.units import METRES, PIXELS
from tdac_agent.verification.diagnosis.track import (
    LEAST_LOST,
    MOST_PIECES,
    pieces_of,
    told_pieces,
    told_sibling,
)
from tdac_envs.map2d.env import Map2DEnv

STEP, TURN = 2.0, 0.4
FULL, SLOW, BACK = (STEP, 0.0), (STEP / 4, 0.0), (-STEP, 0.0)
STOP, SPIN = (0.0, 0.0), (0.0, TURN)


def track(moves, goal=(400.0, 0.0), start=(0.0, 0.0, 0.0)):
    """A drive by lengths and turns; nothing is in its way to the goal."""
    poses = [start]
    for length, turn in moves:
        x, y, heading = poses[-1]
        heading += turn
        poses.append(
            (x + length * np.cos(heading), y + length * np.sin(heading), heading)
        )
    count, places = len(moves), np.array(poses)
    return Trajectory(
        places,
        np.zeros((count, 2), np.float32),
        np.hypot(*(places[:, :2] - goal).T),
        np.zeros((count + 1, 1), np.float32),
        collisions=0,
        dt=0.05,
    )


def pieces(*moves):
    return pieces_of(track([each for part in moves for each in part]), STEP, TURN)


@pytest.mark.parametrize(
    ("moves", "kind", "lost"),
    [(STOP, "standing", 20.0), (SPIN, "turning", 20.0), (SLOW, "slower", 15.0)],
)
def test_a_piece(moves, kind, lost):
    """Where it begins and ends, and the steps that it lost."""
    (found,) = pieces([FULL] * 10, [moves] * 20, [FULL] * 10)
    assert found[:3] == (kind, 10, 30)
    assert found.lost == pytest.approx(lost)


def test_a_piece_may_be_interrupted():
    """By a few steps of another kind."""
    (found,) = pieces([FULL] * 5, [STOP] * 8, [FULL] * 3, [STOP] * 8, [FULL] * 5)
    assert found[:3] == ("standing", 5, 24)
    assert found.lost == pytest.approx(16.0)


def test_away_and_back():
    """It lasts until the way to the goal is as short again; idle steps belong to it."""
    (found,) = pieces([FULL] * 10, [BACK] * 20, [STOP] * 6, [FULL] * 40)
    assert found == ("detour", 10, 56, 46.0)
    (found,) = pieces([FULL] * 10, [BACK] * 20)
    assert found == ("detour", 10, 30, 20.0)


def test_a_stand_before_a_detour_is_no_part_of_it():
    """The detour begins when the way to the goal gets longer."""
    found = pieces([FULL] * 10, [STOP] * 12, [BACK] * 10, [FULL] * 30)
    assert [each[:3] for each in found] == [("standing", 10, 22), ("detour", 22, 42)]


def test_the_worst_pieces_in_order():
    """At most three, and none that lost next to nothing."""
    stands = [[*[FULL] * 10, *[STOP] * count] for count in (9, 30, 6, 20, 12)]
    found = pieces(*stands, [FULL] * 10)
    assert [round(each.lost) for each in found] == [30, 20, 12]
    assert [each.first for each in found] == sorted(each.first for each in found)
    assert len(found) == MOST_PIECES
    few = int(LEAST_LOST) - 1
    assert pieces([FULL] * 10, [STOP] * few, [FULL] * 10) == []
    assert pieces([FULL] * 50) == []


@pytest.fixture(scope="module")
def hall():
    """An empty hall with a step and a turn of the figures above."""
    cells = np.zeros((300, 460), np.bool_)
    cells[[0, -1]] = cells[:, [0, -1]] = True
    env = Map2DEnv(cells, (20.0, 150.0, 0.0), (440.0, 150.0), robot_radius=6.0)
    return env.nominal


def test_pieces_in_words(hall):
    """Steps, seconds, and places in the frame that is observed."""
    step, turn = hall.full_step, 2.0 * hall.full_step / hall.axle_length
    full, spin = (step, 0.0), (0.0, turn)
    around = round(2.0 * np.pi / turn)
    moves = [full] * 10 + [STOP] * 20 + [spin] * around + [full] * 10
    moves += [(step / 2, 0.0)] * 30 + [full] * 3
    trajectory = track(moves, (440.0, 150.0), (20.0, 150.0, 0.0))
    stood, turned, slow = told_pieces(trajectory, hall, PIXELS)
    x = 20.0 + 10 * step
    assert stood.startswith(f"steps 10 to 30 (1.0 s): stood at ({x:.1f}, 150.0)")
    assert re.search(r"turned on the spot by 3[4-9]\d° at ", turned)
    assert "drove at 50 % of full speed from " in slow
    assert stood.endswith("with no wall near")
    near = track([STOP] * 9, (440.0, 150.0), (20.0, 10.0, 0.0))
    (told,) = told_pieces(near, hall, PIXELS)
    assert re.search(r"with \d\.\d px between body and ", told)
    back = [full] * 10 + [(-step, 0.0)] * 8 + [full] * 20
    (told,) = told_pieces(track(back, (440.0, 150.0), (20.0, 150.0, 0.0)), hall, PIXELS)
    far = f"({20 + 2 * step:.1f}, 150.0)"
    assert told.endswith(
        f"away from the goal and back, from ({x:.1f}, 150.0) by way of {far}"
    )


@pytest.mark.parametrize("units", [PIXELS, METRES], ids=["px", "m"])
@pytest.mark.parametrize("heading", [0.0, 2.0, -1.2])
@pytest.mark.parametrize("side", ["left", "right"])
def test_where_another_track_parts(hall, crates, units, heading, side):
    """Right of its own heading, whether y points down or up in the frame."""
    task = hall if units is PIXELS else crates.nominal
    step, bend = task.full_step, 0.3 if side == "right" else -0.3
    bend = -bend if units.up else bend
    start = (task.start.x, task.start.y, heading)
    ahead = [(step, 0.0)] * 60
    own = track(ahead, task.goal, start)
    other = track([*ahead[:20], *[(step, bend)] * 4, *ahead[:36]], task.goal, start)
    text = told_sibling(own, other, task, units)
    place, told = re.fullmatch(
        r"on another way: it parts from this one at \((.*)\), to the (\w+)", text
    ).groups()
    assert told == side
    x, y = map(float, place.split(", "))
    along = np.hypot(x - start[0], y - start[1]) / step
    assert 18 < along < 40
    assert told_sibling(own, own, task, units) == "on the same way"
    late = replace(own, poses=np.repeat(own.poses, 2, axis=0)[:-1])
    assert told_sibling(own, late, task, units) == "on the same way"
