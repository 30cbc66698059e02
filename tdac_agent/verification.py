"""Verification: a controller, a task and a suite in; a report out."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pydantic import ValidationError

from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.files import write_atomic
from tdac_agent.judging import Findings, Job
from tdac_agent.report import Diagnosis, Failure, Group, Provenance, Report, Verdict
from tdac_agent.sandbox import MAX_SOURCE_BYTES
from tdac_agent.suite_plugin import lines, test_id
from tdac_agent.task import Profile, Task, portable_task_file, write_workdir
from tdac_agent.trajectory import Trajectory

SHIPPED_SUITE = Path(__file__).parent / "suites" / "map2d"
DEADLINE_SECONDS = 900.0
GROUPS: dict[str, Group] = {
    "test_static.py": "static",
    "test_unit.py": "unit",
    "test_end_to_end.py": "end to end",
}
VERSIONED = ("tdac", "gymnasium", "numpy", "numba", "pytest", "opencv-python-headless")


def verify(
    controller: str | Path,
    task: Task,
    *,
    profile: Profile | None = None,
    paper: bool = False,
    suite: Path | None = None,
    tier: str = "auto",
    seed: int = 0,
    out: Path | None = None,
) -> Report:
    """Tests a controller in the sandbox against everything the task asks for.

    Args:
        controller: Path of the file, or its source.
        task: What it must do.
        profile: `policy` or `paper`; the task's own by default.
        paper: Nominal start only, as in the paper.
        suite: Folder with further tests beside the shipped ones.
        tier: Sandbox tier, `auto` for the best one here.
        seed: Of the jittered starts.
        out: Folder for `report.json` and `trajectories/`; none by default.

    Returns:
        The report; a failing controller is a report, never an exception.

    Raises:
        ControllerFileError: The file cannot be read.
        Fault: Sandbox or suite broken: neither pass nor fail.
    """
    began = time.monotonic()
    source = read_source(controller)
    suites = [SHIPPED_SUITE]
    extra = suite or task.spec.suite
    if extra is not None:
        suites.append(_suite_folder(extra))
    with tempfile.TemporaryDirectory(prefix="tdac-verify-") as name:
        folder = Path(name)
        results = folder / "results"
        results.mkdir()
        work = folder / "work"
        write_workdir(work, task)
        write_atomic(work / "task.yaml", portable_task_file(task))
        write_atomic(folder / "controller.py", source)
        job = Job(
            task=work,
            controller=folder / "controller.py",
            suites=suites,
            profile=profile or task.spec.profile,
            paper=paper,
            tier=tier,
            seed=seed,
            out=results,
        )
        output = _run_judge(job, folder)
        findings = _read_findings(results, output)
        tests, failures = _outcomes(results / "report.jsonl", findings)
        report = Report(
            verdict=_verdict(tests),
            provenance=_provenance(task, source, job, findings),
            failures=tuple(failures),
            tests=tests,
            episodes=tuple(findings.episodes),
            child_cpu_seconds=findings.child_cpu_seconds,
            seconds=round(time.monotonic() - began, 3),
        )
        if out is not None:
            _keep(report, results, out)
    return report


def read_source(controller: str | Path) -> str:
    """Source of a controller given as a path or as text.

    Raises:
        ControllerFileError: The file cannot be read.
    """
    if isinstance(controller, str) and "\n" in controller:
        return controller
    path = Path(controller)
    try:
        with path.open("rb") as file:
            raw = file.read(2 * MAX_SOURCE_BYTES)
    except OSError as error:
        message = f"cannot read the controller {str(path)!r}: {error.strerror}"
        raise ControllerFileError(message) from error
    return raw.decode("utf-8", "surrogateescape")


def load_trajectories(folder: Path) -> dict[str, Trajectory]:
    """The trajectories that a verification kept, by episode name."""
    return {
        path.stem.replace("_", " "): Trajectory.load(path)
        for path in sorted(folder.glob("*.npz"), key=_nominal_first)
    }


def _nominal_first(path: Path) -> tuple[bool, str]:
    return path.stem != "nominal", path.stem


def _suite_folder(path: Path) -> Path:
    if not path.is_dir() or not list(path.glob("test_*.py")):
        raise ControllerFileError(f"no suite {str(path)!r}: expected test_*.py files")
    return path.resolve()


def _run_judge(job: Job, folder: Path) -> str:
    """Runs the judge's process to its end; returns what it printed."""
    request = folder / "job.json"
    request.write_text(job.model_dump_json(), encoding="utf-8")
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    for name in ("PYTEST_ADDOPTS", "PYTEST_PLUGINS"):
        environment.pop(name, None)
    process = subprocess.Popen(
        [sys.executable, "-m", "tdac_agent.judging", str(request)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=environment,
        cwd=folder,
        start_new_session=True,
    )
    try:
        output, _ = process.communicate(timeout=DEADLINE_SECONDS)
    except BaseException as error:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        if isinstance(error, subprocess.TimeoutExpired):
            raise Fault(
                f"the judge did not end within {DEADLINE_SECONDS:g} s"
            ) from error
        raise
    return output.decode("utf-8", "replace")


def _read_findings(results: Path, output: str) -> Findings:
    path = results / "findings.json"
    try:
        findings = Findings.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
        raise Fault(f"the judge left no findings: {_tail(output)}") from error
    if findings.fault is not None:
        raise Fault(findings.fault)
    if not findings.expected:
        raise Fault(f"the suite could not be collected: {_tail(output)}")
    return findings


def _outcomes(path: Path, findings: Findings) -> tuple[dict[str, str], list[Failure]]:
    """Outcome of each expected test; what is missing from the log has failed."""
    tests = dict.fromkeys(findings.expected, "missing")
    failures: dict[str, Failure] = {}
    for record in lines(path) if path.exists() else ():
        if (
            record.get("$report_type") == "CollectReport"
            and record["outcome"] != "passed"
        ):
            raise Fault(f"the suite is broken: {_crash(record)}")
        if record.get("$report_type") != "TestReport":
            continue
        name = test_id(record["nodeid"])
        if name not in tests:
            raise Fault(f"the suite ran a test that was not expected: {name}")
        if record["outcome"] != "passed" or "wasxfail" in record:
            tests[name] = "failed" if record["outcome"] == "failed" else "skipped"
            failures.setdefault(name, _failure(name, record, findings))
        elif record["when"] == "call" and tests[name] == "missing":
            tests[name] = "passed"
    for name, outcome in tests.items():
        if outcome == "missing":
            message = "the test did not run to its end"
            failures[name] = Failure(test=name, group="judge", message=message)
    return tests, [failures[name] for name in tests if name in failures]


def _failure(name: str, record: dict[str, object], findings: Findings) -> Failure:
    diagnosis = None
    for key, value in record.get("user_properties", []):  # type: ignore[attr-defined]
        if key == "rollout" and value in findings.diagnoses:
            diagnosis = Diagnosis.model_validate_json(findings.diagnoses[value])
    return Failure(
        test=name,
        group=GROUPS.get(name.partition("::")[0], "user"),
        message=_crash(record),
        diagnosis=diagnosis,
    )


def _crash(record: dict[str, object]) -> str:
    """The message of a failed test, without the assertion's source or a path."""
    details = record.get("longrepr")
    if isinstance(details, dict):
        text = str((details.get("reprcrash") or {}).get("message", ""))
    else:
        text = str(details)
    for prefix in ("AssertionError: ", "Failed: "):
        text = text.removeprefix(prefix)
    # Exceptions are shown with their module; the class says enough.
    head, separator, tail = text.partition(": ")
    if separator and head.startswith("tdac_agent."):
        text = tail
    return text


def _tail(output: str) -> str:
    kept = [line for line in output.strip().splitlines() if line.strip()][-6:]
    return " | ".join(kept) or "no output"


def _verdict(tests: dict[str, str]) -> Verdict:
    passed = sum(outcome == "passed" for outcome in tests.values())
    return Verdict(
        passed=passed == len(tests),
        expected=len(tests),
        passed_tests=passed,
        failed_tests=len(tests) - passed,
    )


def _provenance(task: Task, source: str, job: Job, findings: Findings) -> Provenance:
    weak = findings.tier == "rlimits"
    warning = "this sandbox tier cannot withhold the network and other files"
    versions = {name: importlib.metadata.version(name) for name in VERSIONED}
    return Provenance(
        task=task.name,
        task_sha256=task.sha256(),
        map_sha256=task.nominal.terrain.grid.sha256(),
        params_sha256=_sha(task.params.model_dump_json().encode()),
        sensors_sha256=_sha((job.task / "sensors.py").read_bytes()),
        controller_sha256=_sha(source.encode("utf-8", "surrogateescape")),
        suite=" + ".join(folder.name for folder in job.suites),
        suite_sha256=_sha(json.dumps([_suite_hash(s) for s in job.suites]).encode()),
        profile=job.profile,
        paper=job.paper,
        seed=job.seed,
        sandbox=findings.tier,
        warnings=(warning,) if weak else (),
        versions={"python": platform.python_version(), **versions},
    )


def _suite_hash(folder: Path) -> dict[str, str]:
    return {path.name: _sha(path.read_bytes()) for path in sorted(folder.glob("*.py"))}


def _sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _keep(report: Report, results: Path, out: Path) -> None:
    (out / "trajectories").mkdir(parents=True, exist_ok=True)
    for path in sorted((results / "trajectories").glob("*.npz")):
        write_atomic(out / "trajectories" / path.name, path.read_bytes())
    write_atomic(out / "report.json", report.model_dump_json(indent=2) + "\n")
