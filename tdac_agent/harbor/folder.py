"""Writes a task or a level as a task folder of Harbor."""

from __future__ import annotations

import json
import re
import secrets
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jinja2

from tdac_agent.errors import RunError
from tdac_agent.harbor.judge import SALT_FILE, TASK_FOLDER, WORLDS_FILE
from tdac_agent.harbor.wheel import pinned_versions, write_wheel
from tdac_agent.problems.choice import problem_of
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.synthesis.answers import Exam, files_of, reference_of
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.tasks.task_file import SET_FILE
from tdac_agent.verification.judge.set_files import write_set
from tdac_agent.verification.salt import SALT_BYTES
from tdac_agent.verification.verify import DEADLINE_SECONDS
from tdac_envs.ladder.task_sets import TaskSet

TEMPLATES = Path(__file__).with_name("templates")
WORLDS = 20
"""Hidden worlds on which a controller for a task set drives."""
ORGANISATION = "tdac"


def export_task(task: Task, out: Path) -> Path:
    """Writes a single task; its oracle is the learner `builtin`, tuned for it.

    Args:
        task: The task.
        out: A new or an empty folder.

    Returns:
        The folder.

    Raises:
        RunError: `out` is not an empty folder, the task has tests of its own, or it has
            no oracle.
    """
    _check_empty(out)
    if task.suite is not None:
        raise RunError(
            f"the task {task.name} has tests of its own, which a Harbor task cannot "
            "bring; leave out `suite`"
        )
    exam = Exam(problem_of(task))
    problem = exam.problem
    facts = {"task_sha256": problem.sha256, "suite_sha256": problem.suite_sha256}
    tests = _write_common(
        exam,
        out,
        {
            "package": _package(task.name),
            "description": f"Write a robot controller for the task {task.name}.",
            "verifier_seconds": DEADLINE_SECONDS + 300.0,
            "hidden": False,
        },
        facts,
    )
    lay_out(task, tests / TASK_FOLDER)
    return out


def export_set(tasks: TaskSet, out: Path, worlds: int = WORLDS) -> Path:
    """Writes a task set: hidden worlds, whose salt is drawn here.

    Args:
        tasks: The task set; its worlds are generated.
        out: A new or an empty folder.
        worlds: Number of worlds on which a controller drives.

    Returns:
        The folder.

    Raises:
        RunError: `out` is not an empty folder.
        TaskError: The set has worlds from files, or there is no oracle for it.
    """
    _check_empty(out)
    salt = secrets.token_bytes(SALT_BYTES)
    exam = Exam(problem_of(tasks), worlds)
    longest = episodes_of(tasks).limits.cpu_seconds * worlds
    tests = _write_common(
        exam,
        out,
        {
            "package": _package(tasks.name),
            "description": f"Write one robot controller for the level {tasks.name}, "
            "for worlds that nobody has seen.",
            "verifier_seconds": DEADLINE_SECONDS + float(longest),
            "hidden": True,
            "worlds": worlds,
        },
        {
            "set_sha256": tasks.sha256,
            "salt_sha256": sha256_of(salt),
            "worlds": worlds,
        },
    )
    write_set(tasks, tests / SET_FILE)
    write_atomic(tests / WORLDS_FILE, json.dumps(worlds) + "\n")
    write_atomic(tests / SALT_FILE, salt)
    (tests / SALT_FILE).chmod(0o600)
    return out


def _write_common(
    exam: Exam, out: Path, labels: dict[str, Any], facts: dict[str, Any]
) -> Path:
    """Writes all files but the problem itself; returns the folder of the tests."""
    question, solution = exam.question(), reference_of(exam.problem)
    environment, tests, oracle = (
        out / name for name in ("environment", "tests", "solution")
    )
    for folder in (environment / "files", tests, oracle):
        folder.mkdir(parents=True)
    wheel = write_wheel(tests)
    values = {
        **labels,
        "facts": {"tdac_version": version("tdac"), **facts},
        "question": question,
        "wheel": wheel.name,
        "python": f"{sys.version_info.major}.{sys.version_info.minor}",
        "numpy": version("numpy"),
    }
    rendered = {
        "task.toml.j2": out / "task.toml",
        "instruction.md.j2": out / "instruction.md",
        "agent.Dockerfile.j2": environment / "Dockerfile",
        "tests.Dockerfile.j2": tests / "Dockerfile",
        "test.sh": tests / "test.sh",
        "solve.sh": oracle / "solve.sh",
    }
    templates = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    for name, path in rendered.items():
        write_atomic(path, templates.get_template(name).render(values))
    for script in (tests / "test.sh", oracle / "solve.sh"):
        script.chmod(0o755)
    write_atomic(tests / "constraints.txt", pinned_versions())
    write_atomic(oracle / "controller.py", solution)
    for name, raw in files_of(exam.problem).items():
        write_atomic(environment / "files" / name, raw)
    return tests


def _check_empty(out: Path) -> None:
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RunError(f"{out} is not an empty folder; give a new or an empty one")


def _package(name: str) -> str:
    """A name as Harbor has them: `tdac/light_on_dark`."""
    short = re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-_") or "task"
    return f"{ORGANISATION}/{short}"
