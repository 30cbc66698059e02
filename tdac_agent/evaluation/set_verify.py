"""Verifies a controller on a task set: worlds that it has never seen."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from tdac_agent.errors import RunError
from tdac_agent.evaluation.kept_sets import (
    REPORT_FILE,
    ROWS_FILE,
    TRAJECTORIES,
    UNFINISHED,
    keep_report,
    keep_sealed,
    keep_trajectories,
    unfinished,
)
from tdac_agent.evaluation.ledger import SEQUENTIAL, HiddenEvaluation, on_record
from tdac_agent.evaluation.salt import SEALED
from tdac_agent.evaluation.set_report import (
    SetProvenance,
    SetReport,
    clock_dependence,
    summarise,
)
from tdac_agent.runs.run_record import load_run
from tdac_agent.sandbox import CONFINING, Limits
from tdac_agent.sandbox.exposure import exposure
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.links import refuse_links
from tdac_agent.tasks.first_run import compile_first
from tdac_agent.tasks.provenance import versions
from tdac_agent.tasks.registry import environment
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_agent.verification.judge.set_checks import CHECKS_FILE, Checks
from tdac_agent.verification.judge.set_job import SetJob, WorldEpisode
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.seeded_run import run_job
from tdac_agent.verification.verify import read_source
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask

MOST_WORLDS = 400
"""Worlds after which a sequential test is undecided."""
MOST_EPISODES = 100_000
DEEPEST = 5
"""How many folders above a controller file its run may be."""
JUDGED = ("dev", "test", "hidden")


def verify_on_set(
    controller: str | bytes | Path,
    tasks: TaskSet,
    split: str = "test",
    worlds: int | None = None,
    *,
    first: int = 0,
    salt_file: Path | None = None,
    lineage: str | None = None,
    tier: str = "auto",
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> SetReport:
    """Tests a controller, and drives it on the worlds of a split, from `first` on.

    Each episode has a fresh sandboxed process, which is told neither split nor number.
    Without a pass in the static and contract tests, nothing is driven. An evaluation
    on hidden worlds is recorded in the user's ledger before its worlds are driven; one
    that is recorded there is answered from it.

    Args:
        controller: Path of the file, or its source (text of several lines, or bytes).
        tasks: The task set; one of files with its `hidden_folder`, if `split` is
            `hidden`.
        split: `dev`, `test` or `hidden`.
        worlds: Number of worlds, for scores. By default a sequential test of the set's
            bar decides when to stop; then there are no scores.
        first: Number of the first world; only with `worlds`, and not of hidden worlds.
        salt_file: File with the salt of the split `hidden`.
        lineage: Id of the run that wrote the controller, for the ledger; by default
            that of the run folder that the file is in, if it is in one.
        tier: Sandbox tier; `auto` for the best one on this machine.
        out: Folder for `set.json` and `trajectories/`; of hidden worlds, for `set.json`
            and `sealed/`, which only this user can read. With a number of worlds, an
            interrupted call leaves its episodes there, and the same call goes on.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Raises:
        ControllerFileError: The file cannot be read.
        TaskError: An argument is not valid, or the ledger cannot be used.
        Fault: The sandbox is broken; the controller neither passes nor fails.
        RunError: A link leads out of `out`, where the results are written.
    """
    if out is not None:
        refuse_links(out, REPORT_FILE, UNFINISHED, TRAJECTORIES, SEALED)
    one_of("split", split, JUDGED)
    whole_number("first", first, 0)
    if first > 0 and (worlds is None or split == "hidden"):
        raise TaskError("first: needs worlds, and another split than 'hidden'")
    if worlds is not None:
        whole_number("worlds", worlds, 1, MOST_EPISODES)
        tasks.check_count(split, first + worlds, "worlds")
    salt = None if salt_file is None else read_salt(salt_file)
    tasks.key(split, 0, "world", salt)  # checks that salt and split belong together
    source = read_source(controller)
    request = _Request(source, tasks, split, worlds, first, salt_file, tier)
    if request.per_world:
        return _driven(request, out, judge, watch)
    _check_hiding(request)
    about = HiddenEvaluation(
        entrant=sha256_of(source),
        set=tasks.name,
        set_sha256=tasks.sha256,
        worlds=SEQUENTIAL if worlds is None else worlds,
        salt_sha256=request.secret_sha256,
    )
    report = on_record(
        about,
        lineage or written_by(controller),
        lambda: _driven(request, out, judge, watch),
    )
    if out is not None:
        keep_report(report, out)
    return report


@dataclass(frozen=True, slots=True)
class _Request:
    """Checked arguments of `verify_on_set`."""

    source: bytes
    tasks: TaskSet
    split: str
    worlds: int | None
    first: int
    salt_file: Path | None
    tier: str

    @property
    def per_world(self) -> bool:
        """Whether single worlds may be reported."""
        return self.split != "hidden"

    @property
    def hidden_folder(self) -> Path | None:
        """Folder of the hidden worlds, if they are files."""
        files = self.tasks.files
        return None if files is None or self.per_world else files.hidden_folder

    @property
    def secret_sha256(self) -> str:
        """Hash of what hides the worlds: the salt, or the worlds of a folder."""
        if self.salt_file is not None:
            return sha256_of(read_salt(self.salt_file))
        assert self.tasks.files is not None
        assert self.tasks.files.hidden_sha256 is not None
        return self.tasks.files.hidden_sha256


def _check_hiding(request: _Request) -> None:
    """Refuses hidden worlds that a controller could find.

    Raises:
        TaskError: The sandbox does not hide files, or the salt or the folder lies
            where it shows them.
    """
    secret = request.salt_file or request.hidden_folder
    assert secret is not None
    if request.tier not in ("auto", *(each.name for each in CONFINING)):
        raise TaskError(
            f"the sandbox tier {request.tier!r} cannot keep a controller from reading "
            "files, including hidden worlds; leave out --tier"
        )
    seen, path = exposure(), secret.resolve()
    if any(path.is_relative_to(folder) for folder in (*seen.system, *seen.packages)):
        what = "salt file" if request.salt_file else "hidden folder"
        raise TaskError(
            f"{what} {secret}: controllers can read this folder, which belongs to "
            f"Python or its packages; move it"
        )


def _driven(
    request: _Request,
    out: Path | None,
    judge: WarmJudge | None,
    watch: Callable[[int, int], None] | None,
) -> SetReport:
    """Has the judge test and drive the controller, and keeps what it found."""
    began = time.monotonic()
    tasks, worlds, per_world = request.tasks, request.worlds, request.per_world
    most = most_worlds(tasks, request.split)
    test = SequentialTest(tasks.file.bar, most) if worlds is None else None
    count = most if worlds is None else worlds
    compile_for_set(tasks)
    about = {
        "controller": sha256_of(request.source),
        "set": tasks.sha256,
        "worlds": [request.split, request.first, count],
        "secret": None if per_world else request.secret_sha256,
        "sandbox": [request.tier, asdict(limits_of(tasks))],
        "versions": dict(versions()),
    }
    with (
        tempfile.TemporaryDirectory(prefix="tdac-set-") as name,
        unfinished(None if test else out, about) as driven,
    ):
        folder = Path(name)
        salt_file = request.salt_file
        kept = (driven or folder).resolve() / TRAJECTORIES
        job = SetJob(
            set_file=write_set(tasks, folder / "set.yaml"),
            split=request.split,
            salt_file=None if salt_file is None else salt_file.resolve(),
            worlds=tuple(range(request.first, request.first + count)),
            controller=folder / "controller.py",
            test=test,
            per_world=per_world,
            tier=request.tier,
            limits=limits_of(tasks),
            out=folder / "results",
            trajectories=kept if out is not None and per_world else None,
            hidden_folder=request.hidden_folder,
            kept=None if driven is None else driven.resolve() / ROWS_FILE,
        )
        write_atomic(job.controller, request.source)
        longest = tasks.file.horizon.most * tasks.file.dt * len(job.worlds)
        ended, ending = run_job(job, job.out, longest, WorldEpisode, judge, watch)
        # raw read: our temporary folder
        checks = Checks.model_validate_json((job.out / CHECKS_FILE).read_bytes())
        provenance = SetProvenance(
            set=tasks.name,
            set_sha256=tasks.sha256,
            split=request.split,
            salt_sha256=None if per_world else request.secret_sha256,
            controller_sha256=sha256_of(request.source),
            sandbox=ending.tier,
            limits=asdict(job.limits),
            versions=dict(versions()),
        )
        seconds = time.monotonic() - began
        clock = clock_dependence(request.source, ended, tasks.file.cpu)
        report = summarise(
            provenance,
            ended,
            test,
            seconds,
            per_world=per_world,
            different=tasks.different(request.split),
            checks=checks,
            clock_dependent=clock,
        )
        if out is not None and per_world:
            keep_report(report, out)
            keep_trajectories(job.trajectories, out)
        elif out is not None:
            keep_sealed(ended, out)
    return report


def written_by(controller: str | bytes | Path) -> str | None:
    """Id of the run in whose folder a controller file is; None if it is in none."""
    if isinstance(controller, bytes) or "\n" in str(controller):
        return None
    for folder in itertools.islice(Path(controller).resolve().parents, DEEPEST):
        with contextlib.suppress(RunError):
            return load_run(folder).id or None
    return None


def compile_for_set(tasks: TaskSet) -> None:
    """Compiles what worlds and robot of a set need, unless compiled code is cached."""
    movers = bool(tasks.file.movers)
    parts = environment(Map2DTask.env_id).code_parts(movers=movers, worlds=True)
    if tasks.file.unit == "m":  # its generated worlds are measured as maps
        parts += environment(EPuckTask.env_id).code_parts(movers=movers)
    compile_first(parts)


def most_worlds(tasks: TaskSet, split: str) -> int:
    """Number of worlds after which a sequential test on a split is undecided.

    It drives each world once: further runs on a world are not independent of it.
    """
    count = tasks.different(split)
    return MOST_WORLDS if count is None else min(MOST_WORLDS, count)


def limits_of(tasks: TaskSet) -> Limits:
    """The limits of an episode's process; the CPU budget ends most episodes before."""
    cpu = tasks.file.cpu
    most = cpu.start + cpu.of_steps(tasks.file.horizon.most)
    return Limits(cpu_seconds=math.ceil(2.0 * most) + 1)


def write_set(tasks: TaskSet, path: Path) -> Path:
    """Writes the set file of a set, for other processes; returns its path."""
    values = tasks.file.model_dump(mode="json", by_alias=True)
    path.write_text(json.dumps(values), encoding="utf-8")  # JSON is YAML
    return path
