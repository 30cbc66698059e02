"""A judge's findings about a suite's episodes, in addition to pytest's report log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.nearest import gap_of
from tdac_agent.verification.diagnosis.report import Episode
from tdac_agent.verification.judge.jobs import Findings
from tdac_agent.verification.judge.judge import NOMINAL, Judge, Key, rollout_key
from tdac_agent.verification.judge.suite_episode import SuiteTask


def driven(judge: Judge) -> list[Rollout]:
    """The full-length episodes that `policy` drove."""
    return [
        rollout
        for (_, steps, drive), rollout in judge.rollouts.items()
        if steps is None and drive == "policy"
    ]


def findings_of(
    judge: Judge,
    expected: list[str],
    shown: Units | None = None,
    checks: dict[str, str | None] | None = None,
) -> Findings:
    """The findings of a settled judge.

    Args:
        judge: The judge.
        expected: The tests that had to run.
        shown: Units that the user reads, if they are not the environment's.
        checks: Static and contract tests on a task set.
    """
    task = judge.task
    rollouts = judge.rollouts
    failed = {
        rollout_key(*key): _named(key, rollouts)
        for key, rollout in rollouts.items()
        if rollout.outcome != "not run"
        and (rollout.held_out or rollout.outcome not in ("reached", "stopped"))
    }
    diagnoses = {
        key: diagnose(rollout, task.nominal, task.told_units).model_dump_json()
        for key, rollout in failed.items()
    }
    texts = {} if shown is None else failed
    return Findings(
        expected=expected,
        episodes=[_episode(rollout, task) for rollout in driven(judge)],
        diagnoses=diagnoses,
        shown={
            key: diagnose(rollout, task.nominal, shown).text
            for key, rollout in texts.items()
        },
        tier=judge.tier,
        child_cpu_seconds=round(judge.cpu_seconds, 3),
        fault=judge.fault,
        checks=checks or {},
    )


def _named(key: Key, rollouts: Mapping[Key, Rollout]) -> Rollout:
    """Renames an episode of the controller's own loop to `run_episode`.

    If `policy` failed with the same error, the name stays: it is then reported once.
    """
    rollout, nominal = rollouts[key], rollouts.get(NOMINAL)
    of_both = nominal is not None and rollout.error == nominal.error is not None
    if key[2] == "policy" or of_both:
        return rollout
    return replace(rollout, name="run_episode")


def _episode(rollout: Rollout, task: SuiteTask) -> Episode:
    fraction, within = task.progress_fraction, task.progress_steps + 1
    figures = {}
    for kind, suffix in (("geodesic", ""), ("euclidean", "_euclidean")):
        distances = rollout.distances(kind)
        figures[f"d0{suffix}"] = float(distances[0])
        figures[f"d_min{suffix}"] = float(distances.min())
        best = float(distances[:within].min())
        figures[f"progress_passed{suffix}"] = best <= fraction * float(distances[0])
    return Episode(
        name=rollout.name,
        held_out=rollout.held_out,
        outcome=rollout.outcome,
        steps=rollout.trajectory.steps,
        collisions=rollout.collisions,
        call_ms_mean=round(rollout.call_ms[0], 3),
        call_ms_p99=round(rollout.call_ms[1], 3),
        error=rollout.error,
        smallest_gap=gap_of(rollout, task.nominal),
        **figures,
    )
