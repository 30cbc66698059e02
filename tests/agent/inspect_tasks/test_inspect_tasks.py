"""tdac's tasks in Inspect: named, asked, judged for real, and recorded."""

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import anyio
import pytest
from installed import installation
from script import STILL

from tdac_agent.synthesis.answers import exam_of, files_of, reference_of
from tdac_agent.tasks.task_file import bundled_tasks
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.set_file import set_names

pytestmark = pytest.mark.skipif(find_spec("inspect_ai") is None, reason="no Inspect")
MOCK_EVAL = Path(__file__).with_name("mock_eval.py")
ROOT = Path(__file__).parents[3]


def answer(source):
    return f"Here it is.\n\n```python\n{source}```\n"


def reference(**about):
    return answer(reference_of(exam_of(about).problem))


def call(words, cwd, python=sys.executable):
    """The output of a Python process."""
    done = subprocess.run(
        [python, *map(str, words)],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env={**os.environ, "INSPECT_DISPLAY": "plain"},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def evaluated(folder, python=sys.executable, **request):
    """The log of an evaluation, as Inspect reads it from its file."""
    folder.mkdir(exist_ok=True)
    file, logs = folder / "request.json", folder / "logs"
    file.write_text(json.dumps(request))
    call([MOCK_EVAL, file, logs], folder, python)
    return log_in(logs)


def log_in(logs):
    from inspect_ai.log import list_eval_logs, read_eval_log  # slow to import

    [info] = list_eval_logs(str(logs))
    log = read_eval_log(info)
    assert log.status == "success", log.error
    return log


def scores(log):
    """Scores by epoch."""
    samples = sorted(log.samples, key=lambda sample: sample.epoch)
    [name] = {name for sample in samples for name in sample.scores}
    return [sample.scores[name] for sample in samples]


def metrics(log):
    return {
        (score.name, name): metric.value
        for score in log.results.scores
        for name, metric in score.metrics.items()
    }


@pytest.mark.slow
def test_a_reference_is_verified_and_others_are_not(tmp_path):
    """Score 1, 0, and 0 with the reason; the log opens in Inspect's reader."""
    answers = [reference(task="maze"), answer(STILL), "I would rather not."]
    log = evaluated(tmp_path, task="tdac_agent/tdac_maze", answers=answers)
    assert log.eval.task == "tdac_agent/tdac_maze"
    by_source = {score.answer: score for score in scores(log)}
    [good] = [s for source, s in by_source.items() if source and "plan_path" in source]
    assert good.value == 1.0
    assert good.explanation == "all 41 tests passed"
    still = by_source[STILL]
    assert still.value == 0.0
    assert "tests failed" in still.explanation
    assert "nominal: no motion" in still.explanation
    assert still.metadata["versions"]["tdac"]
    assert still.metadata["report"]["verdict"]["passed"] is False
    assert still.metadata["task_sha256"] == good.metadata["task_sha256"]
    none = by_source[None]
    assert none.value == 0.0
    assert none.reason == "invalid_response_format"
    assert "it has no fenced block" in none.explanation
    assert metrics(log)["passed", "accuracy"] == pytest.approx(1 / 3)


@pytest.mark.slow
def test_an_envelope_is_searched_for_what_passes(tmp_path):
    """The smallest failure stands in the explanation, the search in the metadata."""
    log = evaluated(
        tmp_path,
        task="tdac_agent/tdac_maze",
        args={"envelope": 16},
        answers=[reference(task="maze"), answer(STILL)],
    )
    good, still = sorted(scores(log), key=lambda score: -score.value)
    assert "survives" in good.explanation
    assert good.metadata["envelope"]["budget"] == 16
    assert "envelope" not in still.metadata


@pytest.mark.slow
def test_a_level_gives_the_share_of_worlds_and_the_time_score(tmp_path):
    """With their means over the answers, and the standard error over worlds."""
    answers = [reference(level="unknown", worlds=2, split="test"), answer(STILL)]
    log = evaluated(
        tmp_path,
        task="tdac_agent/tdac_unknown",
        args={"worlds": 2},
        answers=answers,
    )
    good, still = sorted(scores(log), key=lambda score: -score.value["success"])
    assert good.value["success"] == 1.0
    assert 0.4 < good.value["time"] < 1.0
    assert still.value == {"success": 0.0, "time": 0.0}
    assert "the goal reached in 0 of 2 worlds; 2 no motion" in still.explanation
    assert [e["index"] for e in good.metadata["report"]["episodes"]] == [0, 1]
    found = metrics(log)
    assert found["success", "mean"] == 0.5
    # A share of 0.5 of 2 worlds.
    assert found["success", "tdac_agent/stderr_of_worlds"] == pytest.approx(0.125**0.5)
    assert found["time", "mean"] == pytest.approx(good.value["time"] / 2)


@pytest.mark.slow
def test_hidden_worlds_tell_nothing_but_scores(tmp_path):
    """Their salt is a file, which is read before a model is asked."""
    salt = tmp_path / "salt"
    salt.write_bytes(bytes(range(32)))
    args = {"worlds": 2, "split": "hidden", "salt_file": "salt"}
    log = evaluated(
        tmp_path,
        task="tdac_agent/tdac_unknown",
        args=args,
        answers=[answer(STILL)],
    )
    [still] = scores(log)
    assert still.explanation == "the goal reached in 0 of 2 worlds; 2 no motion"
    assert still.metadata["report"]["episodes"] == []
    assert still.metadata["report"]["provenance"]["split"] == "hidden"
    assert bytes(range(32)).hex() not in log.model_dump_json()


@pytest.mark.slow
def test_a_model_repairs_what_the_feedback_names(tmp_path):
    """From no code to a verified controller, then it is asked no more."""
    answers = ["Wait.", answer(STILL), reference(task="maze"), "never asked"]
    log = evaluated(tmp_path, task="tdac_agent/tdac_maze", answers=answers, attempts=4)
    [sample] = log.samples
    [score] = scores(log)
    assert score.value == 1.0
    said = [message.text for message in sample.messages if message.role == "user"]
    assert len(said) == 3
    assert said[1].startswith("Your answer cannot be used: it has no fenced block")
    assert "nominal: no motion" in said[2]
    assert said[2].endswith("one fenced ```python block.")


@pytest.mark.slow
def test_feedback_on_a_level_is_not_from_the_judged_worlds(tmp_path):
    """It comes from 8 worlds of `dev`, as in `tdac synth`."""
    about = {"level": "unknown", "worlds": 2, "split": "test"}
    log = evaluated(
        tmp_path,
        task="tdac_agent/tdac_unknown",
        args={"worlds": 2},
        answers=[answer(STILL), reference(**about)],
        attempts=2,
    )
    [sample] = log.samples
    [score] = scores(log)
    assert "On 8 worlds that were new to it" in sample.messages[-2].text
    assert score.value["success"] == 1.0


def test_wrong_arguments_are_refused_before_a_model_is_asked():
    for wrong, why in (
        ({"worlds": 0}, "worlds to be a whole number from 1"),
        ({"split": "train"}, "expected split to be one of 'dev', 'test', 'hidden'"),
        ({"split": "hidden"}, "salt"),
    ):
        about = {"level": "unknown", "worlds": 2, "split": "test"} | wrong
        with pytest.raises(TaskError, match=why):
            exam_of(about)


def test_every_bundled_task_and_level_has_a_task():
    """`epuck` is both: the task has the name of its world, too."""
    from tdac_agent.inspect_tasks.registry import level_tasks, single_tasks

    singles, levels = single_tasks(), level_tasks()
    assert sorted(singles.values()) == sorted(bundled_tasks())
    assert tuple(levels.values()) == set_names()
    assert not singles.keys() & levels.keys()
    assert singles["tdac_maze"] == "maze"
    assert singles["tdac_epuck_arena"] == "epuck"
    assert levels["tdac_epuck"] == "epuck"


def test_names_in_inspect_begin_with_the_package():
    """Never with a folder, and never with nothing."""
    from inspect_ai.util import registry_info

    from tdac_agent.inspect_tasks import registry

    solvers = registry.repair, registry.tdac_builtin
    for made in (registry.passed, registry.driven, *solvers):
        assert registry_info(made).name == f"tdac_agent/{made.__name__}"


def test_a_cancelled_sample_ends_the_judges_work():
    """At once, not when the verification would have ended."""
    from tdac_agent.inspect_tasks.scoring import in_thread

    state, ended = SimpleNamespace(metadata={"task": "maze"}), []

    def judge(exam, poll):
        ended.append(exam.judge(STILL.encode(), poll))

    async def cancelled():
        with anyio.move_on_after(0.5) as scope:
            await in_thread(state, judge)
        return scope.cancelled_caught

    assert anyio.run(cancelled)
    assert not ended


def test_agents_find_the_working_folder_in_their_sandbox(tmp_path):
    """As files of the sample; Inspect copies them if there is a sandbox."""
    problem = exam_of({"task": "maze"}).problem
    assert {"params.json", "occupancy.npy", "sensors.py"} <= files_of(problem).keys()
    level = exam_of({"level": "unknown", "worlds": 2, "split": "test"}).problem
    assert list(files_of(level)) == ["params.json"]


@pytest.mark.slow
def test_tdac_alone_does_not_import_inspect():
    code = (
        "import sys, tdac_agent, tdac_agent.cli.main, tdac_agent.synthesis.answers;"
        "assert not [m for m in sys.modules if m.startswith('inspect_ai')]"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.slow
def test_the_command_line_finds_the_tasks_of_a_clone_and_of_a_wheel(tmp_path):
    """`inspect eval tdac_agent/tdac_maze`, from a folder without any of our files."""
    from tdac_agent.harbor.wheel import write_wheel

    wheel = write_wheel(tmp_path)
    installed = installation(tmp_path / "venv", wheel)
    for kind, python in {"clone": sys.executable, "wheel": installed}.items():
        work = tmp_path / kind
        work.mkdir()
        words = ["-m", "inspect_ai", "eval", "tdac_agent/tdac_maze", "--model"]
        words += ["mockllm/model", "--solver", "tdac_agent/tdac_builtin"]
        said = call([*words, "--log-dir", "logs"], work, python)
        assert "tdac_maze" in said
        log = log_in(work / "logs")
        assert log.eval.task == "tdac_agent/tdac_maze"
        assert metrics(log)["passed", "accuracy"] == 1.0
        where = call(
            ["-c", "import tdac_agent; print(tdac_agent.__file__)"], work, python
        )
        assert where.startswith(str(ROOT if kind == "clone" else tmp_path))
