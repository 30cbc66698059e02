"""Checks a suite: the reference controller must pass it, bad controllers must fail."""

from __future__ import annotations

import contextlib
import textwrap
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_agent.sandbox import Limits
from tdac_agent.tasks.installation import seed_of
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import Profile
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.suite.privileged import (
    BAD,
    DO_NOTHING,
    REFERENCE,
    SLOW,
    privileged_controller,
    reference_paths,
)
from tdac_agent.verification.suite.proof import SuiteCheck, row_of, verdict_on_suite
from tdac_agent.verification.verify import verify

REPEATS = 5
# If steps are long, the check of the mean call time would end the slow controller late.
SLOW_LIMITS = Limits(cpu_seconds=30)
FAULT_WIDTH = 300


def check_suite(
    task: Task,
    *,
    profile: Profile | None = None,
    suite: Path | None = None,
    shipped: Path | None = None,
    tier: str = "auto",
    seed: int | None = None,
    repeats: int = REPEATS,
    bad: Sequence[str] = BAD,
    judge: WarmJudge | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> SuiteCheck:
    """Verifies the reference and the bad controllers, several times each.

    Args:
        task: Task of the controllers.
        profile: `policy` or `paper`; the task's own by default.
        suite: Folder with further tests; the task's own by default.
        shipped: Folder of tests to use instead of the shipped ones.
        tier: Sandbox tier, `auto` for the best one on this machine.
        seed: Seed of the jittered starts of all controllers; by default derived from
            the task and a secret of this installation.
        repeats: Number of verifications of each controller, which must agree. The slow
            one, whose result depends on timing, has one, of the nominal episode.
        bad: Names of the bad controllers.
        judge: A warm judge to use; a new one by default.
        on_progress: Called with a short description of the current step.

    Raises:
        ControllerFileError: The suite's folder has no tests.
        Fault: The sandbox or the suite is broken.
    """
    if repeats < 1:
        raise ValueError(f"expected at least 1 repeat, got {repeats}")
    began = time.monotonic()
    # The controllers that are known to be good or bad know nothing of movers.
    task = task.without_movers()
    # The reference's source contains its starts, so they cannot be derived from it.
    seed = seed_of(b"", task) if seed is None else seed
    with contextlib.ExitStack() as stack:
        warm = judge or stack.enter_context(WarmJudge(task=task))
        ask = partial(
            verify,
            task=task,
            suite=suite,
            shipped=shipped,
            tier=tier,
            seed=seed,
            judge=warm,
        )
        paths = reference_paths(task.nominal, seed)
        reports: dict[str, list[Report]] = {}
        for name in (REFERENCE, *bad):
            source = privileged_controller(task.nominal, paths, name)
            full = partial(ask, source, profile=profile)
            short = partial(
                ask, source, profile="policy", paper=True, limits=SLOW_LIMITS
            )
            times, verified = (1, short) if name == SLOW else (repeats, full)
            reports[name] = []
            for number in range(1, times + 1):
                on_progress(name if times == 1 else f"{name}, {number} of {times}")
                reports[name].append(verified())
    rows = [row_of(name, own) for name, own in reports.items()]
    return verdict_on_suite(reports[REFERENCE][0], rows, time.monotonic() - began)


def prove_suite(
    task: Task,
    *,
    profile: Profile | None = None,
    suite: Path | None = None,
    tier: str = "auto",
    seed: int | None = None,
    judge: WarmJudge | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> SuiteCheck:
    """The short check at the start of a run; arguments as for `check_suite`.

    The reference must pass once, and a controller that does nothing must fail once.

    Raises:
        Fault: One of them does not, or the sandbox or the suite is broken.
    """
    check = check_suite(
        task,
        profile=profile,
        suite=suite,
        tier=tier,
        seed=seed,
        repeats=1,
        bad=(DO_NOTHING,),
        judge=judge,
        on_progress=on_progress,
    )
    if not check.proven:
        first, *more = check.problems
        others = f" ({len(more)} more: tdac check-suite)" if more else ""
        reason = textwrap.shorten(first, FAULT_WIDTH, placeholder=" …")
        raise Fault(f"the suite failed its check: {reason}{others}")
    return check
