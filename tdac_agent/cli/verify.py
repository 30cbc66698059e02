"""`tdac verify`: tests a controller in the sandbox and prints the report."""

from __future__ import annotations

import gc
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tdac_agent.cli.flags import TaskFlags, check_tier
from tdac_agent.cli.robust_flags import RobustFlags
from tdac_agent.cli.spinner import Spinner
from tdac_agent.errors import ControllerFileError
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import TASK_FILE, Profile
from tdac_agent.tasks.trust import allowed
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.warm import WarmJudge

if TYPE_CHECKING:
    from tdac_agent.verification.episode_report import EpisodeReport


def run(
    controller: str,
    flags: TaskFlags,
    profile: Profile | None,
    paper: bool,
    suite: Path | None,
    trust: bool,
    tier: str,
    seed: int | None,
    junit: Path | None,
    out: Path | None,
    as_json: bool,
    robust: RobustFlags,
    child_pool: ChildPool,
) -> int:
    """Verifies a controller and prints the report; returns the exit code."""
    check_tier(tier)
    robust.check()
    if out is not None:
        check_folder(out)
    file, task = _prepared(controller, flags)
    task = allowed(task, suite, trust=trust)
    if robust.robust is not None:
        task.disturbed_options(robust.disturbed.disturbance())
    gc.freeze()
    gc.enable()
    with WarmJudge(child_pool) as judge:
        # Imported while the judge starts.
        from tdac_agent.runs.ownership import mark_verified
        from tdac_agent.verification.verify import verify

        with Spinner(f"verifying {file.name} on {task.name} …") as spinner:
            report = verify(
                file,
                task,
                profile=profile,
                paper=paper,
                tier=tier,
                seed=seed,
                out=out,
                judge=judge,
                meanwhile=spinner,
            )
        if junit is not None:
            write_junit(report, junit)
        if report.passed and not report.provenance.paper:
            about = report.provenance
            again = mark_verified(file, about.task_sha256, about.profile)
            print(again, end="\n" * bool(again), file=sys.stderr)
        if not as_json:
            _show(report, out, task)
        measured = None
        if robust.robust is not None and report.passed:
            from tdac_agent.cli.robust import measure

            measured = measure(
                file, task, robust, tier=tier, out=out, judge=judge, as_json=as_json
            )
    if as_json:
        sys.stdout.write(_json(report, robust, measured) + "\n")
    elif robust.robust is not None:
        replay = _replay(controller, flags, robust, tier)
        _show_robust(measured, replay, task.setting.shown)
    accepted = measured is None or measured.passed
    return 0 if report.passed and accepted else 1


def _prepared(controller: str, flags: TaskFlags) -> tuple[Path, Task]:
    """The file and its task; shows a status while a task is built from flags."""
    if flags == TaskFlags():
        return controller_and_task(controller, flags)
    from tdac_agent.cli.console import Console

    with Console(stderr=True).status("preparing the task …"):
        return controller_and_task(controller, flags)


def _show(report: Report, out: Path | None, task: Task) -> None:
    from tdac_agent.cli.console import Console
    from tdac_agent.cli.report_view import show_report

    show_report(report, Console(), out, task.folder, task.setting.shown)


def _show_robust(
    measured: EpisodeReport | None, replay: list[str], units: Units
) -> None:
    from tdac_agent.cli.console import Console
    from tdac_agent.cli.robust_view import show_robust

    console = Console()
    if measured is None:
        console.print("robustness not measured: the controller is not verified")
    else:
        show_robust(measured, console, replay, units)


def _json(report: Report, robust: RobustFlags, measured: EpisodeReport | None) -> str:
    """The report as JSON; `--robust` adds the key `robust`, null if it was not run."""
    if robust.robust is None:
        return report.model_dump_json(indent=2)
    content = report.model_dump(mode="json")
    added = None if measured is None else measured.model_dump(mode="json")
    return json.dumps({**content, "robust": added}, indent=2, ensure_ascii=False)


def _replay(
    controller: str, flags: TaskFlags, robust: RobustFlags, tier: str
) -> list[str]:
    """The command line that plays one of the disturbed episodes, without `--seed`."""
    words = ["tdac", "play", controller, *flags.words(), *robust.disturbed.words()]
    return words if tier == "auto" else [*words, "--tier", tier]


def check_folder(out: Path) -> None:
    """Checks before the work begins that the folder can be written to."""
    folder = out / "trajectories"
    missing = [each for each in (folder, out) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for each in missing:
            each.rmdir()
    except OSError as error:
        raise ControllerFileError(f"cannot write to {out}: {error.strerror}") from error


def controller_and_task(controller: str, flags: TaskFlags) -> tuple[Path, Task]:
    """The controller file and its task; a run folder brings its own task."""
    path, file = Path(controller), controller_file(controller)
    if path.is_dir():
        return file, flags.load_beside(path)
    if (path.parent / TASK_FILE).is_file():
        return path, flags.load_beside(path.parent)
    return path, flags.load()


def controller_file(controller: str) -> Path:
    """The controller file of a path, which may be that of a run folder."""
    path = Path(controller)
    if path.is_dir():
        file = path / "controller.py"
        if not file.is_file():
            raise ControllerFileError(_without_controller(path))
        return file
    if not path.is_file():
        raise ControllerFileError(f"no controller {controller!r}: no such file")
    if path.suffix != ".py":
        raise ControllerFileError(f"{controller!r} is not a controller: expected a .py")
    return path


def _without_controller(folder: Path) -> str:
    """Why a folder has no controller, and what to do."""
    from tdac_agent.runs.run_record import RUN_FILE, load_run  # slow to import

    if (folder / RUN_FILE).is_file():
        from tdac_agent.runs.resume import resume_line

        command = resume_line(load_run(folder), folder)
        return f"the run {folder} has no controller yet; to continue it: {command}"
    return f"there is no controller.py in {folder}"


def write_junit(report: Report, path: Path) -> None:
    """Writes a JUnit XML file with a test case per expected test."""
    from xml.etree import ElementTree

    messages = {failure.test: failure.message for failure in report.failures}
    suite = ElementTree.Element(
        "testsuite",
        name=f"tdac {report.provenance.task}",
        tests=str(report.verdict.expected),
        failures=str(report.verdict.failed_tests),
        time=str(report.seconds),
    )
    for name in report.tests:
        file, _, test = name.partition("::")
        case = ElementTree.SubElement(suite, "testcase", classname=file, name=test)
        if name in messages:
            ElementTree.SubElement(case, "failure", message=messages[name])
    try:
        write_atomic(path, ElementTree.tostring(suite, encoding="utf-8"))
    except OSError as error:
        raise ControllerFileError(f"cannot write {path}: {error.strerror}") from error
