"""Files of every kind that is read, each with one field replaced by something hostile.

Each kind has a whole file, a folder that it lies in, and functions that read it. A file
gets past the first check when it is YAML or JSON with values of sane size; of what is
generated at least half does.
"""

from __future__ import annotations

import contextlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from tdac_agent import load_task
from tdac_agent.builtin.scripted import Script
from tdac_agent.campaign.config import read_config
from tdac_agent.cli.console import Console
from tdac_agent.cli.rules import _histories
from tdac_agent.cli.run_view import show_run
from tdac_agent.cli.runs import _table
from tdac_agent.library.listing import row_of
from tdac_agent.models.choice import Options
from tdac_agent.models.prices import load_prices
from tdac_agent.runs.history import gather_run
from tdac_agent.runs.journal_state import read_past
from tdac_agent.runs.replay import make as make_replay
from tdac_agent.runs.resume import resume_arguments
from tdac_agent.runs.run_record import JOURNAL, RUN_FILE, load_rules, load_run
from tdac_agent.storage.journal import read_records
from tdac_agent.storage.yaml_file import read_yaml
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.training.curve import read_curve
from tdac_agent.training.hyperparameters import read_hyperparameters
from tdac_agent.training.plan import read_plan
from tdac_envs.core.errors import TdacError
from tdac_envs.core.intake import check, parse_json, parse_yaml
from tdac_envs.map2d.source import prepare
from tdac_envs.mapping.map_files import load_image

Reader = Callable[[Path], object]


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of file.

    Attributes:
        name: For tests.
        file: Its name in its folder.
        whole: What it holds.
        read: Reads it, and does with it what commands do.
        furnish: Writes what lies beside it.
        yaml: Whether it is YAML; else JSON.
        lines: Whether each item of `whole["lines"]` is a line of JSON.
    """

    name: str
    file: str
    whole: dict[str, Any]
    read: Reader
    furnish: Reader = lambda folder: None
    yaml: bool = False
    lines: bool = False

    def text(self, value: dict[str, Any]) -> str:
        """The file's text for what it is to hold."""
        if self.lines:
            lines = value.get("lines")
            lines = lines if isinstance(lines, list) else [lines]
            return "".join(json.dumps(line) + "\n" for line in lines)
        return yaml.safe_dump(value) if self.yaml else json.dumps(value)

    def gets_in(self, text: str) -> bool:
        """Whether a text gets past the first check."""
        try:
            if self.lines:
                for line in text.splitlines():
                    check(json.loads(line))
            elif self.yaml:
                parse_yaml(text.encode())
            else:
                parse_json(text.encode())
        except (ValueError, RecursionError):
            return False
        return True


def draw(folder: Path) -> None:
    """Writes a picture of a room of 40 x 30 px."""
    picture = np.full((30, 40), 255, np.uint8)
    picture[:2] = picture[-2:] = picture[:, :2] = picture[:, -2:] = 0
    cv2.imwrite(str(folder / "plan.png"), picture)
    cv2.imwrite(str(folder / "robot.png"), np.zeros((9, 9, 3), np.uint8))


def draw_grid(folder: Path) -> None:
    """Writes a grid of 40 x 30 px."""
    cells = np.zeros((30, 40), np.bool_)
    cells[:2] = cells[-2:] = cells[:, :2] = cells[:, -2:] = True
    np.save(folder / "occupancy.npy", cells)


def use_task(folder: Path) -> None:
    """Reads a task, writes it for a judge, reads that, and drives a step."""
    task = load_task(folder)
    again = load_task(lay_out(task, folder / "laid out"))
    assert again.nominal.start == task.nominal.start
    env = again.make_env(variation="jitter")
    env.reset(seed=1)
    env.step(np.array([1.0, 0.5], np.float32))
    _tell(task)


def _tell(task: Task) -> None:
    task.sha256().encode()
    task.name.encode()
    task.params.model_dump_json()
    task.setting.remarks()


def use_run(folder: Path) -> None:
    """Lists a run, shows it, and reads all that is left of it."""
    row = row_of(folder)
    json.dumps(row).encode()
    with contextlib.redirect_stdout(io.StringIO()):
        console = Console()
        console.print(_table([row], folder, 120))
        show_run(load_run(folder), console)
    told = gather_run(folder)
    for tried in told.tried:
        list(tried.trajectories())
    told.run.model_dump_json()


def use_rules(folder: Path) -> None:
    """Shows the rules, and adds one."""
    book = load_rules(folder)
    with contextlib.redirect_stdout(io.StringIO()):
        Console().print(_histories(book))
    book.add("Stop before walls.", "task", 3, ("test_a",)).bounded(4)
    book.observed(("test_a",), 1)
    use_run(folder)


def use_journal(folder: Path) -> None:
    """Goes on from a journal, replays it, and shows what was learnt."""
    past = read_past(read_records(folder / JOURNAL))
    assert past.lost_usd >= 0
    assert past.unanswered >= 0
    make_replay(str(folder), Options(None)).answers_sha256()  # type: ignore[arg-type]
    use_run(folder)


def use_parameters(folder: Path) -> None:
    """Reads a map folder, and a run's task with the parameters it was begun with."""
    prepare(folder)
    resume_arguments(folder, {"seed": 3})


def use_training(folder: Path) -> None:
    """Lists a training."""
    row_of(folder)
    read_plan(folder)
    read_curve(folder)


MAP_TASK = {
    "schema": 1,
    "name": "room",
    "env": "TDAC-Map2D-v0",
    "map": "plan.png",
    "robot": {
        "radius": 3.0,
        "axle": 5.0,
        "max_wheel_speed": 40.0,
        "n_rays": 5,
        "field_of_view": 90.0,
        "range_max": 50.0,
        "image": "robot.png",
    },
    "start": [8.0, 8.0, 0.5],
    "goal": [32.0, 20.0],
    "snap": False,
    "tolerance": 3.0,
    "dt": 0.05,
    "horizon": 300,
    "progress": {"fraction": 0.7, "steps": 100, "distance": "geodesic"},
    "variation": "jitter",
    "profile": "paper",
    "instructions": "Take your time.",
}
WORLD_TASK = {
    "schema": 1,
    "name": "arena",
    "env": "TDAC-EPuck-v0",
    "world": "arena",
    "ignore": [],
    "left_out": ["Robot at (0, 0)"],
    "start": [-0.3, -0.3, 0.0],
    "goal": [0.2, 0.2],
    "tolerance": 0.03,
    "dt": 0.032,
    "horizon": 900,
    "profile": "policy",
}
ROS = {
    "image": "plan.png",
    "resolution": 0.05,
    "origin": [0.0, 0.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
    "mode": "trinary",
}
PARAMS = {
    "schema_version": 1,
    "source": "plan.png",
    "source_sha256": "00",
    "width": 40,
    "height": 30,
    "start": [8.0, 8.0],
    "heading": 0.5,
    "goal": [32.0, 20.0],
    "robot": {"radius": 3.0, "axle_length": 6.0, "n_rays": 5, "range_max": 50.0},
    "polarity": "dark",
    "method": "otsu",
    "threshold": 128.0,
    "cleanup": 2,
    "opening": 0,
    "inflation": 1.0,
    "score": 3.5,
    "score_terms": {"min_clearance": 4.0, "path_length": 27.0, "sharpness": 0.1},
    "resolution": 0.05,
    "origin": [0.0, 0.0, 0.0],
    "notes": ["start moved"],
}
RUN = {
    "schema_version": 1,
    "task": "room",
    "task_sha256": "00",
    "learner": "builtin",
    "optimizer": "builtin",
    "iterations": 5,
    "patience": 1,
    "seed": 3,
    "status": "not verified",
    "tau": None,
    "attempts": [
        {"k": 1, "j": 0, "valid": True, "passed": False, "failed_tests": ["test_a"]},
        {"k": 1, "j": 1, "valid": True, "passed": True, "notes": ["a note"]},
    ],
    "tokens_in": 100,
    "tokens_out": 200,
    "models": ["a-model"],
    "base_url": None,
    "served_at": {"openai:x": "http://localhost:1"},
    "prompt": "full",
    "max_output": 16000,
    "max_cost": 2.0,
    "cost": 0.5,
    "cost_lost": 0.1,
    "started": "2026-11-23T09:00:00+00:00",
    "seconds": 12.5,
    "reason": "",
    "outlook": "",
}
RULES = {
    "schema_version": 1,
    "rules": [
        {
            "id": "R1",
            "text": "Slow down before a turn.",
            "scope": "task",
            "born": 1,
            "evidence": ["test_a", "test_b"],
            "edits": ["k=2: was another"],
            "tried": 2,
            "cured": 1,
            "passes": [1, 2],
            "worse": 0,
            "status": "in force",
        },
        {
            "id": "R2",
            "text": "Never stop.",
            "born": 2,
            "evidence": ["test_b"],
            "status": "dropped",
            "ended": 3,
            "reason": "it did harm",
        },
    ],
}
JOURNAL_LINES = {
    "lines": [
        {"event": "run.start", "learner": "builtin", "seconds": 0.1, "task": "room"},
        {"event": "prove.end", "proven": True, "seconds": 1.0, "suite": "map2d"},
        {
            "event": "call.intent",
            "key": "ab",
            "kind": "generate",
            "k": 1,
            "j": 0,
            "model": "m",
            "max_tokens": 16000,
            "reserved": {"tokens": 100, "usd": 0.5},
            "seconds": 2.0,
        },
        {
            "event": "call.reply",
            "key": "ab",
            "kind": "generate",
            "k": 1,
            "j": 0,
            "blob": "00",
            "model": "m",
            "stop": "end",
            "tokens_in": 10,
            "tokens_out": 20,
            "notes": ["a note"],
            "cost": 0.25,
            "spent": {"tokens": 30, "usd": 0.25},
            "seconds": 3.0,
        },
        {"event": "call.fault", "key": "ab", "kind": "edit", "k": 1, "j": 1},
        {"event": "verify.end", "k": 1, "j": 0, "failed_tests": ["a"], "seconds": 4.0},
        {"event": "rules", "k": 1, "rules": RULES["rules"], "notes": ["a change"]},
        {"event": "run.end", "status": "not verified", "seconds": 5.0},
    ]
}
REPORT = {
    "schema_version": 1,
    "verdict": {"passed": False, "expected": 2, "passed_tests": 1, "failed_tests": 1},
    "provenance": {
        "task": "room",
        "task_sha256": "00",
        "map_sha256": "00",
        "params_sha256": "00",
        "sensors_sha256": "00",
        "controller_sha256": "00",
        "suite": "map2d",
        "suite_sha256": "00",
        "profile": "paper",
        "paper": False,
        "seed": 3,
        "sandbox": "namespaces",
        "limits": {"cpu_seconds": 120.0},
        "versions": {"python": "3.11"},
    },
    "failures": [
        {
            "test": "test_b",
            "group": "end to end",
            "message": "it hit a wall",
            "diagnosis": {"cause": "collision", "text": "It hit.", "step": 3, "x": 1.0},
        }
    ],
    "tests": {"test_a": "passed", "test_b": "failed"},
    "episodes": [
        {
            "name": "nominal",
            "held_out": False,
            "outcome": "collision",
            "steps": 3,
            "collisions": 1,
            "d0": 10.0,
            "d_min": 5.0,
            "d0_euclidean": 10.0,
            "d_min_euclidean": 5.0,
            "progress_passed": False,
            "progress_passed_euclidean": False,
            "call_ms_mean": 0.1,
            "call_ms_p99": 0.2,
        }
    ],
    "child_cpu_seconds": 1.0,
    "seconds": 2.0,
}
TRAINING = {
    "schema_version": 1,
    "algo": "ppo",
    "tasks": ["maze"],
    "task_sha256": ["00"],
    "wrappers": ["goal-relative", "flatten"],
    "variation": "jitter",
    "env_kwargs": {"variation": "mixed"},
    "disturbance": {
        "range_noise": 0.0,
        "wheel_slip": 0.0,
        "motor_lag": 0.0,
        "delay": 0,
    },
    "steps": 1000,
    "seed": 0,
    "n_envs": 4,
    "policy": "MlpPolicy",
    "hyperparameters": {"gamma": 0.99, "learning_rate": "lin_1e-3"},
    "evaluate_every": 100,
    "episodes": 10,
}
HYPERPARAMETERS = {
    "TDAC-Map2D-v0": {
        "env_wrapper": ["gymnasium.wrappers.FlattenObservation"],
        "n_envs": 4,
        "n_timesteps": 1000,
        "policy": "MlpPolicy",
        "env_kwargs": {"variation": "mixed"},
        "learning_rate": "lin_1e-3",
    }
}
CAMPAIGN = {
    "schema": 1,
    "name": "few",
    "about": "a few",
    "tasks": ["maze"],
    "learners": ["builtin"],
    "optimizers": ["same"],
    "settings": ["dual tier"],
    "prompts": ["full"],
    "runs": 2,
    "iterations": 3,
    "patience": 1,
    "samples": 4,
    "seed": 0,
    "max_output": 1000,
    "max_cost": 1.0,
    "max_tokens": 1000,
    "keep": "all",
}
SCRIPT = {
    "schema": 1,
    "about": "a script",
    "seed": 1,
    "drawn": True,
    "generate": [{"weight": 2.0}, {"weight": 1.0, "file": "still.py"}],
    "edit": [{"weight": 1.0, "parameters": {"cruise_speed": 0.25}}],
}
PRICES = {
    "schema": 1,
    "dated": "2026-01-01",
    "source": "here",
    "models": {"openai:x": {"input": 1.0, "output": 2.0, "cache_read": 0.1}},
}


def _run_folder(folder: Path) -> None:
    (folder / RUN_FILE).write_text(json.dumps(RUN))


def _attempt_folder(folder: Path) -> None:
    """A run whose report is read: that of its second candidate."""
    _run_folder(folder)


def _use_report(folder: Path) -> None:
    place = folder / "iterations" / "k01" / "j1"
    place.mkdir(parents=True)
    shutil.copy(folder / "report.json", place / "report.json")
    use_run(folder)
    told = gather_run(folder)
    if told.report is not None:
        told.report.model_dump_json().encode()


def _parameters_folder(folder: Path) -> None:
    draw_grid(folder)
    draw(folder)
    _run_folder(folder)
    task = {key: MAP_TASK[key] for key in ("schema", "env", "start", "goal", "horizon")}
    (folder / "task.yaml").write_text(yaml.safe_dump({**task, "map": "."}))


KINDS = [
    Kind("task", "task.yaml", MAP_TASK, use_task, draw, yaml=True),
    Kind("world task", "task.yaml", WORLD_TASK, use_task, yaml=True),
    Kind("ros map", "map.yaml", ROS, lambda f: load_image(f / "map.yaml"), draw, True),
    Kind("params", "params.json", PARAMS, use_parameters, _parameters_folder),
    Kind("run", RUN_FILE, RUN, use_run),
    Kind("rules", "rules.json", RULES, use_rules, _run_folder),
    Kind("journal", JOURNAL, JOURNAL_LINES, use_journal, _run_folder, lines=True),
    Kind("report", "report.json", REPORT, _use_report, _attempt_folder),
    Kind("training", "training.json", TRAINING, use_training),
    Kind(
        "hyperparameters",
        "ppo.yml",
        HYPERPARAMETERS,
        lambda f: read_hyperparameters(f / "ppo.yml", "TDAC-Map2D-v0"),
        yaml=True,
    ),
    Kind(
        "campaign",
        "few.yaml",
        CAMPAIGN,
        lambda f: read_config(f / "few.yaml"),
        yaml=True,
    ),
    Kind(
        "script",
        "weak.yaml",
        SCRIPT,
        lambda f: read_yaml(f / "weak.yaml", Script, "the script", TdacError),
        yaml=True,
    ),
    Kind(
        "prices",
        "prices.yaml",
        PRICES,
        lambda f: load_prices(f / "prices.yaml"),
        yaml=True,
    ),
]
