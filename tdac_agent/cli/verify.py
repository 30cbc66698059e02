"""`tdac verify`: tests a controller in the sandbox and prints the report."""

from __future__ import annotations

import gc
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdac_agent.cli.controller_choice import (
    change_note,
    check_folder,
    controller_and_task,
    controller_file,
    with_own_set,
)
from tdac_agent.cli.spinner import Spinner
from tdac_agent.cli.task_choice import check_scope, check_set_profile, check_tier
from tdac_agent.cli.typed_options import require_flag
from tdac_agent.option_fields import flag_name, typed_fields, words_of
from tdac_agent.tasks.trust import allowed
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.errors import TaskError

if TYPE_CHECKING:
    from tdac_agent.cli.console import Console
    from tdac_agent.cli.driving_bar import DrivingBar
    from tdac_agent.cli.shared_options import NoiseFlags
    from tdac_agent.cli.task_flags import TaskFlags
    from tdac_agent.cli.verify_options import VerifyOptions
    from tdac_agent.runs.falsification import Falsification
    from tdac_agent.tasks.task import Task
    from tdac_agent.verification.diagnosis.report import Report
    from tdac_agent.verification.episode_report import EpisodeReport
    from tdac_envs.ladder.task_sets import TaskSet


def run(
    flags: TaskFlags, options: VerifyOptions, noise: NoiseFlags, child_pool: ChildPool
) -> int:
    """Verifies a controller and prints the report; returns the exit code."""
    check_tier(options.tier)
    if options.recorded is not None:
        from tdac_agent.cli.recorded import run_recorded

        return run_recorded(flags, options, noise)
    _check_robust(options, noise)
    if options.out is not None:
        check_folder(options.out)
    flags = with_own_set(options.controller, flags)
    check_scope(flags.set_name is not None, flags, options)
    if flags.set_name is not None:
        return _verify_on_set(flags.set_name, options, noise, child_pool)
    return _verify_on_task(flags, options, noise, child_pool)


def _check_robust(options: VerifyOptions, noise: NoiseFlags) -> None:
    """Checks the flags of a robust verification before anything is run.

    Raises:
        TaskError: A flag needs another one, or a value is out of range.
    """
    if options.episodes is None:
        require_flag("-n N", typed_fields(noise))
    elif options.accept_at is not None:
        SequentialTest(options.accept_at, options.episodes, options.margin)


def _disturbed(tasks: TaskSet, options: VerifyOptions, noise: NoiseFlags) -> TaskSet:
    """The set with the typed disturbances.

    Raises:
        TaskError: They are not possible there, or hidden worlds were chosen.
    """
    typed = typed_fields(noise)
    if typed and options.split == "hidden":
        raise TaskError(
            f"{flag_name(typed[0])}: hidden worlds are driven with the set's own "
            "disturbances; give --split test, or leave it out"
        )
    return noise.on_set(tasks)


def _verify_on_task(
    flags: TaskFlags, options: VerifyOptions, noise: NoiseFlags, child_pool: ChildPool
) -> int:
    with Spinner("preparing the task …") as spinner:
        if typed_fields(flags):  # it is built anew
            spinner()
        file, task = controller_and_task(options.controller, flags)
    task = allowed(task, options.suite, trust=options.trust)
    if options.episodes is not None:
        noise.disturbance(task)
    _freeze()
    with WarmJudge(child_pool) as judge:
        report = _report(file, task, options, judge)
        # Imported late: the judge has worked meanwhile.
        from tdac_agent.cli.console import Console, print_json
        from tdac_agent.cli.report_view import show_report
        from tdac_agent.cli.sentences import print_plain

        console, units = Console(stderr=options.as_json), task.setting.shown
        if note := change_note(options.controller, flags):
            print_plain(console, note)
        if not options.as_json:
            show_report(report, console, options.out, task.folder, units)
        robust = confirmation = None
        if options.episodes is not None and report.passed:
            robust = _measure(file, task, options, noise, judge)
        elif report.passed and options.confirm and not options.paper:
            confirmation = _confirm(file, task, options, judge)
    if options.junit is not None and confirmation is not None:
        from tdac_agent.cli.junit import write_junit

        write_junit(report, options.junit, confirmation)
    if options.as_json:
        print_json(_record(report, options, task, robust, confirmation))
    elif robust is not None:
        from tdac_agent.cli.robust_view import show_robust

        show_robust(robust, console, _replay(flags, options, noise), units)
    elif confirmation is not None:
        from tdac_agent.cli.robust_view import show_confirmation

        drove_with = confirmation.provenance.disturbance
        assert drove_with is not None
        play = _replay(flags, options, type(noise).of(drove_with))
        show_confirmation(confirmation, console, play[1:], units)
    elif options.episodes is not None:
        console.print("robustness not measured: the controller failed its tests")
    if report.passed and not options.as_json:
        _envelope(task, options, console)
    return _code(report, robust, confirmation)


def _code(
    report: Report, robust: EpisodeReport | None, confirmation: EpisodeReport | None
) -> int:
    """The exit code: 0 for a verdict, or a pass without blind drives."""
    if confirmation is not None:
        from tdac_agent.verification.verdict import is_verified

        return 0 if is_verified(confirmation) else 1
    return 0 if report.passed and (robust is None or robust.passed) else 1


def _envelope(
    problem: Task | TaskSet, options: VerifyOptions, console: Console
) -> Falsification | None:
    """Searches for the smallest failure, if that is wanted."""
    if options.envelope is None:
        return None
    from tdac_agent.cli.falsify import show_envelope

    where = options.tier, options.out
    return show_envelope(options.controller, problem, options.envelope, console, *where)


def _report(file: Path, task: Task, options: VerifyOptions, judge: WarmJudge) -> Report:
    # Imported while the judge starts.
    from tdac_agent.verification.verify import verify

    with Spinner(f"verifying {file.name} on {task.name} …") as spinner:
        report = verify(
            file,
            task,
            profile=options.profile,
            paper=options.paper,
            tier=options.tier,
            seed=options.seed,
            out=options.out,
            judge=judge,
            meanwhile=spinner,
            physics=options.physics,
            require_physics=options.require_physics,
        )
    if options.junit is not None:  # it is written again after blind drives
        from tdac_agent.cli.junit import write_junit

        write_junit(report, options.junit)
    if report.passed and not report.provenance.paper:
        about = report.provenance
        _print_marked(file, about.task_sha256, about.profile)
    return report


def _print_marked(file: Path, sha256: str, profile: str) -> None:
    """Marks a run of an earlier version anew, and says so."""
    from tdac_agent.runs.ownership import mark_verified

    again = mark_verified(file, sha256, profile)
    print(again, end="\n" * bool(again), file=sys.stderr)


def _freeze() -> None:
    """Lets the garbage collector work again, except on what was imported."""
    gc.freeze()
    gc.enable()


def _measure(
    file: Path, task: Task, options: VerifyOptions, noise: NoiseFlags, judge: WarmJudge
) -> EpisodeReport:
    """Runs the disturbed episodes with a progress bar."""
    from tdac_agent.cli.console import Console
    from tdac_agent.cli.driving_bar import DrivingBar
    from tdac_agent.cli.sentences import print_plain

    assert options.episodes is not None
    console = Console(stderr=options.as_json)
    doing, cut = "disturbed episodes", "no success rate computed"
    bar = DrivingBar(console, options.episodes, doing, is_long=True, cut=cut)
    try:
        with bar:
            return _driven(
                file,
                task,
                options,
                judge,
                bar,
                disturbance=noise.disturbance(task),
                accept_at=options.accept_at,
                margin=options.margin,
            )
    except KeyboardInterrupt:
        if options.out is not None:
            rest = "contains the report of the suite, but no episodes.json"
            print_plain(console, f"{options.out} {rest}")
        raise


def _confirm(
    file: Path, task: Task, options: VerifyOptions, judge: WarmJudge
) -> EpisodeReport:
    """Drives blind, with a progress bar."""
    from tdac_agent.cli.console import Console
    from tdac_agent.cli.driving_bar import DrivingBar
    from tdac_agent.verification.confirmation import CONFIRMATION, confirm
    from tdac_agent.verification.judge.confirming import confirming_test

    console, most = Console(stderr=options.as_json), confirming_test().limit
    cut = "not verified"
    with DrivingBar(console, most, "blind drives", is_long=True, cut=cut) as bar:
        out = None if options.out is None else options.out / CONFIRMATION
        return confirm(
            file, task, tier=options.tier, out=out, judge=judge, watch=bar.show
        )


def _driven(
    file: Path,
    problem: Task | TaskSet,
    options: VerifyOptions,
    judge: WarmJudge,
    bar: DrivingBar,
    **own: Any,
) -> EpisodeReport:
    """Drives the episodes of a task, or on worlds of a set."""
    from tdac_agent.verification.verify_episodes import verify_episodes

    return verify_episodes(
        file,
        problem,
        options.episodes,
        first=options.first,
        tier=options.tier,
        out=options.out,
        judge=judge,
        watch=bar.show,
        **own,
    )


def _record(
    report: Report,
    options: VerifyOptions,
    task: Task,
    robust: EpisodeReport | None,
    confirmation: EpisodeReport | None,
) -> Any:
    """The report with the key `robust` or `confirmation`, null if it was not run."""
    measured = options.episodes is not None
    name, found = ("robust", robust) if measured else ("confirmation", confirmation)
    added = None if found is None else found.model_dump(mode="json")
    whole = {**report.model_dump(mode="json"), name: added}
    if report.passed and options.envelope is not None:
        from tdac_agent.cli.console import Console

        envelope = _envelope(task, options, Console(stderr=True))
        whole["envelope"] = envelope and envelope.model_dump(mode="json")
    return whole


def _replay(flags: TaskFlags, options: VerifyOptions, noise: NoiseFlags) -> list[str]:
    """The command line that plays one of the disturbed episodes, without `--seed`."""
    words = ["tdac", "play", options.controller, *words_of(flags), *words_of(noise)]
    return words if options.tier == "auto" else [*words, "--tier", options.tier]


def _verify_on_set(
    name: str, options: VerifyOptions, noise: NoiseFlags, child_pool: ChildPool
) -> int:
    """Drives a controller on a set and prints the report; returns the exit code."""
    from tdac_agent.cli.console import Console, print_json
    from tdac_agent.cli.driving_bar import DrivingBar
    from tdac_agent.cli.set_view import show_next_steps, show_set_report
    from tdac_agent.runs.ownership import load_set_problem
    from tdac_agent.verification.verify_episodes import SEED_ON_SETS, most_worlds

    if options.hidden_folder is not None and options.split != "hidden":
        raise TaskError("--hidden-folder needs --split hidden")
    check_set_profile(options.profile)
    problem = load_set_problem(name, options.hidden_folder)
    problem = problem.allowed(options.suite, trust=options.trust)
    tasks, suite = _disturbed(problem.tasks, options, noise), problem.suite
    if options.seed is not None and suite is None:
        raise TaskError(SEED_ON_SETS)
    file = _controller_on(tasks, options)
    _freeze()
    most = options.episodes or most_worlds(tasks, options.split)
    console = Console(stderr=options.as_json)
    doing, cut = f"worlds of {tasks.name}", "no success rate computed"
    bar = DrivingBar(console, most, doing, is_long=True, cut=cut)
    with WarmJudge(child_pool) as judge, bar:
        report = _driven(
            file,
            tasks,
            options,
            judge,
            bar,
            split=options.split,
            salt_file=options.salt_file,
            suite=suite,
            seed=options.seed,
        )
    if report.passed and report.sequential is not None:
        _print_marked(file, report.provenance.sha256, "policy")
    if options.junit is not None:
        from tdac_agent.cli.junit import write_set_junit

        write_set_junit(report, options.junit)
    if options.as_json:
        print_json(report)
    else:
        show_set_report(report, console)
        how = [options.controller, "--set", name, *words_of(noise)]
        show_next_steps(report, how, options.out, console)
    if report.passed:
        _envelope(tasks, options, console)
    return 0 if report.passed else 1


def _controller_on(tasks: TaskSet, options: VerifyOptions) -> Path:
    """The controller file; also checks that the set has so many worlds."""
    from tdac_agent.builtin.level import controller_of

    if options.controller == "builtin":
        file = controller_of(tasks, "give a file")
    else:
        file = controller_file(options.controller)
    if options.episodes is not None:
        worlds = (options.first or 0) + options.episodes
        tasks.check_count(options.split, worlds, "-n")
    return file
