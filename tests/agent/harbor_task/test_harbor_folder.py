"""Task folders for Harbor: valid, solvable, and judged by the judge alone.

Without a container engine, `/` of the containers is a folder: `tests/`, `solution/`,
`app/` and `logs/` lie in it, as in the container.
"""

import json
import os
import shutil
import subprocess
import tomllib
import zipfile
from pathlib import Path

import pytest
from script import STILL
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.errors import RunError
from tdac_agent.harbor.folder import export_set, export_task
from tdac_agent.harbor.judge import exam_in, main
from tdac_agent.harbor.wheel import write_wheel
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import load_set

SCHEMA = Path(__file__).with_name("task_schema.json")
"""Harbor 0.26.0's own schema of `task.toml`: `harbor task schema`."""


@pytest.fixture(scope="module")
def unknown(tmp_path_factory):
    """The level `unknown`, with 2 worlds."""
    return export_set(load_set("unknown"), tmp_path_factory.mktemp("unknown"), 2)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A task of the user's own, which has the profile `policy`."""
    folder = tmp_path_factory.mktemp("small-source")
    task = load_task(write_small_task(folder, profile="policy"))
    return export_task(task, tmp_path_factory.mktemp("small"))


def container(root, folder):
    """What the verifier's container has, before the controller is put into it."""
    for name in ("app", "logs/verifier"):
        (root / name).mkdir(parents=True)
    for name in ("tests", "solution"):
        shutil.copytree(folder / name, root / name)
    return root


def judged(root, capfd):
    """The rewards, and what the judge says."""
    words = [root / "app/controller.py", root / "tests", root / "logs/verifier"]
    assert main([str(word) for word in words]) == 0
    rewards = json.loads((root / "logs/verifier/reward.json").read_text())
    return rewards, capfd.readouterr().out


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", ["unknown", "small"])
def test_the_folder_is_valid(name, request):
    """By Harbor's schema, without unknown fields, and with all files that it names."""
    jsonschema = pytest.importorskip("jsonschema")
    folder = request.getfixturevalue(name)
    schema = json.loads(SCHEMA.read_text())
    values = tomllib.loads((folder / "task.toml").read_text())
    jsonschema.validate(values, schema)
    parts = {"": values, "TaskConfig": values, "VerifierConfig": values["verifier"]}
    parts["EnvironmentConfig"] = values["verifier"]["environment"]
    for part, given in parts.items():
        known = schema if part in ("", "TaskConfig") else schema["$defs"][part]
        assert given.keys() <= known["properties"].keys()
    assert values["artifacts"] == ["/app/controller.py"]
    assert values["verifier"]["environment_mode"] == "separate"
    for file in ("instruction.md", "environment/Dockerfile", "tests/Dockerfile"):
        assert (folder / file).read_text().strip()
    for script in ("tests/test.sh", "solution/solve.sh"):
        assert os.access(folder / script, os.X_OK)


@pytest.mark.parametrize("name", ["unknown", "small"])
def test_harbor_accepts_the_folder(name, request):
    """Its own validation and its default lint rules, where Harbor is installed."""
    pytest.importorskip("harbor.lint", reason="Harbor needs Python 3.12")
    from harbor.lint import lint_task
    from harbor.lint.models import DEFAULT_RULES
    from harbor.models.task.task import Task

    folder = request.getfixturevalue(name)
    assert Task.is_valid_dir(folder)
    assert Task(folder).instruction
    assert lint_task(folder, selected_rules=DEFAULT_RULES) == []


def test_the_agent_sees_neither_salt_nor_solution(unknown):
    """They are in tests/ and solution/ only, which the agent's image does not have."""
    salt = (unknown / "tests/salt").read_bytes()
    assert len(salt) == 32
    oracle = (unknown / "solution/controller.py").read_bytes()
    seen = [unknown / "instruction.md", *(unknown / "environment").rglob("*")]
    for file in filter(Path.is_file, seen):
        assert salt not in file.read_bytes()
        assert salt.hex() not in file.read_text(errors="replace")
        assert oracle not in file.read_bytes()
    with zipfile.ZipFile(next((unknown / "tests").glob("*.whl"))) as wheel:
        assert all(salt not in wheel.read(name) for name in wheel.namelist())
    names = {file.name for file in (unknown / "environment/files").iterdir()}
    assert names == {"params.json"}


def test_two_exports_have_different_worlds(unknown, tmp_path):
    other = export_set(load_set("unknown"), tmp_path / "other", 2)
    assert (other / "tests/salt").read_bytes() != (unknown / "tests/salt").read_bytes()
    hidden = [exam_in(each / "tests") for each in (unknown, other)]
    assert {exam.split for exam in hidden} == {"hidden"}
    assert hidden[0].problem.sha256 == load_set("unknown").sha256


@pytest.mark.slow
def test_the_oracle_is_rewarded_and_others_are_not(small, tmp_path, capfd):
    """Also not no file, a link to the judge's files, a folder, or a huge file."""
    root = container(tmp_path, small)
    controller = root / "app/controller.py"
    subprocess.run([root / "solution/solve.sh"], check=True)
    rewards, said = judged(root, capfd)
    assert rewards == {"reward": 1.0, "verified": 1.0}
    assert said.startswith("all ")
    controller.write_text(STILL)
    rewards, said = judged(root, capfd)
    assert rewards["reward"] == 0.0
    assert "no motion" in said
    assert json.loads((root / "logs/verifier/report.json").read_text())["failures"]
    controller.unlink()
    assert judged(root, capfd)[1] == "there is no controller.py\n"
    controller.symlink_to(root / "tests/constraints.txt")
    rewards, said = judged(root, capfd)
    assert rewards["reward"] == 0.0
    assert said == "controller.py is not an ordinary file\n"
    controller.unlink()
    controller.write_bytes(b"#" * 2_000_000)
    assert judged(root, capfd)[0]["reward"] == 0.0


def test_a_broken_judge_gives_no_reward(small, tmp_path, capfd):
    """Neither pass nor fail: Harbor then reports an error of the trial."""
    root = container(tmp_path, small)
    (root / "app/controller.py").write_text(STILL)
    empty = tmp_path / "empty"
    empty.mkdir()
    words = [root / "app/controller.py", empty, root / "logs/verifier"]
    assert main([str(word) for word in words]) == 3
    assert "no verdict" in capfd.readouterr().err
    assert not list((root / "logs/verifier").iterdir())


@pytest.mark.slow
def test_a_folder_that_is_not_empty_is_refused(tmp_path):
    (tmp_path / "mine").touch()
    with pytest.raises(RunError, match="is not an empty folder"):
        export_set(load_set("unknown"), tmp_path)
    with pytest.raises(TaskError, match="are in files"):
        export_set(load_set("barn"), tmp_path / "barn")
    assert not (tmp_path / "barn").exists()


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("", "give a task with --task NAME, or a task set"),
        ("--task maze --set unknown", "leave out --task"),
        ("--task maze -n 3", "-n needs --set NAME"),
    ],
)
def test_the_command_says_what_is_missing(refused, words, why):
    err = refused("export", "harbor", "--out", "x", *words.split())
    assert why in err


def test_the_wheel_is_the_same_each_time(tmp_path):
    """It has the packages, their data, the configurations and the entry points."""
    made = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        made.append(write_wheel(tmp_path / name))
    assert made[0].read_bytes() == made[1].read_bytes()
    with zipfile.ZipFile(made[0]) as wheel:
        names = set(wheel.namelist())
    assert "tdac_agent/configs/offline.yaml" in names
    assert "tdac_envs/mapping/maps/maze.png" in names
    assert not any("__pycache__" in name for name in names)


@pytest.mark.slow
def test_the_scripts_work_with_the_wheel_of_the_folder(unknown, tmp_path):
    """`solve.sh`, then `test.sh`, with tdac installed from tests/ and nowhere else."""
    from installed import installation

    root = container(tmp_path / "root", unknown)
    python = installation(tmp_path / "venv", next((unknown / "tests").glob("*.whl")))
    env = {**os.environ, "PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}
    subprocess.run([root / "solution/solve.sh"], check=True, env=env)
    # A module in the working folder must not be imported by the judge.
    (root / "app/json.py").write_text("raise SystemExit('the agent was here')")
    done = subprocess.run(
        [root / "tests/test.sh"],
        check=True,
        env=env,
        cwd=root / "app",
        capture_output=True,
        text=True,
    )
    assert done.stdout == "the goal reached in 2 of 2 worlds\n"
    rewards = json.loads((root / "logs/verifier/reward.json").read_text())
    assert rewards["reward"] == rewards["success"] == 1.0
    assert 0.4 < rewards["time"] < 1.0
