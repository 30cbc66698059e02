"""The command, what it writes, and where else its search is asked for."""

import json

import pytest

from benchmarks.margins import BREAKS_WHEN_LATE, CAREFUL, write_corridor
from tdac_agent.runs.falsification import read_falsification

SMALL = ("-n", 24, "--space", "delay,axle")


@pytest.fixture
def corridor(tmp_path):
    """A folder with a task and a controller that a late robot stops."""
    folder = write_corridor(tmp_path / "corridor")
    (folder / "controller.py").write_text(BREAKS_WHEN_LATE)
    return folder


def test_the_failure_is_told_drawn_and_played(corridor, done, rejected, tmp_path):
    out = tmp_path / "found"
    file = corridor / "controller.py"
    told = done("falsify", file, *SMALL, "--out", out)
    assert "survives, alone, delay 2 steps" in told
    assert "smallest failure found: delay 3 steps" in told
    assert "not a proof" in told
    assert {each.name for each in out.iterdir()} == {
        "falsify.json",
        "counterexample.png",
    }
    found = read_falsification(out)
    assert found.counterexample.deviation.delay == 3
    assert f"tdac play {file} --deviation delay=3" in told
    video = tmp_path / "late.gif"
    played = rejected("play", file, "--deviation", "delay=3", "--video", video)
    assert "out of time" in played
    assert video.stat().st_size > 1000
    assert "reached" in done("play", file, "--deviation", "delay=2", "--video", video)


@pytest.mark.slow
def test_json_has_the_record_alone(corridor, done):
    found = json.loads(done("falsify", corridor / "controller.py", *SMALL, "--json"))
    assert found["envelopes"][0]["counterexample"]["deviation"]["delay"] == 3
    assert found["episodes"] <= 24


def test_a_failure_without_a_deviation_is_exit_1(corridor, rejected):
    (corridor / "controller.py").write_text("def policy(obs):\n    return 0.0, 0.0\n")
    told = rejected("falsify", corridor / "controller.py", *SMALL)
    assert "fails without a deviation" in told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--space", ""], "no deviation to search"),
        (["--space", "dely"], "unknown deviation 'dely' (did you mean 'delay'?)"),
        (["--space", "delay=x"], "expected a number, got 'x'"),
        (["--space", "delay=-1"], "size of delay"),
        (["--space", "delay=0.3"], "expected 1 or more, got 0.3"),
        (["--space", "axle=1e-300"], "expected 0.0001 or more"),
        (["--out", "{file}"], "cannot write to"),
        (["--space", "delay,delay"], "given twice"),
        (["--task", "epuck", "--space", "range_bias"], "robots with ranges alone"),
        (["--set", "unknown", "--space", "start_x"], "single tasks alone"),
        (["--set", "lost", "--space", "pose_x"], "no pose is observed on lost"),
        (["--set", "unknown", "--worlds", 20], "256 episodes are too few"),
        (["--set", "unknown", "--split", "hidden"], "split"),
    ],
)
def test_mistakes_are_one_line(corridor, refused, tmp_path, words, told):
    file = tmp_path / "other.py"
    file.write_text(CAREFUL)
    words = [str(file) if word == "{file}" else word for word in words]
    assert told in refused("falsify", file, *words)


@pytest.mark.parametrize(
    ("deviation", "told"),
    [
        ("", "no deviation in ''"),
        ("delay", "expected delay=NUMBER"),
        ("delay=1.5", "expected a whole number"),
        ("slip=-0.1", "expected 0 or more"),
        ("axle=nan", "expected axle=NUMBER"),
        ("axle=-1", "expected at most 0.9, got -1"),
        ("wheel=1", "unknown deviation 'wheel'"),
        ("start_y=4", "no episode begins with this deviation: start (45, 120)"),
    ],
)
def test_a_wrong_deviation_is_one_line(corridor, refused, tmp_path, deviation, told):
    video = tmp_path / "x.gif"
    file = corridor / "controller.py"
    line = refused("play", file, "--deviation", deviation, "--video", video)
    assert told in line
    assert not video.exists()


@pytest.mark.slow
def test_verify_and_synth_search_at_the_end(good, done, tmp_path, tdac):
    told = done("verify", good / "controller.py", "--no-confirm", "--envelope", 16)
    assert "not a proof" in told
    code, out, _ = tdac(
        "verify", good / "controller.py", "--no-confirm", "--envelope", 16, "--json"
    )
    assert code == 0
    assert json.loads(out)["envelope"]["budget"] == 16
    run = tmp_path / "run"
    done("synth", good, "--no-confirm", "--out", run, "--envelope", 16)
    found = read_falsification(run)
    assert found.name == "small"
    page = tmp_path / "page.html"
    done("report", run, "--out", page)
    assert "How far it carries" in page.read_text()
