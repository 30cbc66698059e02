"""Runs to report on: one that is verified, and one by a model that means harm."""

import shutil

import numpy as np
import pytest
from changed_run import change_run
from hostile_model import CRASHES, CRASHES_LATER, EVIL, SUITE, Model
from script import AHEAD
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.html_report import make_page
from tdac_agent.runs.run_record import load_run
from tdac_agent.verification.diagnosis.report import Report


@pytest.fixture(scope="session")
def runs(tmp_path_factory, good_source, warm):
    """A folder with a hostile run that was not verified, and one that was."""
    place = tmp_path_factory.mktemp("report") / "runs"
    suite = place.parent / "suite"
    suite.mkdir()
    (suite / "test_own.py").write_text(SUITE)
    spec = write_small_task(place.parent / "policy", profile="policy")
    name = place / f"hostile {EVIL.replace('/', '')}"
    model = Model(CRASHES, CRASHES_LATER, AHEAD, AHEAD.replace("1.0", "0.9"))
    task = load_task(
        write_small_task(place.parent / "evil", profile="policy", suite="../suite"),
        trust=True,
    )
    synthesize(task, model, out=name, iterations=2, patience=1, judge=warm)
    synthesize(
        load_task(spec),
        Model(AHEAD, good_source),
        out=place / "verified",
        iterations=2,
        judge=warm,
    )
    return place


@pytest.fixture(scope="session")
def hostile(runs):
    """The folder of the hostile run."""
    return next(runs.glob("hostile*"))


@pytest.fixture(scope="session")
def page(runs):
    """The report on both, as text."""
    return make_page(runs).html.decode()


@pytest.fixture
def copied(runs, tmp_path):
    """The verified run, to be damaged."""
    return shutil.copytree(runs / "verified", tmp_path / "run")


@pytest.fixture(scope="session")
def long_run(runs, tmp_path_factory):
    """Twenty iterations of all-new code, each candidate in six erratic episodes."""
    folder = tmp_path_factory.mktemp("long") / "run"
    shutil.copytree(runs / "verified", folder)
    first = folder / "iterations" / "k01" / "j0"
    report = Report.model_validate_json((first / "report.json").read_bytes())
    steps = 700  # more than enough for the most points that are kept
    names = ["nominal", *(f"jitter {n}" for n in range(1, 6))]
    episodes = [
        report.episodes[0].model_copy(update={"name": name, "steps": steps})
        for name in names
    ]
    (first / "report.json").write_text(
        report.model_copy(update={"episodes": tuple(episodes)}).model_dump_json()
    )
    noise = np.random.default_rng(0)
    for name in names:
        walk = np.cumsum(noise.normal(0, (1.0, 1.0, 0.3), (steps + 1, 3)), axis=0)
        Trajectory(
            walk % (160.0, 120.0, 6.0),
            np.zeros((steps, 2), np.float32),
            np.zeros(steps + 1),
            np.zeros((steps + 1, 18), np.float32),
            1,
            0.05,
        ).save(first / "trajectories" / f"{name.replace(' ', '_')}.npz")
    code = "".join(f"VALUE_{n} = {n}  # a line of some length\n" for n in range(450))
    diff = "--- previous\n+++ controller.py\n@@ -1,450 +1,450 @@\n" + "".join(
        mark + line for mark in "-+" for line in code.splitlines(keepends=True)
    )
    (first / "controller.py").write_text(code)
    (first / "controller.diff").write_text(diff)
    (attempt, *_), attempts = load_run(folder).attempts, []
    for k in range(1, 21):
        for j in (0, 1):
            attempts.append(attempt.model_copy(update={"k": k, "j": j}))
            place = folder / "iterations" / f"k{k:02d}" / f"j{j}"
            if place != first:
                shutil.copytree(first, place, dirs_exist_ok=True)
    change_run(folder, attempts=attempts, status="not verified", tau=None)
    return folder
