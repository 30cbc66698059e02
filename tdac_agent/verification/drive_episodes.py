"""Drives a policy of any kind in episodes of a problem, and reports on them."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from tdac_agent.problems.part import Episodes, Part, identity_of
from tdac_agent.sandbox import CONFINING, Limits
from tdac_agent.sandbox.exposure import exposure
from tdac_agent.storage.links import refuse_links
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.episode_report import (
    EpisodeProvenance,
    EpisodeReport,
    clock_dependence,
    summarise,
)
from tdac_agent.verification.judge.confirming import EndingTest
from tdac_agent.verification.judge.episode_job import EpisodeJob
from tdac_agent.verification.judge.policy_spec import PolicySpec, written
from tdac_agent.verification.judge.set_checks import CHECKS_FILE, Checks, checks_of
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.ledger import SEQUENTIAL, HiddenEvaluation, on_record
from tdac_agent.verification.run_episodes import Watch, run_episodes
from tdac_agent.verification.store import (
    ROWS_FILE,
    TRAJECTORIES,
    WRITTEN,
    keep_report,
    keep_sealed,
    keep_trajectories,
    mark_rows,
    unfinished,
)
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.physics.moved import EXACT

MARKING = 20.0
"""Time between two marks of what has been driven, relative to that of making one."""


@dataclass(frozen=True, slots=True)
class Request:
    """A policy, and the episodes in which it drives.

    Attributes:
        policy: The policy.
        sha256: Hash of its file.
        episodes: The task or the task set.
        part: Which of its episodes.
        source: Source of a controller, instead of its file.
        test: A test that may end them early; then there are no scores.
        lineage: Id of the run that wrote a controller, if one did.
        patience: Time-outs after which the rest is skipped; None for never.
        tier: Sandbox tier; `auto` for the best one on this machine.
        limits: Limits of a controller's process; those of the problem by default.
        trajectories: Whether the trajectories of public episodes are kept.
        own_tests: Runs the user's own tests on a set; without a pass, nothing is
            driven.
        weights: Content of the controller's weights, if it has any.
    """

    policy: PolicySpec
    sha256: str
    episodes: Episodes
    part: Part
    source: bytes | None = None
    test: EndingTest | None = None
    lineage: str | None = None
    patience: int | None = None
    tier: str = "auto"
    limits: Limits | None = None
    trajectories: bool = False
    own_tests: Callable[[], Report] | None = None
    weights: bytes | None = None


def drive(
    request: Request,
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
) -> EpisodeReport:
    """Has the judge drive a policy, and reports on its episodes.

    A controller has a fresh sandboxed process in each episode, which is told neither
    split nor number. Before hidden worlds are driven, that is recorded in the user's
    ledger; what is recorded there is answered from it.

    Args:
        request: Who drives, and where.
        out: Folder for `episodes.json` and `trajectories/`; of hidden worlds, for
            `episodes.json` and `sealed/`, which only this user can read. Without a
            sequential test, an interrupted call leaves its episodes there, and the
            same call goes on.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Raises:
        TaskError: The policy does not drive there, or the ledger cannot be used.
        Fault: The sandbox is broken; the controller neither passes nor fails.
        RunError: A link leads out of `out`, where the results are written.
    """
    if out is not None:
        refuse_links(out, *WRITTEN)
    policy, own, part = request.policy, request.episodes, request.part
    own.check(policy)
    secret = None if policy.kind == "privileged" else own.secret(part)
    if secret is not None and policy.kind == "controller":
        _check_hiding(request)
    tests = None if request.own_tests is None else request.own_tests()
    if tests is not None and not tests.passed:
        report = _refused(request, tests)
    elif secret is None:
        report = _driven(request, out, judge, watch)
    else:
        report = _recorded(request, secret, out, judge, watch)
    if tests is not None:
        # They are not in the ledger: others may be given next time.
        outcomes = report.tests | checks_of(tests).outcomes
        report = report.model_copy(update={"tests": outcomes})
    if out is not None and (secret is not None or tests is not None):
        keep_report(report, out)
    return report


def _recorded(
    request: Request,
    secret: str,
    out: Path | None,
    judge: WarmJudge | None,
    watch: Watch | None,
) -> EpisodeReport:
    """The report on hidden worlds, from the ledger or driven now."""
    own = request.episodes
    about = HiddenEvaluation(
        entrant=request.sha256,
        set=own.name,
        set_sha256=own.sha256,
        dynamics=own.dynamics,
        worlds=SEQUENTIAL if request.test else len(request.part.numbers),
        salt_sha256=secret,
    )
    return on_record(
        about, request.lineage, lambda: _driven(request, out, judge, watch)
    )


def _refused(request: Request, tests: Report) -> EpisodeReport:
    """The report on a controller that failed tests, so that nothing was driven."""
    tier, limits = tests.provenance.sandbox, request.limits or request.episodes.limits
    facts = request.episodes.provenance(
        request.part, Path(), request.sha256, tier, limits
    )
    about = EpisodeProvenance.model_validate(facts)
    return summarise(about, (), None, tests.seconds, checks=checks_of(tests))


def _check_hiding(request: Request) -> None:
    """Refuses hidden worlds that a controller could find.

    Raises:
        TaskError: The sandbox does not hide files, or the salt or the folder lies
            where it shows them.
    """
    if request.tier not in ("auto", *(each.name for each in CONFINING)):
        raise TaskError(
            f"the sandbox tier {request.tier!r} cannot keep a controller from reading "
            "files, including hidden worlds; leave out --tier"
        )
    salt_file, seen = request.part.salt_file, exposure()
    place = salt_file or request.episodes.hidden_folder
    assert place is not None
    shown = (*seen.system, *seen.packages)
    if any(place.resolve().is_relative_to(folder) for folder in shown):
        what = "salt file" if salt_file else "hidden folder"
        raise TaskError(
            f"{what} {place}: controllers can read this folder, which belongs to "
            f"Python or its packages; move it"
        )


def _driven(
    request: Request,
    out: Path | None,
    judge: WarmJudge | None,
    watch: Watch | None,
) -> EpisodeReport:
    """Has the judge test and drive the policy, and keeps what it found."""
    began = time.monotonic()
    own, part, policy = request.episodes, request.part, request.policy
    told, is_file = not part.is_hidden, policy.kind == "controller"
    limits = request.limits or own.limits
    own.compile()
    about = {
        "policy": [policy.kind, policy.wrappers, request.sha256],
        "problem": identity_of(own),
        "part": [part.split, list(part.numbers), part.variation, str(part.disturbance)],
        "secret": own.secret(part),
        "sandbox": [request.tier, asdict(limits), request.patience],
        "versions": dict(versions()),
        **({} if part.physics == EXACT else {"physics": part.physics}),
    }
    with (
        tempfile.TemporaryDirectory(prefix="tdac-drive-") as name,
        unfinished(None if request.test else out, about) as kept,
    ):
        folder = Path(name)
        policy = written(policy, folder, request.source, request.weights)
        lasting = (kept or folder).resolve()
        keeps = request.trajectories and told and out is not None
        job = EpisodeJob(
            worlds=own.worlds(part, folder, policy),
            policy=policy,
            numbers=tuple(part.numbers),
            checks=own.checks and is_file,
            test=request.test,
            told=told,
            patience=request.patience,
            tier=request.tier,
            limits=limits,
            out=folder / "results",
            rows=None if kept is None else lasting / ROWS_FILE,
            trajectories=lasting / TRAJECTORIES if keeps else None,
        )
        seen = watch if kept is None else _Marking(kept, watch)
        rows, ending = run_episodes(job, own.longest, judge, seen)
        facts = own.provenance(part, folder, request.sha256, ending.tier, limits)
        checks, clock = None, None
        if job.checks:
            # raw read: our temporary folder
            content = (job.out / CHECKS_FILE).read_bytes()
            checks = Checks.model_validate_json(content)
        if own.cpu is not None and is_file:
            assert policy.file is not None
            source = read_file(policy.file, RECORD_BYTES)
            clock = clock_dependence(source, rows, own.cpu)
        report = summarise(
            EpisodeProvenance.model_validate(facts),
            rows,
            request.test,
            time.monotonic() - began,
            told=told,
            different=own.different(part),
            checks=checks,
            clock_dependent=clock,
        )
        if out is not None and told:
            keep_report(report, out)
            keep_trajectories(job.trajectories, out)
        elif out is not None:
            keep_sealed(rows, out)
    return report


@dataclass(slots=True)
class _Marking:
    """Marks the rows of an unfinished call, in a small part of the time.

    Attributes:
        kept: Its folder.
        watch: Called with the numbers of episodes and successes so far.
    """

    kept: Path
    watch: Watch | None
    _next: float = 0.0

    def __call__(self, count: int, successes: int) -> None:
        """Takes over the numbers."""
        began = time.monotonic()
        if began >= self._next:
            mark_rows(self.kept)
            ended = time.monotonic()
            self._next = ended + MARKING * (ended - began)
        if self.watch is not None:
            self.watch(count, successes)
