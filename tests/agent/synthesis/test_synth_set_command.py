"""`tdac synth --set`: one command, offline; prompts; mistakes in one line."""

import json
import shlex
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from few_worlds import STILL_ANSWER, write_set
from without_marks import unmarked

SCRIPTED = Path(__file__).parents[1] / "scripted_model.py"


@pytest.mark.slow
def test_the_built_in_controller(tdac, done, refused, tmp_path):
    """It is selected without a model; the report and the list show the run."""
    few = write_set(tmp_path / "few.yaml")
    words = ("synth", "--set", few, "--episodes", "4", "--feedback-episodes", "2")
    words += ("--search", "paper")
    code, out, err = tdac(*words, "--seed", "1", "--out", "run")
    assert (code, err) == (0, "")
    assert "the built-in controller of the level known" in out
    assert "selected, optimistic: 100.0 % reached" in out
    assert "not verified yet: tdac verify run/controller.py --set run/set.yaml" in out
    assert "4 of at most 4 episodes were driven" in out
    out = done("synth", "--resume", "run")
    assert "has already finished" in out
    out = done("verify", "run", "-n", "2")  # on its own task set
    assert out.split()[0] == "few"
    assert "2 reached, 0 failed" in out
    err = refused("verify", "run", "--task", "maze", "--split", "dev")
    assert "--split needs --set NAME" in err
    code, out, _ = tdac("runs", ".", "--json")
    (row,) = json.loads(out)
    assert (row["status"], row["go_on"]) == ("selected", "")
    out = done("report", "run", "--out", "run.html")
    page = unmarked(Path("run.html").read_text())
    assert "The selected controller" in page
    assert "the goal reached in 2 of 2 worlds" in page
    assert "Not readable" not in page
    out = done(*words, "--learner", "replay:run", "--json")
    assert json.loads(out)["status"] == "selected"


@pytest.mark.slow
def test_a_program_as_a_model(tdac, rejected, tmp_path):
    """It gets the printed prompt; a controller that never moves is not selected."""
    few = write_set(tmp_path / "few.yaml")
    folder = tmp_path / "answers"
    folder.mkdir()
    (folder / "reply-1.md").write_text(STILL_ANSWER)
    learner = "command:" + shlex.join([sys.executable, str(SCRIPTED), str(folder)])
    words = ("synth", "--set", few, "--learner", learner)
    code, printed, err = tdac(*words, "--dry-run")
    assert code == 0
    assert "cost of command" in err
    out = rejected(*words, "--episodes", "4", "--search", "paper")
    assert "no controller was selected" in out
    assert (folder / "prompt-1.md").read_text() == printed


def test_a_level_without_a_built_in_controller(tdac, refused, tmp_path):
    """One line; its prompt is printed all the same."""
    keys = ["goal", "wheel_speeds", "ranges", "odometry", "pose"]
    few = write_set(tmp_path / "few.yaml", observed=keys)
    err = refused("synth", "--set", few)
    assert "no built-in controller for the task set few" in err
    code, out, err = tdac("synth", "--set", few, "--dry-run")
    assert code == 0
    assert "`odometry`" in out
    assert "still needed: no built-in controller" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--episodes", "8"), "--episodes needs --set NAME"),
        (("--feedback-episodes", "4"), "--feedback-episodes needs --set NAME"),
        (("--then-verify",), "--then-verify needs --set NAME"),
        (("--set", "knwn"), "did you mean 'known'?"),
        (("--set", "known", "--task", "maze"), "leave out --task"),
        (("--set", "known", "--instructions", "x"), "leave out --instructions"),
        (("--set", "known", "--suite", "x"), "no suite 'x': no such folder"),
        (("--set", "known", "--episodes", "1"), "'--episodes'"),
        (("--set", "known", "--feedback-episodes", "0"), "'--feedback-episodes'"),
        (("--set", "known", "--prompt", "none.j2"), "no prompt 'none.j2'"),
        (("--set", "known", "--learner", "nobody:x"), "unknown model"),
        (("--set", "known", "--tier", "none"), "tier"),
    ],
)
def test_mistakes_are_one_line(refused, words, message):
    err = refused("synth", *words)
    assert message in err


def test_worlds_in_files_are_too_few(done, refused, tmp_path):
    """The prompt is printed, but no run begins."""
    cells = np.zeros((80, 120), np.uint8)
    cells[3:-3, 3:-3] = 255
    cv2.imwrite(str(tmp_path / "plan.png"), cells)
    entry = {"file": "plan.png", "start": [20, 40], "goal": [100, 40]}
    (tmp_path / "index.json").write_text(json.dumps([entry]))
    path = tmp_path / "mine.yaml"
    path.write_text("schema: 1\nname: mine\nworlds: {folder: .}\n")
    prompt = done("synth", "--set", path, "--dry-run")
    assert "at most 120 px wide and high" in prompt
    err = refused("synth", "--set", path, "--out", tmp_path / "run")
    assert "the worlds of mine are in files" in err
    assert not (tmp_path / "run").exists()
