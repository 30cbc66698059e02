"""`tdac synth --set`: one command, offline; prompts; mistakes in one line."""

import json
import shlex
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from few_worlds import STILL_ANSWER, write_set

SCRIPTED = Path(__file__).parents[1] / "scripted_model.py"


@pytest.mark.slow
def test_the_built_in_controller(tdac, tmp_path):
    """It is selected without a model; the report and the list show the run."""
    few = write_set(tmp_path / "few.yaml")
    words = ("synth", "--set", few, "--episodes", "4", "--feedback-episodes", "2")
    words += ("--seed", "1")
    code, out, err = tdac(*words, "--out", "run")
    assert (code, err) == (0, "")
    assert "the built-in controller of the level known" in out
    assert "selected, optimistic: 100.0 % reached" in out
    assert "not verified yet: tdac verify run/controller.py --set run/set.yaml" in out
    assert "4 of at most 4 episodes were driven" in out
    code, out, _ = tdac("synth", "--resume", "run")
    assert code == 0
    assert "has already finished" in out
    code, out, _ = tdac("verify", "run", "-n", "2")  # on its own task set
    assert code == 0
    assert out.split()[0] == "few"
    assert "2 reached, 0 failed" in out
    code, out, err = tdac("verify", "run", "--task", "maze", "--split", "dev")
    assert (code, out) == (2, "")
    assert "--split needs --set NAME" in err
    code, out, _ = tdac("runs", ".", "--json")
    (row,) = json.loads(out)
    assert (row["status"], row["go_on"]) == ("selected", "")
    code, out, _ = tdac("report", "run", "--out", "run.html")
    assert code == 0
    page = Path("run.html").read_text()
    assert "The selected controller" in page
    assert "the goal reached in 2 of 2 worlds" in page
    assert "Not readable" not in page
    code, out, _ = tdac("synth", "--set", few, "--episodes", "4", "--feedback-episodes",
                        "2", "--learner", "replay:run", "--json")  # fmt: skip
    assert code == 0
    assert json.loads(out)["status"] == "selected"


def test_a_program_as_a_model(tdac, tmp_path):
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
    code, out, _ = tdac(*words, "--episodes", "4", "--feedback-episodes", "2")
    assert code == 1
    assert "no controller was selected" in out
    assert (folder / "prompt-1.md").read_text() == printed


def test_a_level_without_a_built_in_controller(tdac, tmp_path):
    """One line; its prompt is printed all the same."""
    keys = ["goal", "wheel_speeds", "ranges", "odometry", "pose"]
    few = write_set(tmp_path / "few.yaml", observed=keys)
    code, out, err = tdac("synth", "--set", few)
    assert (code, out) == (2, "")
    assert "no built-in controller for the task set few" in err
    assert len(err.splitlines()) == 1
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
        (("--set", "known", "--prompt", "underspecified"), "is for a single task"),
        (("--set", "known", "--prompt", "none.j2"), "no prompt 'none.j2'"),
        (("--set", "known", "--learner", "nobody:x"), "unknown model"),
        (("--set", "known", "--tier", "none"), "tier"),
    ],
)
def test_mistakes_are_one_line(tdac, words, message):
    code, out, err = tdac("synth", *words)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert message in err


def test_worlds_in_files_are_too_few(tdac, tmp_path):
    """The prompt is printed, but no run begins."""
    cells = np.zeros((80, 120), np.uint8)
    cells[3:-3, 3:-3] = 255
    cv2.imwrite(str(tmp_path / "plan.png"), cells)
    entry = {"file": "plan.png", "start": [20, 40], "goal": [100, 40]}
    (tmp_path / "index.json").write_text(json.dumps([entry]))
    path = tmp_path / "mine.yaml"
    path.write_text("schema: 1\nname: mine\nworlds: {folder: .}\n")
    code, prompt, _ = tdac("synth", "--set", path, "--dry-run")
    assert code == 0
    assert "at most 120 px wide and high" in prompt
    code, _, err = tdac("synth", "--set", path, "--out", tmp_path / "run")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "the worlds of mine are in files" in err
    assert not (tmp_path / "run").exists()
