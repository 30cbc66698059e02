"""Policies on the same worlds of a set; what is kept, played, and refused."""

import json

import cv2
import pytest
import yaml
from script import AHEAD, STILL

from tdac_agent.builtin.level import LEVELS
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.evaluation.evaluate import evaluate
from tdac_agent.evaluation.evaluation_report import Evaluation
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError


@pytest.fixture
def files(tmp_path):
    """Controllers that do not arrive: one stands, one drives ahead, one is broken."""
    sources = {
        "still": STILL,
        "ahead": AHEAD,
        "broken": "def policy(obs):\n    return 1\n",
    }
    for name, source in sources.items():
        (tmp_path / f"{name}.py").write_text(source)
    return [str(tmp_path / f"{name}.py") for name in sources]


@pytest.mark.slow
def test_a_row_is_what_verify_says(warm, tmp_path, level, files):
    """Scores, generators and causes; a refused file has a row without figures."""
    tasks, out = load_set(level), tmp_path / "out"
    found = evaluate(files, [tasks], 4, split="dev", judge=warm, out=out)
    for file, row in zip(files[:2], found.rows, strict=False):
        alone = verify_episodes(file, tasks, 4, split="dev", judge=warm)
        assert row.scores == alone.scores
        assert row.by_generator == alone.by_generator
        assert row.causes == alone.causes
        assert row.interval == alone.interval
        assert sum(row.outcomes.values()) == 4
    still, ahead, broken = found.rows
    assert still.outcomes == {"out of time": 4}
    assert ahead.collided > 0
    assert (broken.scores, broken.episodes) == (None, 0)
    assert "two finite numbers" in broken.told[0]
    (pair,) = found.comparisons
    assert (pair.neither, pair.p) == (4, 1.0)
    assert len(found.to_frame()) == 8
    kept = json.loads((out / "evaluation.json").read_text())
    assert Evaluation.model_validate(kept).rows == found.rows
    folder = out / "policies" / "few"
    names = sorted(path.name for path in folder.iterdir())
    assert [name.split("-")[0] for name in names] == ["ahead", "broken", "still"]
    assert len(list((folder / names[0] / "trajectories").iterdir())) == 4


@pytest.mark.slow
def test_finished_policies_are_not_driven_again(warm, tmp_path, level, files):
    """After an interruption, and of a finished evaluation; another one is refused."""
    tasks, out, driven = load_set(level), tmp_path / "out", []

    def interrupt(_task, policy, episodes, successes):
        if policy == files[1]:
            raise KeyboardInterrupt

    def note(_task, policy, episodes, successes):
        if episodes:
            driven.append(policy)

    given = {"split": "dev", "episodes": 2, "judge": warm, "out": out}
    with pytest.raises(KeyboardInterrupt):
        evaluate(files[:2], [tasks], watch=interrupt, **given)
    first = evaluate(files[:2], [tasks], watch=note, **given)
    assert set(driven) == {files[1]}
    written = (out / "evaluation.json").read_bytes()
    driven.clear()
    assert evaluate(files[:2], [tasks], watch=note, **given) == first
    assert driven == []
    assert (out / "evaluation.json").read_bytes() == written
    with pytest.raises(RunError, match="it differs in policies"):
        evaluate(files[:1], [tasks], **given)


@pytest.mark.slow
def test_builtin_is_the_controller_of_the_level(warm, level):
    """A set with the observations of `unknown` has that of `unknown`."""
    given = {"split": "dev", "judge": warm}
    (row,) = evaluate(["builtin"], [load_set("known")], 2, **given).rows
    assert (row.knows, row.successes) == ("+ map", 2)
    own = verify_episodes(
        LEVELS / "known.py", load_set("known"), 2, split="dev", judge=warm
    )
    assert row.scores == own.scores
    (row,) = evaluate(["builtin"], [load_set(level)], 1, **given).rows
    assert row.knows == "sensors"


@pytest.mark.slow
def test_baselines_and_planners_drive_on_worlds_and_on_tasks(warm, level, small_task):
    """All that drives on a set drives on a task on a map, and the other way round."""
    words = ["reference", "go-to-goal", "random", "dwa", "follow-waypoints"]
    found = evaluate(words, [load_set(level), small_task], 2, judge=warm)
    knows = {row.policy: row.knows for row in found.of("few")}
    assert knows == {
        "reference": "privileged",
        "go-to-goal": "sensors",
        "random": "nothing",
        "dwa": "sensors",
        "follow-waypoints": "+ planner",
    }
    errors = [row.outcomes.get("error", 0) for row in found.rows]
    assert errors == [0] * 10
    reached = {row.policy: row.successes for row in found.of(small_task.name)}
    assert (reached["reference"], reached["dwa"], reached["random"]) == (2, 2, 0)
    assert {pair.task for pair in found.comparisons} == {"few", small_task.name}


@pytest.mark.parametrize(
    ("policies", "split", "message"),
    [
        (["follow-guidance"], "test", "follow-guidance does not drive on a task set"),
        (["builtin"], "hidden", "tdac verify FILE --set few --split hidden"),
        (["builtin"], "train", "expected split to be one of 'dev', 'test', 'hidden'"),
        ([], "test", "expected at least one policy"),
    ],
)
def test_what_is_refused(level, policies, split, message):
    with pytest.raises(TaskError, match=message):
        evaluate(policies, [load_set(level)], 1, split=split)


def test_a_level_without_a_controller_of_our_own(tmp_path):
    path = tmp_path / "blind.yaml"
    path.write_text(
        yaml.safe_dump(
            {"name": "blind", "worlds": [{"name": "rooms"}], "observed": ["ranges"]}
        )
    )
    with pytest.raises(TaskError, match="no built-in controller for the task set bli"):
        evaluate(["builtin"], [load_set(path)], 1)
    with pytest.raises(ControllerFileError, match=r"no policy 'no\.py'"):
        evaluate(["no.py"], [load_set(path)], 1)


@pytest.mark.slow
def test_the_command(tdac, done, level, files):
    """A table with scores, failures and generators; JSON with the same figures."""
    words = ("evaluate", *files, "--set", level, "--split", "dev", "-n", "4")
    words += ("--out", "out")
    out = done(*words)
    for said in ("worlds 0 to 3 of dev", "SCT", "BARN", "0/4", "aisles", "clutter"):
        assert said in out
    assert "still.py, failures: 4 " in out
    assert "broken.py, not driven: " in out
    record = json.loads(tdac(*words, "--json")[1])
    assert [row["successes"] for row in record["rows"]] == [0, 0, 0]


@pytest.mark.slow
def test_playing_a_world(rejected, done, level, files):
    """As a film; the exit code says whether the goal was reached."""
    words = ("--set", level, "--index", "1", "--video", "a.gif", "--speed", "20")
    out = rejected("play", files[0], *words)
    assert "wrote a.gif" in out
    assert "world 1: out of time after 40 steps" in out
    film = cv2.VideoCapture("a.gif")
    assert film.read()[0]
    out = done("play", "builtin", "--set", "known", *words[2:])
    assert "world 1: reached after" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("play", "--index", "1"), "--index needs --set NAME"),
        (
            ("play", "--set", "known", "--split", "hidden"),
            "hidden worlds are not shown",
        ),
        (("play", "--set", "known", "--seed", "1"), "leave out --seed"),
        (("play", "--set", "known", "--task", "maze"), "leave out --task"),
        (("evaluate", "--split", "dev"), "--split needs --set NAME"),
        (("evaluate", "--set", "known", "--map", "a.png"), "leave out --map"),
        (("evaluate", "--set", "known", "--split", "hidden"), "tdac verify FILE"),
        (("evaluate", "--set", "know"), "did you mean 'known'?"),
    ],
)
def test_mistakes_are_one_line(refused, words, message):
    video = ("--video", "a.gif") if words[0] == "play" else ()
    err = refused(words[0], "builtin", *words[1:], *video)
    assert message in err


def test_a_run_on_a_set_is_not_driven_on_tasks(tmp_path):
    """Its controller observes what the set says; another map would tell nothing."""
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "controller.py").write_text(STILL)
    (tmp_path / "run" / "set.yaml").write_text("name: few\n")
    told = r"run was written for a task set, .* --set .*run/set\.yaml"
    with pytest.raises(TaskError, match=told):
        evaluate([tmp_path / "run"], ["maze"], 1)
