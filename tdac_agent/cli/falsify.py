"""`tdac falsify`: the smallest deviation with which a policy fails."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.controller_choice import check_folder, own_folder, with_own_set
from tdac_agent.cli.driving_bar import DrivingBar
from tdac_agent.cli.falsify_flags import FalsifyOptions
from tdac_agent.cli.falsify_view import show_falsification
from tdac_agent.cli.sentences import print_plain
from tdac_agent.cli.task_changes import changed_task
from tdac_agent.cli.task_choice import check_scope, check_tier, chosen_task
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.environments.epuck.pictures import WorldPictures
from tdac_agent.environments.map2d.pictures import MapPictures
from tdac_agent.evaluation.policies import Entrant, entrant_of, fitted, prepared
from tdac_agent.evaluation.replay import drive_episode
from tdac_agent.falsify.curves import draw_curves
from tdac_agent.falsify.drives import named_disturbance
from tdac_agent.falsify.falsify import SearchPlan, falsify, space_on
from tdac_agent.option_fields import words_of
from tdac_agent.problems.part import Part
from tdac_agent.runs.falsification import PICTURE, Counterexample, Falsification
from tdac_agent.runs.falsify_text import failure_text
from tdac_agent.runs.ownership import load_task
from tdac_agent.tasks.deviation import Deviation, parsed
from tdac_agent.tasks.deviation import words_of as deviation_words
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import Points
from tdac_agent.verification.diagnosis.figures import contact_of, write_png
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.deviated import shifted_env
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.closeup import Event, with_close_up
from tdac_envs.ladder.task_sets import TaskSet, load_set
from tdac_envs.map2d.task import Map2DTask

CURVES = "curves.png"


def run(flags: TaskFlags, options: FalsifyOptions) -> int:
    """Searches, and prints what was found; 1 if it fails without a deviation."""
    check_tier(options.tier)
    if options.out is not None:
        check_folder(options.out)
    flags = with_own_set(options.policy, flags)
    check_scope(flags.set_name is not None, flags, options)
    plan = SearchPlan(
        episodes=options.episodes,
        seed=options.seed,
        space=None if options.space is None else parsed(options.space),
        split=options.split,
        worlds=options.worlds,
        curves=options.curves,
        physics=options.physics,
    )
    console = Console(stderr=options.as_json)
    with ChildPool() as child_pool:
        problem = _problem(flags, options.policy)
        space_on(problem, plan)  # fails early
        entrant = _ready(options.policy, problem, options.tier)
        with WarmJudge(child_pool) as judge:
            where = options.tier, options.out, judge
            found = search(entrant, problem, plan, console, *where)
    if options.as_json:
        print_json(found)
    else:
        show_falsification(found, console, _replay(found, entrant, flags, options))
        if options.out is not None:
            written = ["falsify.json", *pictures_in(found)]
            print_plain(console, f"wrote {', '.join(written)} to {options.out}")
    return 1 if found.fails_plainly else 0


def search(
    entrant: Entrant,
    problem: Task | TaskSet,
    plan: SearchPlan,
    console: Console,
    tier: str,
    out: Path | None,
    judge: WarmJudge | None = None,
    go_on: str = "",
) -> Falsification:
    """Searches with a progress bar, and draws; arguments as for `falsify`.

    Args:
        entrant: The policy.
        problem: Where it drives.
        plan: What is searched.
        console: Console to print to.
        tier: Sandbox tier.
        out: Folder of the record and the pictures.
        judge: A warm judge.
        go_on: The command that goes on after an interruption; by default the same one.
    """
    cut = "nothing of it is kept; with --out DIR, the same command could go on"
    if out is not None:
        cut = f"what was driven is kept: {go_on or 'the same command'} goes on from "
        cut += f"{out}"
    bar = DrivingBar(
        console, plan.episodes, "episodes", is_long=True, cut=cut, reaching=False
    )
    with bar:
        return falsify(
            entrant,
            problem,
            plan,
            tier=tier,
            out=out,
            judge=judge,
            watch=bar.show_count,
            finish=lambda found: write_pictures(found, entrant, problem, out, tier),
        )


def show_envelope(
    controller: str,
    problem: Task | TaskSet,
    episodes: int,
    console: Console,
    tier: str,
    out: Path | None,
) -> Falsification:
    """What follows a verdict with `--envelope`: the search, and what it found.

    Args:
        controller: Controller file, or run folder.
        problem: Where it was judged.
        episodes: Most episodes.
        console: Console to print to; nothing is printed if it is stderr.
        tier: Sandbox tier.
        out: Folder for the record and the picture.
    """
    entrant = _ready(controller, problem, tier)
    plan = SearchPlan(episodes=episodes)
    # Where the task is another one than the controller's own, flags are missing.
    own = isinstance(problem, TaskSet) or Path(controller).is_dir()
    words = ["tdac", "falsify", controller, "-n", str(episodes), "--out", str(out)]
    go_on = shlex.join(words) if own else ""
    found = search(entrant, problem, plan, console, tier, out, go_on=go_on)
    if not console.stderr:
        console.print()
        options = FalsifyOptions(controller, tier=tier)
        replay = _replay(found, entrant, TaskFlags(), options)
        show_falsification(found, console, replay if own else ())
    return found


def _ready(policy: str, problem: Task | TaskSet, tier: str) -> Entrant:
    """The policy as it drives there; on a task, `builtin` is written now."""
    return prepared(fitted(entrant_of(policy), problem), problem, tier)[0]


def _problem(flags: TaskFlags, policy: str) -> Task | TaskSet:
    if flags.set_name is not None:
        return load_set(flags.set_name)
    folder = own_folder(policy, flags) if Path(policy).exists() else None
    if folder is None or policy.endswith(".zip"):
        return chosen_task(flags)
    return changed_task(load_task(folder), flags)


def _replay(
    found: Falsification, entrant: Entrant, flags: TaskFlags, options: FalsifyOptions
) -> Sequence[str]:
    """The command that plays the counterexample; empty if `tdac play` cannot."""
    failed = found.counterexample
    if failed is None or (found.split is None and entrant.kind != "controller"):
        return ()
    words = ["tdac", "play", options.policy, *words_of(flags)]
    if found.split is not None:
        words += ["--index", str(failed.number), "--split", found.split]
    elif failed.number:
        words += ["--seed", str(failed.number)]
    if failed.deviation.parts():
        words += ["--deviation", deviation_words(failed.deviation)]
    return words if options.tier == "auto" else [*words, "--tier", options.tier]


def write_pictures(
    found: Falsification,
    entrant: Entrant,
    problem: Task | TaskSet,
    out: Path | None,
    tier: str,
) -> None:
    """Draws the counterexample beside the undisturbed drive, and the curves."""
    failed = found.counterexample
    if out is not None and failed is not None:
        write_png(_picture(found, failed, entrant, problem, tier), out / PICTURE)
    if out is not None and found.curves:
        draw_curves(found, out / CURVES)


def pictures_in(found: Falsification) -> list[str]:
    """Names of the pictures of a search."""
    drawn = (PICTURE, found.counterexample is not None), (CURVES, bool(found.curves))
    return [name for name, exists in drawn if exists]


def _picture(
    found: Falsification,
    failed: Counterexample,
    entrant: Entrant,
    problem: Task | TaskSet,
    tier: str,
) -> Image:
    rollouts, labels = [], []
    chosen = [failed.deviation]
    if failed.deviation.parts():  # what fails is drawn on top
        chosen.insert(0, Deviation())
    for deviation in chosen:
        part = part_of(problem, failed.number, found.split)
        driven = drive_episode(entrant, problem, part, tier, deviation)
        rollouts.append(driven.rollout)
        labels.append(found.in_words(deviation).encode("ascii", "replace").decode())
    pictures = pictures_of(problem, failed.deviation, found.split, failed.number)
    runs: list[Points] = [each.trajectory.poses for each in rollouts]
    whole: Image = pictures.trajectories(runs, [r.outcome for r in rollouts], labels)
    last = rollouts[-1]
    text = failure_text(failed, found).replace("°", " deg")
    event = Event(
        title=failed.row.cause or last.outcome,
        facts=(text.encode("ascii", "replace").decode(),),
        where=runs[-1][-1:, :2],
        contact=contact_of(pictures.nominal, last.trajectory, last.outcome),
    )
    return with_close_up(whole, pictures.backdrop(), runs[-1], event)


def part_of(problem: Task | TaskSet, number: int, split: str | None) -> Part:
    """The episode of a number, undisturbed unless the problem says otherwise."""
    if not isinstance(problem, Task):
        return Part((number,), split or "dev")
    own = named_disturbance(problem)
    return Part((number,), disturbance=own, variation="nominal")


def pictures_of(
    problem: Task | TaskSet, deviation: Deviation, split: str | None, number: int
) -> Any:
    """The pictures of a world, with its obstacles where the deviation shifts them."""
    if isinstance(problem, Task):
        nominal: Any = shifted_env(problem, deviation, Disturbance.none()).nominal
    else:
        nominal = problem.task(split or "dev", number)
    if isinstance(nominal, Map2DTask):
        return MapPictures(nominal)
    return WorldPictures(nominal)
