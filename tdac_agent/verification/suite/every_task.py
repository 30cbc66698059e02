"""Tests that the shipped suites have in common, whatever the environment."""

import ast
import math

import numpy as np
import pytest

from tdac_agent.storage.plain import shown
from tdac_agent.verification.suite import contract, hygiene

SCHEMA_STEPS = 50


def test_source_parses(controller):
    """One Python file of at most 200 kB that parses."""
    assert isinstance(controller.tree, ast.Module)


def test_imports(controller):
    """Only allowed modules are imported, and only at the top level."""
    problems = contract.import_problems(controller.tree)
    allowed = " ".join(sorted(contract.ALLOWED_IMPORTS - {"__future__"}))
    assert not problems, f"{'; '.join(problems)}; allowed at the top: {allowed}"


def test_policy_is_defined(controller):
    """`policy` is a plain function that takes one observation."""
    function = contract.top_level_names(controller.tree).get("policy")
    assert isinstance(function, ast.FunctionDef), "no `def policy(obs)` at the top"
    least, most = contract.positional_arity(function)
    taken = str(least) if least == most else f"{least} to {most}"
    assert least <= 1 <= most, f"policy takes {taken} arguments, not 1"


@pytest.mark.paper
def test_constants(controller, task):
    """The constants of the contract are assigned at the top level."""
    names = contract.top_level_names(controller.tree)
    wanted = task.environment.names.constants
    missing = [name for name in wanted if name not in names]
    assert not missing, f"missing constants: {', '.join(missing)}"


@pytest.mark.paper
def test_entry_points(controller, task):
    """`run_episode`, `main` and the functions and classes of the contract are there."""
    names = contract.top_level_names(controller.tree)
    wanted = task.environment.names
    missing = [
        f for f in wanted.functions if not isinstance(names.get(f), ast.FunctionDef)
    ]
    missing += [
        f"{c} (a class)"
        for c in wanted.classes
        if not isinstance(names.get(c), ast.ClassDef)
    ]
    assert not missing, f"missing at the top level: {', '.join(missing)}"


@pytest.mark.paper
def test_main(controller):
    """`main()` calls `sensors.show(policy)`, and the `__main__` guard calls it."""
    main = contract.top_level_names(controller.tree).get("main")
    assert isinstance(main, ast.FunctionDef), "no `def main()` at the top level"
    assert "show" in contract.calls_in(main), (
        "main() does not call sensors.show(policy)"
    )
    guarded = contract.has_main_guard(controller.tree)
    assert guarded, 'no `if __name__ == "__main__": main()`'


@pytest.mark.parametrize("pattern", hygiene.HYGIENE)
def test_hygiene(controller, pattern):
    """No unstable pattern: each is named with its line."""
    found = list(hygiene.HYGIENE[pattern](controller.tree))
    assert not found, f"{pattern.replace('_', ' ')}: {'; '.join(found[:8])}"


@pytest.mark.paper
def test_run_episode_schema(rollout):
    """`run_episode` returns the five entries, each of its type and length."""
    episode = rollout("nominal", steps=SCHEMA_STEPS, drive="run_episode")
    assert episode.error is None, episode.error
    result, steps = episode.returned, episode.trajectory.steps
    assert isinstance(result, dict), f"a {type(result).__name__}, not a dict"
    missing = {"positions", "speeds", "collisions", "goal", "dt"} - set(result)
    assert not missing, f"missing keys: {', '.join(sorted(missing))}"
    assert type(result["collisions"]) is int, "collisions is not an int"
    counts = len(result["positions"]), len(result["speeds"])
    expected = steps + 1, steps
    assert counts == expected, f"{counts} positions and speeds, expected {expected}"


@pytest.mark.paper
def test_run_episode_agrees_with_the_judge(rollout, task):
    """What `run_episode` returns is what the environment recorded, however it ends."""
    check_claims(rollout("nominal", steps=SCHEMA_STEPS, drive="run_episode"), task)
    truncated = rollout("nominal", steps=20, drive="truncated run_episode")
    check_claims(truncated, task, " in an episode that begins with two of them")
    if rollout("nominal").reached:
        whole = rollout("nominal", drive="run_episode")
        check_claims(whole, task)
        good = whole.reached and whole.collisions == 0
        assert good, f"run_episode: {whole.outcome}, where policy reaches the goal"


def check_claims(episode, task, where=""):
    """Every entry against the judge's record, and no step after the end."""
    assert episode.error is None, episode.error
    result, record, units = episode.returned, episode.trajectory, task.setting.units
    slack, length = 0.01 / units.scale, units.length
    claimed = np.asarray([tuple(p)[:2] for p in result["positions"]], float)
    assert claimed.shape == (record.steps + 1, 2), f"positions: shape {claimed.shape}"
    worst = float(np.abs(claimed - record.poses[:, :2]).max())
    assert worst <= slack, (
        f"positions differ from the record by up to {worst * units.scale:.2f} {length}"
    )
    full_speed = task.nominal.full_step / task.nominal.dt
    forward = record.actions.mean(axis=1) * full_speed
    speeds = np.asarray(result["speeds"], float)
    assert speeds.shape == forward.shape, (
        f"speeds: shape {speeds.shape}, one forward speed a step is {forward.shape}"
    )
    worst = float(np.abs(speeds - forward).max(initial=0.0))
    assert worst <= slack, (
        f"speeds differ from the applied ones by up to {worst * units.scale:.2f} "
        f"{length}/s"
    )
    assert result["collisions"] == record.collisions, (
        f"collisions is {shown(result['collisions'])}, on record are "
        f"{record.collisions}{where}"
    )
    assert math.isclose(result["dt"], record.dt), f"dt is {shown(result['dt'])}"
    goal = tuple(float(v) for v in result["goal"])
    assert np.allclose(goal, task.nominal.goal), f"goal is {shown(goal)}"


@pytest.mark.parametrize("steps", [10, 50])
def test_short_rollout_is_stable(rollout, steps):
    """The first steps raise nothing and return two finite numbers each."""
    episode = rollout("nominal")
    failed_early = episode.error and episode.trajectory.steps < steps
    assert not failed_early, episode.error


def test_policy_is_fast_enough(rollout, task):
    """The mean policy call takes no longer than a step."""
    episode = rollout("nominal")
    assert episode.error is None, episode.error
    mean, p99 = episode.call_ms
    limit = 1000 * task.nominal.dt
    assert mean <= limit, (
        f"mean call {mean:.1f} ms (p99 {p99:.1f}), limit {limit:.0f} ms"
    )


def test_progress(rollout, task):
    """d_min <= 0.7 d0 within max(400, 0.16 horizon) steps."""
    episode, spec, units = rollout("nominal"), task.spec.progress, task.setting.units
    assert episode.trajectory.steps > 0, episode.error or "the episode has no step"
    distances = episode.distances(spec.distance)[: task.progress_steps + 1]
    d0, d_min = (float(d) * units.scale for d in (distances[0], distances.min()))
    assert d_min <= spec.fraction * d0, (
        f"d_min {d_min:.1f} {units.length} > {spec.fraction:g} x d0 {d0:.1f} "
        f"{units.length} ({spec.distance}) within {task.progress_steps} steps"
    )


def test_no_collisions(rollout):
    """The body touches nothing on the whole way."""
    episode = rollout("nominal")
    assert episode.error is None, episode.error
    assert episode.trajectory.steps > 0, "the episode has no step"
    assert episode.collisions == 0, f"{episode.collisions} collision(s)"


def test_reaches_goal(rollout):
    """The goal is reached within the horizon."""
    episode = rollout("nominal")
    assert episode.reached, episode.error or f"ended: {episode.outcome}"


@pytest.mark.jitter
@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_jittered_start(rollout, number):
    """From a start moved by up to one radius and turned by up to 0.5 rad."""
    episode = rollout(f"jitter {number}")
    figures = not episode.held_out or episode.outcome == "not run"
    ending = episode.error or episode.outcome if figures else "failed"
    assert episode.reached, ending
    assert episode.collisions == 0, "failed"


def check_path(oracle, case, path, is_point):
    """A path from start to goal, or [] where there is none: free, joined, short.

    Args:
        oracle: The fixture.
        case: One of `oracle.plan_cases()`.
        path: What the controller returned.
        is_point: Whether a value is a pair of whole numbers.
    """
    assert isinstance(path, list), f"{case.name}: a {type(path).__name__}, not a list"
    if math.isinf(case.length):
        assert path == [], f"{case.name}: {len(path)} points, expected []"
        return
    assert path, f"{case.name}: [], but a path of {case.length:.1f} px exists"
    assert all(map(is_point, path)), f"{case.name}: points must be (int, int)"
    ends = (path[0], path[-1])
    assert ends == (case.start, case.goal), f"{case.name}: runs {shown(ends)}"
    error = oracle.path_error(case.occ, path)
    assert error is None, f"{case.name}: {error}"
    length = oracle.path_length(path)
    assert length <= 1.1 * case.length + 1e-6, (
        f"{case.name}: {length:.1f} px long, the shortest is {case.length:.1f} px"
    )
