"""Export of a verified e-puck controller as a Webots project."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

from tdac_agent.environments.epuck.setting import WORLD_FILE
from tdac_agent.errors import RunError
from tdac_agent.runs.ownership import load_task, remark_on
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.printable_record import read_record
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.report import Report
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.worlds.wbt.writer import write_world

POLICY = "tdac_policy.py"
WORKING_FILES = ("params.json", "sensors.py", WORLD_FILE)
SPARE = 2
"""Steps of the adapter in addition to those of the controller."""
ADAPTER = Path(__file__).with_name("adapter.py")


@dataclass(frozen=True, slots=True)
class Project:
    """An exported project.

    Attributes:
        folder: Folder of the project.
        world: The `.wbt` file.
        controller: The file that Webots starts.
        tolerance: Distance at which the goal is reached, m.
        horizon: Maximum number of the controller's steps.
        verified_steps: Steps to the goal in the verification, if a report states them.
        remark: Why the verification is only a claim; empty for an own run.
    """

    folder: Path
    world: Path
    controller: Path
    tolerance: float
    horizon: int
    verified_steps: int | None
    remark: str = ""


def export_webots(run_folder: Path, out: Path) -> Project:
    """Writes a project: the world, and a controller folder with the verified file.

    Args:
        run_folder: Folder of a run with a verified controller for the e-puck.
        out: A new or an empty folder.

    Raises:
        RunError: There is no such run, or `out` is not an empty folder.
        TaskError: The run's task cannot be read.
    """
    run = load_run(run_folder)
    if not run.passed or run.status == "not verified":
        raise RunError(
            f"{run_folder} has no controller that passed ({run.status}); only such "
            "controllers can be exported"
        )
    task = load_task(run_folder)
    if not isinstance(task.nominal, EPuckTask):
        raise RunError(
            f"{run_folder} is a run of {task.spec.env}; only runs of "
            f"{EPuckTask.env_id} can be exported"
        )
    source = _read(run.controller)
    beside = {file: _read(run_folder / file) for file in WORKING_FILES}
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RunError(f"{out} is not an empty folder; give a new or an empty one")
    name = project_name(task.name)
    project = Project(
        out,
        out / "worlds" / f"{name}.wbt",
        out / "controllers" / name / f"{name}.py",
        task.nominal.goal_tolerance,
        task.nominal.horizon,
        _verified_steps(run_folder),
        remark_on(run),
    )
    folder = project.controller.parent
    for new in (folder, project.world.parent):
        new.mkdir(parents=True)
    write_atomic(folder / POLICY, source)
    for file, content in beside.items():
        write_atomic(folder / file, content)
    write_atomic(project.controller, ADAPTER.read_bytes())  # raw read: shipped
    write_atomic(project.world, _world(task.nominal, name))
    write_atomic(out / "README.md", _readme(task, name, source, project))
    return project


def project_name(task: str) -> str:
    """Returns the name of world and controller, which no Webots module has."""
    return "tdac_" + (re.sub(r"\W+", "_", task, flags=re.ASCII).strip("_") or "task")


def _world(task: EPuckTask, name: str) -> str:
    """Returns the verified world with this controller in its robot."""
    world = task.ground.world
    robot = replace(world.robot, controller=name)
    return write_world(
        replace(world, robots=(robot, *world.robots[1:])), supervisor=True
    )


def _read(path: Path) -> bytes:
    try:
        return read_file(path, RECORD_BYTES)
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}") from error


def _verified_steps(run_folder: Path) -> int | None:
    """Returns the steps of the nominal episode according to the run's report."""
    report = read_record(Report, run_folder, "report.json")
    episodes = () if report is None else report.episodes
    steps = [e.steps for e in episodes if e.name == "nominal"]
    return steps[0] if steps else None


def _readme(task: Task, name: str, source: bytes, project: Project) -> str:
    digest = sha256_of(source)
    steps = project.verified_steps
    verified = "" if steps is None else f"\nIt reached the goal there in {steps} steps."
    if project.remark:
        verified = "\nThis is only what the run claims, which is not known to be true."
    return f"""\
# {task.name}: an e-puck controller for Webots

**Not run in Webots itself.** The controller was verified in tdac's own model of this
world (`TDAC-EPuck-v0`).{verified}
In Webots the sensors have noise and detect a goal mark that stands up, wooden boxes are
darker than in the model, and the physics differs: watch the robot before you rely on
the controller.

- `worlds/{name}.wbt`: open it in Webots R2025a. The robot is a supervisor, so that it
  can read its own pose.
- `controllers/{name}/{name}.py`: the adapter.
  Webots starts it; the Python that Webots uses needs numpy.
- `controllers/{name}/{POLICY}`: the verified file, byte for byte.
  SHA-256 `{digest}`
- The other files in this folder are those that it was verified with.

Without Webots:

    tdac webots run controllers/{name}/{name}.py worlds/{name}.wbt \\
        --tolerance {project.tolerance:g} --steps {project.horizon + SPARE}
"""
