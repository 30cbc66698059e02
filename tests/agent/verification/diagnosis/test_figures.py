"""A picture of each failed episode: what is on it, and where it is written."""

import math
import re

import cv2
import numpy as np
import pytest
from planted import PLANTS, fail
from script import AHEAD

from tdac_agent.episodes.episode import Record, run_policy
from tdac_agent.prompting.feedback import render_feedback
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.figures import event_of
from tdac_agent.verification.diagnosis.report import Episode, Report
from tdac_agent.verification.judge.drivers import ReferenceDriver
from tdac_agent.verification.verify import verify
from tdac_envs.drawing.backdrop import CLOSE_UP
from tdac_envs.drawing.canvas import TRAIL
from tdac_envs.drawing.closeup import COLUMN, EVENT, MARGIN, run_picture
from tdac_envs.map2d.run_picture import Background


def episode_of(rollout, **changes):
    """The figures of an episode as a report has them."""
    distances = rollout.trajectory.path_distances
    fields = {
        "name": rollout.name,
        "held_out": False,
        "outcome": rollout.outcome,
        "steps": rollout.trajectory.steps,
        "collisions": rollout.collisions,
        "d0": float(distances[0]),
        "d_min": float(distances.min()),
        "d0_euclidean": 0.0,
        "d_min_euclidean": 0.0,
        "progress_passed": False,
        "progress_passed_euclidean": False,
        "call_ms_mean": 0.0,
        "call_ms_p99": 0.0,
    }
    return Episode(**fields | changes)


def planted_event(fault):
    plant = next(plant for plant in PLANTS if plant.fault == fault)
    env, rollout = fail(plant)
    found = diagnose(rollout, env.nominal)
    event = event_of(env.nominal, rollout.trajectory, episode_of(rollout), found)
    return env.nominal, rollout.trajectory.poses, event


def near(picture, colour, tolerance=6):
    """Places (x, y) of the pixels that have nearly a colour."""
    rows, columns = np.nonzero(np.abs(picture - np.array(colour)).max(-1) <= tolerance)
    return np.column_stack([columns, rows])


def test_contact_on_map_and_close_up():
    """The contact is ringed where it happened, on the map and enlarged beside it."""
    task, poses, event = planted_event("drives straight on")
    background = Background.of(task)
    picture = run_picture(background, poses, event).astype(int)
    height, width = task.terrain.grid.cells.shape
    assert picture.shape == (height, width + COLUMN, 3)
    assert event.contact == pytest.approx((590.5, 100.0))
    ring = near(picture[90:111, 580:601], EVENT) + np.array([580, 90])
    assert len(ring) > 20
    assert ring.mean(axis=0) == pytest.approx(event.contact, abs=1.5)
    close = picture[:, width + MARGIN : width + MARGIN + CLOSE_UP]
    at = near(close, EVENT)
    frame = at[:, 1][np.bincount(at[:, 1])[at[:, 1]] > 0.9 * CLOSE_UP]
    top, bottom = int(frame.min()), int(frame.max())
    assert bottom - top == pytest.approx(CLOSE_UP, abs=2)
    inside = near(close[top + 4 : bottom - 3, 4:-4], EVENT) + 4
    # The close-up is 10 radii wide, with the robot in its middle and the wall right.
    scale = CLOSE_UP / 120
    offset = inside.mean(axis=0) - CLOSE_UP / 2
    assert offset == pytest.approx((12 * scale, 0.0), abs=scale)


def test_the_body_looks_where_it_went():
    """Its nose is drawn ahead of its centre, along the heading."""
    task, poses, event = planted_event("gives up after 120 steps")
    picture = run_picture(Background.of(task), poses, event).astype(int)
    x, y, heading = poses[-1]
    i, j = round(x), round(y)
    solid = near(picture[j - 9 : j + 10, i - 9 : i + 10], TRAIL, 2) - 9
    solid = solid[np.hypot(*solid.T) < 9]
    ahead = solid @ (math.cos(heading), math.sin(heading))
    beside = solid @ (-math.sin(heading), math.cos(heading))
    # An arrow head is widest at its back.
    assert np.abs(beside[ahead < -2]).max() > np.abs(beside[ahead > 4]).max()


@pytest.mark.slow
@pytest.mark.parametrize("number", range(0, len(PLANTS), 3))
def test_any_failure_can_be_drawn(number):
    """Caption in ASCII, picture as large as map and column, equal when drawn again."""
    task, poses, event = planted_event(PLANTS[number].fault)
    background = Background.of(task)
    before = background.canvas.image.copy()
    picture = run_picture(background, poses, event)
    assert picture.dtype == np.uint8
    assert picture.shape[1] == background.canvas.image.shape[1] + COLUMN
    assert picture.shape[0] >= background.canvas.strip_top
    assert (run_picture(background, poses, event) == picture).all()
    assert (background.canvas.image == before).all()
    assert all(line.isascii() for line in (event.title, *event.facts))
    assert PLANTS[number].cause in event.title


@pytest.mark.slow
def test_a_failed_verification_leaves_pictures(small_task, warm, good_source, tmp_path):
    """One for each failed episode; a later, passing one removes them."""
    report = verify(AHEAD, small_task, profile="policy", judge=warm, out=tmp_path)
    kept = sorted(path.name for path in (tmp_path / "trajectories").iterdir())
    assert kept == ["nominal.npz", "nominal.png"]
    picture = cv2.imread(str(tmp_path / "trajectories" / "nominal.png"))
    assert picture.shape == (600, 800 + COLUMN, 3)
    written = Report.model_validate_json((tmp_path / "report.json").read_text())
    assert written == report
    verify(good_source, small_task, profile="policy", judge=warm, out=tmp_path)
    endings = {path.suffix for path in (tmp_path / "trajectories").iterdir()}
    assert endings == {".npz"}


@pytest.mark.slow
def test_held_out_pictures_are_for_people_only(small_task, warm, tmp_path):
    """They show the outcome and the trail; nothing of them is in what a model gets."""
    source = recorded(small_task)
    report = verify(source, small_task, profile="policy", judge=warm, out=tmp_path)
    failed = [e for e in report.episodes if e.outcome != "reached"]
    held_out = [episode for episode in failed if episode.held_out]
    assert held_out, "a recorded drive fails from other starts"
    files = {path.stem for path in (tmp_path / "trajectories").glob("*.png")}
    assert files == {episode.name.replace(" ", "_") for episode in failed}
    text = render_feedback(report)
    assert not re.search(r"jitter [345]|\.png|trajectories", text)
    for failure in report.failures:
        assert failure.diagnosis.episode in (None, "jitter 1", "jitter 2")


def test_held_out_caption():
    """Without a diagnosis the caption is the outcome, the end and the path left."""
    env, rollout = fail(PLANTS[0])
    episode = episode_of(rollout, name="jitter 4", held_out=True)
    event = event_of(env.nominal, rollout.trajectory, episode, None)
    assert event.title == "jitter 4 (held out): collision"
    assert event.facts == (
        "ended in step 21 at (578.5, 100.0)",
        "grid path left: 945 of 945 px",
    )


def recorded(task):
    """A controller that plays the reference's actions back from the nominal start."""
    env = task.make_env()
    record = Record(env, task.nominal.start, task.nominal.horizon)
    driver = ReferenceDriver(env)
    rollout = run_policy(driver, record, "x", held_out=False, deadline=math.inf)
    assert rollout.reached
    actions = [tuple(row) for row in rollout.trajectory.actions.tolist()]
    return (
        f"ACTIONS = {actions!r}\nn = -1\n\n\ndef policy(obs):\n    global n\n"
        "    n += 1\n    return ACTIONS[n] if n < len(ACTIONS) else (1.0, 1.0)\n"
    )


@pytest.mark.slow
def test_verify_out(rejected, tmp_path):
    """The command says where the report and each picture are."""
    (tmp_path / "controller.py").write_text(AHEAD)
    folder = tmp_path / "seen"
    out = rejected(
        "verify", tmp_path / "controller.py", "--task", "rooms", "--profile",
        "policy", "--out", folder,
    )  # fmt: skip
    assert f"picture: {folder}/trajectories/nominal.png" in out
    assert f"report: {folder}/report.json" in out
    assert (folder / "trajectories" / "nominal.png").is_file()


def test_verify_out_that_cannot_be_written(refused, tmp_path):
    """One clear line, before anything is run."""
    (tmp_path / "controller.py").write_text(AHEAD)
    err = refused(
        "verify", tmp_path / "controller.py", "--out", tmp_path / "controller.py"
    )
    assert err.splitlines()[-1].startswith("error: cannot write to ")
