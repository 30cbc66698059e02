"""The blind confirmation of a controller that has passed its tests."""

from __future__ import annotations

from pathlib import Path

from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part, identity_of
from tdac_agent.runs.mark import wrote
from tdac_agent.runs.run_record import Run
from tdac_agent.sandbox import Limits
from tdac_agent.storage.files import read_inside
from tdac_agent.storage.hashes import sha256_of, sha256_of_file
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.installation import SEED_BITS, seed_from
from tdac_agent.tasks.task import Task
from tdac_agent.verification.drive_episodes import Request, drive
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.confirming import confirming_test
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.run_episodes import Watch
from tdac_agent.verification.store import is_about, read_report
from tdac_agent.verification.verify import read_source
from tdac_envs.core.intake import RECORD_BYTES

CONFIRMATION, CONFIRMATION_FILE = "confirmation", "confirmation.json"
"""Folder of the report in that of a candidate; the report in that of a run."""
DISTURBANCE = Disturbance(range_noise=0.02, wheel_slip=0.03, delay=0)
FIRST_SEED = 2**36
"""Greater than all seeds whose episodes may be told to a model."""


def confirm(
    controller: str | bytes | Path,
    task: Task,
    number: int = 0,
    *,
    tier: str = "auto",
    limits: Limits | None = None,
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
) -> EpisodeReport:
    """Drives a controller blind, from starts and with disturbances it has never seen.

    The starts depend on the controller, the task, the number and a secret of this
    installation: the same file gets the same verdict, and no author can predict them.

    Args:
        controller: Path of the file, or its source.
        task: The task.
        number: Number of this confirmation in a run, from 1; 0 if it stands alone. See
            `confirming_test`.
        tier: Sandbox tier; `auto` for the best one on this machine.
        limits: Limits of the controller's process in each episode.
        out: Folder for `episodes.json` and `trajectories/`.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Returns:
        The report, which has passed if at most one drive failed.

    Raises:
        ControllerFileError: The file cannot be read.
        Fault: The sandbox is broken; the controller neither passes nor fails.
        RunError: A link leads out of `out`, where the results are written.
    """
    source = read_source(controller)
    test = confirming_test(number)
    request = Request(
        PolicySpec("controller"),
        sha256_of(source),
        episodes_of(task),
        Part(confirming_seeds(source, task, number), disturbance=disturbance_of(task)),
        source,
        test,
        tier=tier,
        limits=limits,
        trajectories=True,
    )
    return drive(request, out, judge, watch)


def disturbance_of(task: Task) -> Disturbance:
    """What disturbs blind drives: what robot and task say, or else noise and slip."""
    return task.own_disturbance() if task.says_disturbances else DISTURBANCE


def read_confirmation(run: Run) -> EpisodeReport | None:
    """The confirmation of the controller of a run; None if there is none.

    A file that the run did not write, or that is about another controller, is none.
    """
    try:
        content = read_inside(run.folder, CONFIRMATION_FILE, RECORD_BYTES)
        report = EpisodeReport.model_validate_json(content)
        controller = sha256_of_file(run.controller)
    except (OSError, ValueError):
        return None
    same = report.provenance.controller_sha256 == controller
    return report if same and wrote(run, content) else None


def kept_confirmation(
    folder: Path, source: bytes, task: Task, number: int
) -> EpisodeReport | None:
    """The confirmation in a folder if it is that of this controller and number."""
    report = read_report(folder)
    if report is None or report.sequential is None:
        return None
    wanted = {
        "controller_sha256": sha256_of(source),
        **identity_of(episodes_of(task)),
        "first": confirming_seeds(source, task, number).start,
        "disturbance": disturbance_of(task),
    }
    same = report.sequential.test == confirming_test(number)
    return report if same and is_about(report, wanted) else None


def confirming_seeds(source: bytes, task: Task, number: int) -> range:
    """The seeds of a confirmation."""
    first = seed_from(source, f"{task.sha256()}|confirmation {number}")
    first += FIRST_SEED + (number << SEED_BITS)
    return range(first, first + confirming_test(number).limit)
