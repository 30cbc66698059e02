"""Evaluates policies of any kind on the same worlds of a task set."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.evaluation.entrants import Entrant
from tdac_agent.evaluation.evaluate import EPISODES
from tdac_agent.evaluation.finished import EPISODE_TABLE, RESULTS
from tdac_agent.evaluation.kept_sets import kept_report
from tdac_agent.evaluation.set_entrants import set_entrants
from tdac_agent.evaluation.set_evaluation import (
    SetEvaluation,
    SetPolicy,
    comparisons_of,
    row_of,
)
from tdac_agent.evaluation.set_learned import LearnedRuns
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.evaluation.set_verify import MOST_EPISODES, verify_on_set
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.locks import own_folder
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.core.intake import parse_json, read_file
from tdac_envs.ladder.task_sets import TaskSet

POLICIES = "policies"
"""Folder with the episodes of each policy."""
SHOWN = ("dev", "test")
_MOST_BYTES = 512 << 20
Watch = Callable[[str, int, int], None]


def evaluate_on_set(
    policies: Sequence[str | Path],
    tasks: TaskSet,
    split: str = "test",
    worlds: int = EPISODES,
    *,
    wrappers: Sequence[str] | None = None,
    tier: str = "auto",
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
) -> SetEvaluation:
    """Drives policies on the same worlds of a split, from world 0 on.

    Controllers drive as in `verify_on_set`, in a fresh sandboxed process for each
    episode. Learned policies drive in this process, in the same environments; only
    their weights are read, and they get observations alone.

    Args:
        policies: Any mix of controller files, run folders, `.zip` files saved by
            stable-baselines3, and `builtin`.
        tasks: The task set.
        split: `dev` or `test`.
        worlds: Number of worlds.
        wrappers: Wrappers of saved policies that do not record their own.
        tier: Sandbox tier; `auto` for the best one on this machine.
        out: Folder for `evaluation.json`, `episodes.csv`, and in `policies/` what
            `verify_on_set` writes for each policy. After an interruption, the same call
            does not drive finished policies again; a finished evaluation is returned.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with policy, episodes and successes so far.

    Raises:
        TaskError: An argument is not valid.
        ControllerFileError: A file cannot be read, is no policy, or is a policy that
            was trained elsewhere.
        RunError: Another evaluation is in `out`, or writes to it.
        Fault: The sandbox is broken.
    """
    if split == "hidden":
        raise TaskError(
            "hidden worlds are evaluated one controller at a time, and counted: tdac "
            f"verify FILE --set {tasks.name} --split hidden --salt-file FILE"
        )
    one_of("split", split, SHOWN)
    whole_number("worlds", worlds, 1, MOST_EPISODES)
    tasks.check_count(split, worlds, "worlds")
    tasks.key(split, 0, "world")  # checks that the set has this split
    entrants = set_entrants(policies, tasks, wrappers)
    learned = {
        entrant.name: LearnedRuns.of(entrant, tasks, split)
        for entrant in entrants
        if entrant.policy.kind == "sb3"
    }
    about: dict[str, Any] = {
        "set": tasks.name,
        "set_sha256": tasks.sha256,
        "split": split,
        "worlds": worlds,
        "policies": tuple(_about(entrant, tasks) for entrant in entrants),
        "versions": dict(versions()),
    }
    with contextlib.ExitStack() as stack:
        if out is not None:
            _open(out, about, stack)
        reports = []
        for entrant in entrants:
            folder = None if out is None else out / POLICIES / _folder_of(entrant)
            assert entrant.sha256 is not None
            report = None
            if folder is not None:
                report = kept_report(
                    folder, entrant.sha256, tasks.sha256, split, worlds
                )
            if report is None:
                runs = learned.get(entrant.name)
                seen = _watch_of(entrant.name, watch)
                if runs is not None:
                    report = runs.report(worlds, folder, seen)
                else:
                    if judge is None:
                        judge = stack.enter_context(WarmJudge())
                    assert entrant.policy.file is not None
                    report = verify_on_set(
                        entrant.policy.file,
                        tasks,
                        split,
                        worlds,
                        tier=tier,
                        out=folder,
                        judge=judge,
                        watch=seen,
                    )
            reports.append(report)
        found = _evaluation(about, tuple(reports))
        if out is not None:
            write_atomic(out / EPISODE_TABLE, found.to_frame().to_csv(index=False))
            write_atomic(out / RESULTS, found.model_dump_json(indent=2) + "\n")
    return found


def _evaluation(about: dict[str, Any], reports: tuple[SetReport, ...]) -> SetEvaluation:
    policies = about["policies"]
    return SetEvaluation(
        **about,
        rows=tuple(map(row_of, policies, reports)),
        comparisons=comparisons_of(about["set"], policies, reports),
        reports=reports,
    )


def _about(entrant: Entrant, tasks: TaskSet) -> SetPolicy:
    kind = entrant.policy.kind
    assert kind in ("controller", "sb3")
    assert entrant.sha256 is not None
    mapped = tasks.file.map and kind == "controller"
    return SetPolicy(
        name=entrant.name,
        kind="controller" if kind == "controller" else "sb3",
        knows="+ map" if mapped else "sensors",
        wrappers=entrant.policy.wrappers,
        sha256=entrant.sha256,
    )


def _folder_of(entrant: Entrant) -> str:
    assert entrant.sha256 is not None
    return f"{Path(entrant.name).stem}-{entrant.sha256[:8]}"


def _watch_of(name: str, watch: Watch | None) -> Callable[[int, int], None] | None:
    if watch is None:
        return None
    watch(name, 0, 0)
    return lambda count, successes: watch(name, count, successes)


def _open(out: Path, about: dict[str, Any], stack: contextlib.ExitStack) -> None:
    """Takes a folder for an evaluation.

    Raises:
        RunError: It cannot be used, or has another evaluation.
    """
    written = RESULTS, EPISODE_TABLE, POLICIES
    stack.enter_context(own_folder(out, *written, who="evaluation"))
    if not (out / RESULTS).is_file():
        return
    try:
        before = parse_json(read_file(out / RESULTS, _MOST_BYTES))
        same = all(_plain(about[name]) == before[name] for name in about)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunError(f"{out / RESULTS}: {one_line_reason(error)}") from error
    if not same:
        raise RunError(
            f"{out} has another evaluation, of other policies, worlds or versions: "
            "give another --out"
        )


def _plain(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, tuple):
        return [each.model_dump(mode="json") for each in value]
    return value
