"""What a race tells of drives: a table of losses, tracks, failures, the robot."""

import re
from dataclasses import replace

import numpy as np
import pytest
from driving import drive
from pool_drives import FIRST, candidate_of, row_of

from tdac_agent.synthesis.pool_feedback import (
    MOST_ROWS,
    PoolFeedback,
    mean_losses,
    trajectory_of,
)
from tdac_agent.tasks.units import PIXELS
from tdac_agent.verification.diagnosis.losses import Losses
from tdac_envs.map2d.env import Map2DEnv


def scene(number):
    raise AssertionError(f"{number} was not driven")


@pytest.fixture
def told():
    return PoolFeedback("world", FIRST, scene)


def cells_of(table):
    """The rows of a table, without those of the head."""
    lines = [line for line in table.splitlines() if line.startswith("|")]
    head, _, *rows = [
        [cell.strip() for cell in line[1:-1].split("|")] for line in lines
    ]
    return [dict(zip(head, row, strict=True)) for row in rows]


def test_the_means_are_the_means(told):
    """Also where only the worst episodes are shown; of others, in the common ones."""
    random = np.random.default_rng(1)
    scores = random.uniform(0.2, 1.0, 20).tolist()
    scores[3] = None
    one = candidate_of(1, *scores)
    other = candidate_of(2, *random.uniform(0.2, 1.0, 7))
    table = told.table(one, [other])
    *rows, means = cells_of(table)
    assert len(rows) == MOST_ROWS
    assert f"the {MOST_ROWS} worst of 20 are shown" in table
    assert [float(row["score"]) for row in rows] == sorted(
        round(row.time_score, 2) for row in one.pool
    )[:MOST_ROWS]
    assert means["world"] == "mean of 20"
    assert float(means["score"]) == pytest.approx(one.pool_score, abs=6e-4)
    for name, share in mean_losses(one.pool).items():
        whole = np.mean([row.lost.by_cause[name] for row in one.pool])
        assert float(means[name]) == pytest.approx(share, abs=6e-4)
        assert share == pytest.approx(whole)
    assert float(means["candidate 2"]) == pytest.approx(other.pool_score, abs=6e-4)
    known = {str(row.number - FIRST + 1): row.time_score for row in other.pool}
    for row in rows:
        said = row["candidate 2"]
        assert said == (f"{known[row['world']]:.2f}" if row["world"] in known else "")


def test_the_shares_of_a_row_are_what_its_score_lacks(told):
    """Of a failure, too, and of one in a record without losses."""
    one = candidate_of(1, 0.25, 0.5, None, 1.0)
    one.pool[2] = one.pool[2].model_copy(update={"lost": None})
    for row in cells_of(told.table(one, [])):
        shares = [float(row[name] or 0.0) for name in Losses().by_cause]
        assert sum(shares) == pytest.approx(1.0 - float(row["score"]), abs=0.011)
    assert cells_of(told.table(one, []))[0]["failure"] == "1.00"


def test_few_failures_are_told(told):
    """At most one of three, at least one, at most three; all are counted."""
    for failed, most in ((1, 1), (2, 1), (5, 1), (6, 2), (9, 3), (24, 3)):
        text = told.failures(candidate_of(1, 0.5, *[None] * failed))
        assert text.startswith(f"{failed} of {failed + 1} failed:")
        assert text.count("stuck for ever") == most
    assert told.failures(candidate_of(1, 0.5, 0.6)) == ""


def test_no_number_of_a_world_is_told(told):
    """Episodes are numbered from 1, in tables and in failures."""
    one = candidate_of(1, 0.3, None, None, None, 0.9)
    one.pool[1] = row_of(1, 0, text=f"world {FIRST + 1}: at world 3", outcome="stopped")
    text = "\n".join([told.table(one, [one]), told.failures(one), told.worst(one, [])])
    assert "- world 2: at world 3" in text
    assert not re.search(r"7000\d\d\d", text)
    assert {row["world"] for row in cells_of(told.table(one, []))[:-1]} == set("12345")


@pytest.fixture
def hall():
    """An empty hall, and drives in it."""
    cells = np.zeros((120, 200), np.bool_)
    cells[[0, -1]] = cells[:, [0, -1]] = True
    return Map2DEnv(cells, (20.0, 60.0, 0.0), (180.0, 60.0), robot_radius=6.0)


def driven(env, folder, k, wait):
    """A candidate that waits, and then drives ahead."""
    steps = iter([(0.0, 0.0)] * wait + [(1.0, 1.0)] * 1000)
    rollout = drive(env, lambda _: next(steps))
    found = candidate_of(k, 40.0 / rollout.trajectory.steps)
    facts = {"steps": rollout.trajectory.steps, "least_steps": 40.0}
    facts["seconds"] = rollout.trajectory.steps * rollout.trajectory.dt
    found.pool[0] = found.pool[0].model_copy(update=facts)
    (folder / "trajectories").mkdir(parents=True)
    rollout.trajectory.save(folder / "trajectories" / f"{FIRST}.npz")
    found.pool_folders.append(folder)
    return found


def test_the_worst_track_and_what_another_one_did(hall, tmp_path):
    """The one that waits is told where; the other one takes less time."""
    told = PoolFeedback("world", FIRST, lambda _: (hall.nominal, PIXELS))
    slow, fast = driven(hall, tmp_path / "a", 1, 30), driven(hall, tmp_path / "b", 2, 0)
    first, piece, other = told.worst(slow, [fast]).splitlines()
    seconds = slow.pool[0].seconds
    assert first == (
        f"world 1: score {slow.pool[0].time_score:.2f}, {seconds:.1f} s, least 2.0 s"
    )
    assert piece.startswith("- steps 0 to 30 (1.5 s): stood at (20.0, 60.0)")
    fast_seconds = fast.pool[0].seconds
    assert other == f"- candidate 2 takes {fast_seconds:.1f} s, on the same way"
    assert told.worst(fast, [slow]) == ""  # nothing was lost in a piece
    assert told.robot() == ""
    told.note(slow)
    assert "- a command acts in the same step" in told.robot()


def test_a_missing_or_broken_track_is_left_out(hall, tmp_path):
    """Of an episode that was not driven, or whose file is damaged."""
    told = PoolFeedback("world", FIRST, lambda _: (hall.nominal, PIXELS))
    one = driven(hall, tmp_path / "a", 1, 30)
    (row,) = one.pool
    assert trajectory_of(one, row).steps == row.steps
    assert trajectory_of(one, row.model_copy(update={"index": FIRST + 1})) is None
    path = tmp_path / "a" / "trajectories" / f"{FIRST}.npz"
    empty = replace(
        trajectory_of(one, row),
        poses=np.zeros((1, 3)),
        actions=np.zeros((0, 2), np.float32),
        path_distances=np.zeros(1),
        ranges=np.zeros((1, 3), np.float32),
    )
    empty.save(path)
    assert trajectory_of(one, row) is None
    path.write_bytes(b"no archive")
    assert trajectory_of(one, row) is None
    assert told.worst(one, []) == ""
    told.note(one)
    assert told.robot() == ""
