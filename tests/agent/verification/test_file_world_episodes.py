"""The judge on worlds from files: their own OT, grouped by their kind."""

import json

import cv2
import numpy as np
import pytest
import yaml

from tdac_agent.verification.verify_episodes import most_worlds, verify_episodes
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError

AHEAD = "def policy(obs):\n    return 0.25, 0.25\n"


@pytest.fixture
def barn(tmp_path):
    """A set of two open fields of 10 m, with given path lengths."""
    sides = [[x, y / 10] for x in (-4.5, 0.0) for y in range(96)]
    worlds = {
        name: {"cylinders": sides, "path_length": length}
        for name, length in (("short", 10.0), ("long", 16.0))
    }
    values = {"start": [-2.25, 3.0, 1.5708], "goal": [-2.25, 13.0]}
    values |= {"cylinder_radius": 0.075, "worlds": worlds}
    (tmp_path / "worlds.json").write_text(json.dumps(values))
    path = tmp_path / "barn.yaml"
    path.write_text(
        "worlds: {barn: worlds.json, splits: [test]}\n"
        "robot: {radius: 8, axle_length: 11, max_wheel_speed: 80}\n"
        "goal_tolerance: 40\n"
    )
    return load_set(path)


@pytest.mark.slow
def test_the_barn_score_takes_the_given_length(barn):
    """OT' is 5 s and 8 s; at a quarter of the speed, both drives take 18 s."""
    report = verify_episodes(AHEAD, barn, 2, split="test")
    assert report.successes == 2
    steps = [episode.steps for episode in report.episodes]
    assert steps == pytest.approx([180, 180], abs=1)
    scores = sorted(episode.barn_score for episode in report.episodes)
    assert scores == pytest.approx([50 / steps[0], 80 / steps[0]])
    assert set(report.by_generator) == {"barn"}


@pytest.mark.slow
def test_the_unit_of_an_interval_is_a_world(tmp_path, barn):
    """Ten runs on each of two worlds say what two worlds do, and no more."""
    path = tmp_path / "barn.yaml"
    again = path.read_text().replace("[test]}", "[test], runs: 10}")
    path.write_text(f"{again}disturbances: {{wheel_slip: 0.01}}\n")
    tasks = load_set(path)
    report = verify_episodes(AHEAD, tasks, 20, split="test")
    assert (report.count, report.successes) == (20, 20)
    assert report.interval.low == pytest.approx(0.158, abs=0.001)
    assert most_worlds(tasks, "test") == 2


def test_more_worlds_than_there_are(barn):
    """One line says how many there are."""
    with pytest.raises(TaskError, match="worlds 3: set 'barn' has 2 worlds in its"):
        verify_episodes(AHEAD, barn, 3, split="test")


@pytest.mark.slow
def test_a_folder_that_was_kept_back(tmp_path, monkeypatch):
    """Sums alone are told, and the ledger knows the worlds by their hash."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    task = {"file": "a.png", "start": [20, 40], "goal": [100, 40]}
    for name, wall in (("maps", 4), ("hidden", 6)):
        (tmp_path / name).mkdir()
        picture = np.zeros((80, 120), np.uint8)
        picture[wall:-wall, wall:-wall] = 255
        cv2.imwrite(str(tmp_path / name / "a.png"), picture)
        (tmp_path / name / "index.json").write_text(json.dumps([task]))
    path = tmp_path / "mine.yaml"
    worlds = {"folder": "maps", "splits": ["test"]}
    path.write_text(yaml.safe_dump({"worlds": worlds}))
    tasks = load_set(path, tmp_path / "hidden")
    report = verify_episodes(AHEAD, tasks, 1, split="hidden")
    assert (report.successes, report.episodes, report.told) == (1, (), ())
    assert report.provenance.salt_sha256 == tasks.files.hidden_sha256
    assert report.hidden.count == 1
    again = verify_episodes(AHEAD, tasks, 1, split="hidden")
    assert again.hidden.recorded is not None
    with pytest.raises(TaskError, match="has no split 'hidden'"):
        verify_episodes(AHEAD, load_set(path), 1, split="hidden")
