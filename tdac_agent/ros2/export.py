"""Export of a verified controller as a ROS 2 package (ament_python)."""

from __future__ import annotations

import json
import keyword
import math
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import jinja2

from tdac_agent.environments.map2d.setting import Map2DSetting
from tdac_agent.errors import RunError
from tdac_agent.ros2.package.settings import (
    PERIODS,
    Settings,
)
from tdac_agent.ros2.package.worker import SUMS, sums_of
from tdac_agent.ros2.package_text import RosPackage, values_of
from tdac_agent.runs.ownership import load_task, remark_on
from tdac_agent.runs.run_record import Run, load_run
from tdac_agent.storage.files import read_inside, write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.installation import keyed, lasting_secret
from tdac_agent.tasks.task import Task, write_workdir
from tdac_agent.tasks.trust import tree_sha256
from tdac_agent.verification.confirmation import read_confirmation
from tdac_agent.verification.verdict import verified_text
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES
from tdac_envs.mapping.ros_rule import SAVED_UNKNOWN
from tdac_envs.mapping.ros_writer import write_ros_map

PACKAGE = Path(__file__).parent / "package"
COPIED = (
    *("core.py", "settings.py", "motion.py", "scans.py"),
    *("localisation.py", "worker.py", "ending.py"),
    *("running.py", "node.py", "watchdog.py"),
)
"""Modules of the package, byte for byte those of this one."""
CONTROLLER = "controller"
"""Folder of the package with what the controller reads."""
SETTINGS = "settings.json"
MARK = "tdac.mark"
UNVERIFIED = "The controller is not verified."
FOLDERS = "controller", "config", "launch", "maps", "resource", "rviz", "test"
"""Folders of a package beside that of its modules."""


def export_ros2(
    run_folder: Path, out: Path, *, name: str | None = None, unverified: bool = False
) -> RosPackage:
    """Writes a package with the controller of a run on a map with metres.

    Args:
        run_folder: Folder of the run.
        out: A new or an empty folder.
        name: Name of the package; by default it follows from the task.
        unverified: Whether a controller may be exported that is not verified.

    Raises:
        RunError: There is no such run, its controller is not verified, or `out` is not
            an empty folder.
        TaskError: The task is not one that a robot can drive.
    """
    run, task = load_run(run_folder), load_task(run_folder)
    settings = settings_of(task)
    if run.tau is None or not run.controller.is_file():
        raise RunError(f"{run_folder} has no controller that passed ({run.status})")
    verdict, why, gap = _verdict(run)
    is_verified = bool(verdict)
    if not is_verified and not unverified:
        raise RunError(f"{why}; give --unverified to export it all the same")
    own = _core_settings(settings)
    package = package_name(task.name) if name is None else _checked(name)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RunError(f"{out} is not an empty folder; give a new or an empty one")
    source = read_inside(run_folder, "controller.py", RECORD_BYTES)
    settings.update(
        {
            "package": package,
            "controller_sha256": sha256_of(source),
            "verified": is_verified,
            "verdict": verdict or UNVERIFIED,
        }
    )
    made = RosPackage(
        out,
        package,
        is_verified,
        verdict or UNVERIFIED,
        own.stops_within(),
        settings["unknown"],
        None if gap is None else _down(settings["robot"]["radius"] * (1.0 + gap)),
    )
    existed = out.exists()
    try:
        _write(made, task, settings, source)
    except BaseException:
        if not existed:
            shutil.rmtree(out, ignore_errors=True)
        raise
    return made


def settings_of(task: Task) -> dict[str, Any]:
    """What the node must know of a task: `controller/settings.json`, in metres.

    Raises:
        TaskError: The task has no metres, or its robot cannot be driven safely.
    """
    setting = task.setting
    if not isinstance(setting, Map2DSetting):
        raise TaskError(
            f"{task.name} is a task of {task.spec.env}: only robots on maps drive over "
            "ROS 2; for an e-puck: tdac export webots"
        )
    if setting.view is None:
        raise TaskError(
            f"{task.name} is a task in pixels, which is not for ROS 2: robots "
            "drive in metres; synthesize again on a map with a resolution (map.yaml) "
            "without --frame pixels, or with frame: metres in task.yaml"
        )
    grid = setting.nominal.terrain.grid
    written, ends = setting.portable()["robot"], setting.ends()
    robot = setting.nominal.robot
    written = {key: each for key, each in written.items() if key != "image"}
    written["axle_length"] = written.pop("axle")
    written["ray_angles"] = [0.0 - float(angle) for angle in robot.angles()]
    written["is_scanner"] = robot.ray_angles is not None
    noise = task.own_disturbance()
    written["range_noise"], written["pose_noise"] = noise.range_noise, noise.pose_noise
    _check_robot(written, setting.nominal.dt, task.name)
    return {
        "schema_version": 1,
        "task": task.name,
        "task_sha256": task.sha256(),
        "dt": setting.nominal.dt,
        "horizon": setting.nominal.horizon,
        "start": ends["start"],
        "goal": ends["goal"],
        "goal_tolerance": ends["tolerance"],
        "movers": bool(task.spec.movers),
        "unknown": _unknown_text(setting.params.notes),
        "map": {
            "size": [grid.width, grid.height],
            "resolution": grid.resolution,
            "origin": list(grid.origin),
        },
        "robot": written,
    }


def _down(length: float) -> float:
    """A length in m, rounded down to mm."""
    return math.floor(1000.0 * length) / 1000.0


def _unknown_text(notes: tuple[str, ...]) -> str:
    """What the map's unknown cells are for the controller."""
    begin = f"grey {SAVED_UNKNOWN}, "  # the note of `ros_rule.ros_notes`
    if any(each.startswith(begin) and "as free" in each for each in notes):
        return (
            "The map's unknown cells count as FREE by its free_thresh: the robot may "
            "drive where nobody has looked. With free_thresh 0.196 they are walls."
        )
    return "The map's unknown cells are walls."


def _check_robot(robot: dict[str, Any], dt: float, name: str) -> None:
    """Checks that a robot can stop as it says.

    Raises:
        TaskError: It says nothing, or something impossible.
    """
    stop = robot.get("stopping_distance")
    if not stop:
        raise TaskError(
            f"{name}: its robot has no stopping distance, which says when it must "
            "brake: give --robot NAME, or robot.stopping_distance in task.yaml"
        )
    speed = min(robot["max_wheel_speed"], robot.get("max_speed") or math.inf)
    most = robot.get("max_acceleration")
    least = speed * dt + (0.0 if not most else 0.5 * speed**2 / most)
    if stop < 0.99 * least:
        raise TaskError(
            f"{name}: impossible robot: from {speed:g} m/s it drives {least:.3g} m in "
            f"a control period of {dt:g} s and while it brakes, but its "
            f"stopping_distance is {stop:g} m"
        )


def _core_settings(settings: dict[str, Any]) -> Settings:
    """The settings of the core with the latest allowed dead-man's timer."""
    return core_settings(settings, dead_man=PERIODS * settings["dt"])


def core_settings(
    settings: dict[str, Any], kind: type[Settings] = Settings, **declared: Any
) -> Settings:
    """The settings of the core from those of a package.

    Args:
        settings: Contents of `settings.json`.
        kind: Class of the settings, as the package's own core has it.
        **declared: What the user declares, such as `dead_man` and `any_start`.

    Raises:
        ValueError: A value is missing or not valid.
    """
    try:
        return kind(
            dt=settings["dt"],
            horizon=settings["horizon"],
            start=tuple(settings["start"]),
            goal=tuple(settings["goal"]),
            goal_tolerance=settings["goal_tolerance"],
            robot=settings["robot"],
            own_map=settings["map"],
            **declared,
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{SETTINGS}: missing or wrong: {error}") from None


def mark_of(folder: Path) -> str:
    """The mark of a package's controller folder, by which its exporter knows it.

    It is empty if no secret can be kept, or the folder cannot be hashed.
    """
    files = tree_sha256(folder / CONTROLLER)
    if files is None or lasting_secret() is None:
        return ""
    return keyed(f"ros2 package|{files}".encode()).hex()


def package_name(task: str) -> str:
    """A valid name of a ROS package for a task."""
    words = re.sub(r"[^a-z0-9]+", "_", task.lower()).strip("_")
    return f"tdac_{words or 'task'}"


def _checked(name: str) -> str:
    if re.fullmatch(r"[a-z](?:_?[a-z0-9])+", name) is None:
        raise RunError(
            f"--name {name!r}: a ROS package has lower-case letters, digits and single "
            "underscores, and begins with a letter"
        )
    taken = {*FOLDERS, *sys.stdlib_module_names, *keyword.kwlist, "numpy", "rclpy"}
    if name in taken:
        raise RunError(
            f"--name {name}: Python, or the package itself, has this name; try "
            f"tdac_{name}"
        )
    return name


def _verdict(run: Run) -> tuple[str, str, float | None]:
    """The verdict of a run, or an empty text and why it has none; its gap in radii."""
    if remark := remark_on(run):
        return "", f"{remark}: its verdict is only what its files claim", None
    report = read_confirmation(run) if run.verified else None
    if report is None:
        why = f"the controller of {run.folder} is not verified ({run.status})"
        return "", why, None
    gap = report.smallest_gap
    return f"Verified: {verified_text(report)}.", "", None if gap is None else gap.radii


def _write(
    made: RosPackage,
    task: Task,
    settings: dict[str, Any],
    source: bytes,
) -> None:
    out, name = made.folder, made.name
    for folder in (name, *FOLDERS):
        (out / folder).mkdir(parents=True, exist_ok=True)
    write_workdir(out / CONTROLLER, task)
    write_atomic(out / CONTROLLER / "controller.py", source)
    write_atomic(out / CONTROLLER / SETTINGS, json.dumps(settings, indent=1) + "\n")
    write_atomic(out / CONTROLLER / SUMS, sums_of(out / CONTROLLER))
    write_atomic(out / name / "__init__.py", "")
    for file in COPIED:
        write_atomic(out / name / file, (PACKAGE / file).read_bytes())  # raw read: ours
    write_atomic(out / "resource" / name, "")
    setting = task.setting
    assert isinstance(setting, Map2DSetting)
    grid = setting.nominal.terrain.grid
    assert grid.resolution is not None
    write_ros_map(out / "maps", grid, grid.resolution, grid.origin)
    values = values_of(made, settings)
    templates = jinja2.Environment(
        loader=jinja2.FileSystemLoader(PACKAGE),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,  # package.xml escapes what it needs
    )
    files = {
        "README.md": "README.md",
        "package.xml": "package.xml",
        "setup.py": "setup.py",
        "setup.cfg": "setup.cfg",
        "drive.yaml": "config/drive.yaml",
        "drive.launch.py": "launch/drive.launch.py",
        "smoother.launch.py": "launch/smoother.launch.py",
        "drive.rviz": "rviz/drive.rviz",
        "test_flake8.py": "test/test_flake8.py",
        "test_pep257.py": "test/test_pep257.py",
    }
    for template, file in files.items():
        text = templates.get_template(f"{template}.j2").render(values)
        write_atomic(out / file, text)
    write_atomic(out / MARK, mark_of(out))
