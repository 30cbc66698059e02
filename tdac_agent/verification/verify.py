"""Verifies a controller on a task with a suite, and returns a report."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tdac_agent.episodes.trajectory import Trajectory, nominal_first
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.sandbox import Limits
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.links import refuse_links
from tdac_agent.tasks.installation import seed_of
from tdac_agent.tasks.provenance import origin, versions
from tdac_agent.tasks.task import Task, display_name, lay_out
from tdac_agent.tasks.task_file import Profile, check_frame
from tdac_agent.tasks.trust import allowed
from tdac_agent.verification.diagnosis.report import (
    OWN,
    SHIPPED,
    Failure,
    Provenance,
    Report,
    in_units,
)
from tdac_agent.verification.diagnosis.second_opinion import as_test
from tdac_agent.verification.judge.jobs import Findings, Job, write_job
from tdac_agent.verification.judge.report_log import (
    read_findings,
    read_outcomes,
    verdict_of,
)
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.physics.moved import EXACT, engine_named

EVERY_TASK = Path(__file__).parent / "suite" / "every_task.py"
DEADLINE_SECONDS = 900.0
MAX_FILE_BYTES = 64_000_000
WRITTEN = "report.json", "episodes.json", "trajectories"


def verify(
    controller: str | bytes | Path,
    task: Task,
    *,
    profile: Profile | None = None,
    paper: bool = False,
    suite: Path | None = None,
    shipped: Path | None = None,
    tier: str = "auto",
    seed: int | None = None,
    limits: Limits | None = None,
    out: Path | None = None,
    judge: WarmJudge | None = None,
    meanwhile: Callable[[], None] | None = None,
    physics: str = EXACT,
    require_physics: bool = False,
) -> Report:
    """Tests a controller in the sandbox against everything the task requires.

    Args:
        controller: Path of the file, or its source (text of several lines, or bytes).
        task: Task of the controller.
        profile: `policy` or `paper`; the task's own by default.
        paper: Whether to use the nominal start only, as in the paper.
        suite: Folder with tests to add to the shipped ones; the task's own by default.
        shipped: Folder of tests to use instead of the shipped ones.
        tier: Sandbox tier, `auto` for the best one on this machine.
        seed: Seed of the jittered starts; by default derived from the controller, the
            task and a secret of this installation, so that no author can predict it.
        limits: Limits of the controller's processes; `cpu_seconds` is the total.
        out: Folder for `report.json` and `trajectories/`, with a picture of each
            failed episode; by default nothing is kept.
        judge: A warm judge, to be shared by several verifications; a new one by
            default.
        meanwhile: Called repeatedly while the judge works.
        physics: Another physics, which drives again what reached the goal, for a second
            opinion: `mujoco`; `exact` for none.
        require_physics: Whether this is a test: all of these episodes must arrive.

    Returns:
        The report; a failing controller gives a report, never an exception.

    Raises:
        ControllerFileError: The file cannot be read.
        TaskError: The other physics is not installed, or cannot drive on this task; or
            the task is in metres, which the profile `paper` does not know.
        Fault: The sandbox or the suite is broken; this is neither pass nor fail.
        RunError: A link leads out of `out`, where the results are written.
    """
    began = time.monotonic()
    if out is not None:
        refuse_links(out, *WRITTEN)
    source = read_source(controller)
    check_frame(task.spec.frame, profile or task.spec.profile)
    check_physics(task, physics)
    suites = _suites(task, suite, shipped)
    with contextlib.ExitStack() as stack:
        warm = judge or stack.enter_context(WarmJudge())
        # In the judge's folder, so that no interrupt can leave it behind.
        made = tempfile.TemporaryDirectory(prefix="tdac-verify-", dir=warm.folder)
        folder = Path(stack.enter_context(made))
        job = Job(
            task=folder / "work",
            controller=folder / "controller.py",
            suites=[folder / "suites" / name for name in suites],
            profile=profile or task.spec.profile,
            paper=paper,
            tier=tier,
            seed=seed_of(source, task) if seed is None else seed,
            limits=limits or Limits(),
            out=folder / "results",
            trajectories=None if out is None else folder / "trajectories",
            metres=task.setting.shown != task.setting.units,
            physics=physics,
        )
        lay_out(task, job.task)
        findings, tests, failures = judged(job, source, suites, warm, meanwhile)
        if require_physics and physics != EXACT:
            test, wrong = as_test(findings.second_opinion, physics)
            tests, failures = tests | test, [*failures, *wrong]
        report = Report(
            verdict=verdict_of(tests),
            provenance=_provenance(task, source, job, suites, findings),
            failures=tuple(failures),
            tests=tests,
            episodes=tuple(findings.episodes),
            child_cpu_seconds=findings.child_cpu_seconds,
            seconds=round(time.monotonic() - began, 3),
            second_opinion=findings.second_opinion,
        )
        if out is not None:
            keep(report, folder / "trajectories", out, task)
    return report


def check_physics(task: Task, physics: str) -> None:
    """Checks before the work begins that another physics can drive on a task.

    Raises:
        TaskError: It is unknown or not installed, or cannot drive there.
    """
    if engine_named(physics) != EXACT:
        task.make_env(physics=physics)


def judged(
    job: Job,
    source: bytes,
    suites: dict[str, Path],
    judge: WarmJudge,
    meanwhile: Callable[[], None] | None = None,
) -> tuple[Findings, dict[str, str], list[Failure]]:
    """Runs a job, whose working folder has been filled; returns the outcome of tests.

    Args:
        job: The job; all of its paths are in one folder.
        source: Bytes of the controller.
        suites: The folders of tests.
        judge: A warm judge.
        meanwhile: Called repeatedly while the judge works.

    Raises:
        Fault: The sandbox or the suite is broken; this is neither pass nor fail.
    """
    _prepare(job, source, suites)
    files = _files_in(job.task)
    output = _run_judge(job, job.out.parent, judge, meanwhile)
    findings = read_findings(job.out, output)
    if _files_in(job.task) != files:
        raise Fault("the suite changed the task's files, so there is no verdict")
    return findings, *read_outcomes(job.out / "report.jsonl", findings, output)


def kept_report(
    folder: Path, task: Task, source: str, seed: int | None
) -> Report | None:
    """Loads the report in a folder if it is about this controller, otherwise None.

    Controller, task, dynamics, suite, seed and package versions must be the same. A
    seed of None is the one derived from the controller and this installation's secret,
    so that a report from elsewhere never matches.
    """
    raw = source.encode("utf-8", "surrogatepass")
    wanted = {
        "controller_sha256": sha256_of(raw),
        "task_sha256": task.sha256(),
        "dynamics": task.dynamics(),
        "suite_sha256": suite_sha256(task),
        "profile": task.spec.profile,
        "paper": False,
        "seed": seed_of(raw, task) if seed is None else seed,
        "versions": versions(),
    }
    return report_in(folder, wanted)


def report_in(folder: Path, wanted: dict[str, Any]) -> Report | None:
    """The report in a folder if its provenance has these values, otherwise None."""
    try:
        content = read_file(folder / "report.json", RECORD_BYTES)
        report = Report.model_validate(parse_json(content))
    except (OSError, ValueError):
        return None
    about = report.provenance
    same = all(getattr(about, name) == value for name, value in wanted.items())
    return report if same else None


def _suite_name(task: Task, folder: Path) -> str:
    own = task.environment
    return own.folder.name if folder == own.suite else folder.name


def suite_sha256(task: Task) -> str:
    """Hash of all tests that controllers of a task must pass."""
    return _hash_of_suites(_suites(task))


def _suites(
    task: Task, suite: Path | None = None, shipped: Path | None = None
) -> dict[str, Path]:
    """The folders of tests: the shipped suite and, if there is one, the user's own."""
    suites = {SHIPPED: suite_folder(shipped or task.environment.suite)}
    extra = suite or task.suite
    if suite is None:
        allowed(task, None, trust=False)
    if extra is not None:
        suites[OWN] = suite_folder(extra)
    return suites


def read_source(controller: str | bytes | Path) -> bytes:
    """Reads a controller given as a path, as text of several lines or as bytes.

    Raises:
        ControllerFileError: The file cannot be read, or is far too large.
    """
    if isinstance(controller, bytes):
        return controller
    if isinstance(controller, str) and "\n" in controller:
        return controller.encode("utf-8", "surrogatepass")
    try:
        return read_file(controller, MAX_FILE_BYTES)
    except OSError as error:
        message = f"cannot read the controller {str(controller)!r}: {error.strerror}"
        raise ControllerFileError(message) from error


def weights_file(controller: Path) -> Path | None:
    """What lies beside a learned controller as its weights, `NAME.npz`, if anything.

    Controllers of runs have none.
    """
    file = controller.with_suffix(".npz")
    return file if file.name != "controller.npz" and os.path.lexists(file) else None


def _prepare(job: Job, source: bytes, suites: dict[str, Path]) -> None:
    """Lays out the folder of a job.

    The suites are linked into one folder, so that no `conftest.py` or `pytest.ini` of
    their own parent folders takes effect.
    """
    job.out.mkdir()
    if job.trajectories is not None:
        job.trajectories.mkdir()
    job.controller.write_bytes(source)
    for link, folder in zip(job.suites, suites.values(), strict=True):
        link.parent.mkdir(exist_ok=True)
        link.symlink_to(folder, target_is_directory=True)


def load_trajectories(folder: Path) -> dict[str, Trajectory]:
    """Loads the trajectories that a verification kept, by episode name."""
    return {
        path.stem.replace("_", " "): Trajectory.load(path)
        for path in sorted(folder.glob("*.npz"), key=nominal_first)
    }


def suite_folder(path: Path) -> Path:
    """The absolute path of a folder of tests.

    Raises:
        ControllerFileError: There is no such folder, or it has no tests.
    """
    if not path.is_dir():
        raise ControllerFileError(f"no suite {str(path)!r}: no such folder")
    if not list(path.glob("test_*.py")):
        raise ControllerFileError(f"no suite in {str(path)!r}: it has no test_*.py")
    return path.resolve()


def _run_judge(
    job: Job, folder: Path, judge: WarmJudge, meanwhile: Callable[[], None] | None
) -> str:
    request = folder / "job.json"
    write_job(job, request)
    judge.run(request, DEADLINE_SECONDS, meanwhile)
    # raw read: our temporary folder
    output = (folder / "output.txt").read_bytes().decode("utf-8", "replace")
    return output.replace(f"{folder}/", "")


def _provenance(
    task: Task, source: bytes, job: Job, suites: dict[str, Path], findings: Findings
) -> Provenance:
    return Provenance(
        **origin(task, source, job.task, findings.tier, job.limits),
        called=display_name(task),
        own_suite=tests_sha256(suites[OWN])[:8] if OWN in suites else "",
        suite=" + ".join(_suite_name(task, folder) for folder in suites.values()),
        suite_sha256=_hash_of_suites(suites),
        profile=job.profile,
        paper=job.paper,
        seed=job.seed,
    )


def tests_sha256(folder: Path) -> str:
    """Hash of the tests in a folder."""
    return sha256_of(json.dumps(_file_hashes(folder), sort_keys=True).encode())


def _hash_of_suites(suites: dict[str, Path]) -> str:
    hashes = {name: _file_hashes(folder) for name, folder in suites.items()}
    # raw read: shipped
    hashes[SHIPPED][EVERY_TASK.name] = sha256_of(EVERY_TASK.read_bytes())
    return sha256_of(json.dumps(hashes, sort_keys=True).encode())


def _file_hashes(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): sha256_of(read_file(path, RECORD_BYTES))
        for path in sorted(folder.rglob("*.py"))
    }


def _files_in(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.glob("*") if path.is_file())
    return {path.name: read_file(path, RECORD_BYTES) for path in files}


def keep(report: Report, results: Path, out: Path, task: Task | None = None) -> None:
    """Writes report and trajectories, and the pictures of failures on a task.

    They replace those of an earlier verification.
    """
    folder = out / "trajectories"
    folder.mkdir(parents=True, exist_ok=True)
    for pattern in ("nominal.*", "jitter_*.*"):
        for path in folder.glob(pattern):
            path.unlink()
    for path in sorted(results.glob("*.npz")):
        # raw read: our temporary folder
        write_atomic(folder / path.name, path.read_bytes(), lasting=False)
    if task is not None and not report.passed:
        from tdac_agent.verification.diagnosis.figures import (
            draw_failures,  # slow to import
        )

        shown = in_units(report, task.setting.shown)
        draw_failures(task, shown, load_trajectories(folder), folder)
    # A robust report in this folder belongs to the controller verified earlier.
    (out / "episodes.json").unlink(missing_ok=True)
    write_atomic(out / "report.json", report.model_dump_json(indent=2) + "\n")
