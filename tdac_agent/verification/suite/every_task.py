"""Tests that the shipped suites of all environments share."""

import ast
import math

import numpy as np
import pytest

from tdac_agent.storage.plain import shown
from tdac_agent.verification.suite import contract, hygiene
from tdac_agent.verification.suite.several import Several

SCHEMA_STEPS = 50


def test_source_parses(controller):
    """The source parses and has at most 200 kB."""
    assert isinstance(controller.tree, ast.Module)


def test_imports(controller):
    """Only allowed modules are imported, and only at the top level."""
    error = contract.import_error(controller.tree)
    assert error is None, error


def test_policy_is_defined(controller):
    """`policy` is a plain function that takes one observation."""
    error = contract.policy_error(controller.tree)
    assert error is None, error


@pytest.mark.paper
def test_constants(controller, task):
    """The constants of the contract are assigned at the top level."""
    names = contract.top_level_names(controller.tree)
    wanted = task.environment.names.constants
    missing = [name for name in wanted if name not in names]
    assert not missing, f"missing constants: {', '.join(missing)}"


@pytest.mark.paper
def test_entry_points(controller, task):
    """The functions and classes of the contract are defined at the top level."""
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
    """The source has no unstable pattern; the message names the lines."""
    error = hygiene.hygiene_error(controller.tree, pattern)
    assert error is None, error


def check_constants(controller, expected):
    """Compares constants with the values in params.json."""
    several = Several()
    for name, value in expected.items():
        with several:
            found = controller.constant(name)
            assert isinstance(found, int | float), (
                f"{name} is {shown(found)}, not a number"
            )
            assert math.isclose(found, value, rel_tol=1e-6), (
                f"{name} = {shown(found)}, not {value:g} as in params.json"
            )
    several.settle()


@pytest.mark.paper
def test_run_episode_schema(rollout):
    """`run_episode` returns five entries of the right types and lengths."""
    episode = rollout("nominal", steps=SCHEMA_STEPS, drive="run_episode")
    assert episode.error is None, episode.error
    result, steps = episode.returned, episode.trajectory.steps
    assert isinstance(result, dict), (
        f"run_episode returned a {type(result).__name__}, not a dict"
    )
    missing = {"positions", "speeds", "collisions", "goal", "dt"} - set(result)
    assert not missing, f"run_episode: missing keys: {', '.join(sorted(missing))}"
    several = Several()
    with several:
        found = result["collisions"]
        assert type(found) is int, (
            f"run_episode: collisions is not an int but {shown(found)}"
        )
    for name, expected in (("positions", steps + 1), ("speeds", steps)):
        with several:
            count = len(result[name])
            assert count == expected, (
                f"run_episode: {count} {name} after {steps} steps, not {expected}"
            )
    several.settle()


@pytest.mark.paper
def test_run_episode_agrees_with_the_judge(rollout, task):
    """`run_episode` returns what the environment recorded, however the episode ends."""
    several = Several()
    short = rollout("nominal", steps=SCHEMA_STEPS, drive="run_episode")
    check_claims(several, short, task)
    truncated = rollout("nominal", steps=20, drive="truncated run_episode")
    check_claims(several, truncated, task, " (the count starts at 2 in this episode)")
    if rollout("nominal").reached:
        whole = rollout("nominal", drive="run_episode")
        check_claims(several, whole, task)
        with several:
            good = whole.reached and whole.collisions == 0
            assert good, (
                f"run_episode: {whole.outcome}, although policy alone reaches the goal"
            )
    several.settle()


def check_claims(several, episode, task, where=""):
    """Compares every entry of `run_episode` with the judge's record."""
    if episode.error is not None:
        several.settle()
    assert episode.error is None, episode.error
    result, record, units = episode.returned, episode.trajectory, task.setting.units
    slack, length = 0.01 / units.scale, units.length
    with several:
        claimed = np.asarray([tuple(p)[:2] for p in result["positions"]], float)
        assert claimed.shape == (record.steps + 1, 2), (
            f"positions has the shape {claimed.shape}, not {(record.steps + 1, 2)}"
        )
        worst = float(np.abs(claimed - record.poses[:, :2]).max())
        assert worst <= slack, (
            f"positions differ from the record by up to {worst * units.scale:.2f} "
            f'{length}: take x and y of obs["pose"], after reset and after each step'
        )
    with several:
        full_speed = task.nominal.full_step / task.nominal.dt
        forward = record.actions.mean(axis=1) * full_speed
        speeds = np.asarray(result["speeds"], float)
        assert speeds.shape == forward.shape, (
            f"speeds has the shape {speeds.shape}, not {forward.shape}: one forward "
            "speed per step"
        )
        worst = float(np.abs(speeds - forward).max(initial=0.0))
        assert worst <= slack, (
            f"speeds differ from the applied ones by up to {worst * units.scale:.2f} "
            f'{length}/s: take them from obs["wheel_speeds"] after each step'
        )
    with several:
        assert result["collisions"] == record.collisions, (
            f"collisions is {shown(result['collisions'])}, not {record.collisions} as "
            f'recorded{where}: return info["collisions"] of the last step'
        )
    with several:
        assert math.isclose(result["dt"], record.dt), (
            f"dt is {shown(result['dt'])}, not {record.dt:g}"
        )
    with several:
        goal = tuple(float(v) for v in result["goal"])
        assert np.allclose(goal, task.nominal.goal), (
            f"goal is {shown(goal)}, not {task.nominal.goal}"
        )


@pytest.mark.parametrize("steps", [10, 50])
def test_short_rollout_is_stable(rollout, steps):
    """The first calls of `policy` return two finite numbers each."""
    episode = rollout("nominal")
    failed_early = episode.error and episode.trajectory.steps < steps
    assert not failed_early, episode.error


def test_policy_is_fast_enough(rollout, task):
    """The mean call of `policy` takes at most one step's duration."""
    episode = rollout("nominal")
    assert episode.error is None, episode.error
    mean, p99 = episode.call_ms
    limit = 1000 * task.nominal.dt
    assert mean <= limit, (
        f"the mean call of policy takes {mean:.1f} ms (99th percentile {p99:.1f} ms); "
        f"the limit is {limit:.0f} ms"
    )


def test_progress(rollout, task):
    """By default, the path left falls to 0.7 of its length at the start in time.

    The time is max(400, 0.16 horizon) steps.
    """
    episode, spec, units = rollout("nominal"), task.spec.progress, task.setting.units
    assert episode.trajectory.steps > 0, episode.error or "the episode has no steps"
    distances = episode.distances(spec.distance)[: task.progress_steps + 1]
    d0, d_min = (float(d) * units.scale for d in (distances[0], distances.min()))
    what = "path" if spec.distance == "geodesic" else "straight distance"
    assert d_min <= spec.fraction * d0, (
        f"not enough progress: in the first {task.progress_steps} steps the {what} to "
        f"the goal must fall from {d0:.1f} {units.length} to "
        f"{spec.fraction * d0:.1f} {units.length} or less ({spec.fraction:.0%}); its "
        f"smallest value was {d_min:.1f} {units.length}"
    )


def test_no_collisions(rollout):
    """The body touches nothing during the whole episode."""
    episode = rollout("nominal")
    assert episode.error is None, episode.error
    assert episode.trajectory.steps > 0, "the episode has no steps"
    number = episode.collisions
    assert number == 0, (
        "the body must touch nothing during the whole episode; it had "
        f"{number} collision{'' if number == 1 else 's'}"
    )


def test_reaches_goal(rollout, task):
    """The goal is reached within the horizon."""
    episode, nominal, units = rollout("nominal"), task.nominal, task.setting.units
    near = nominal.goal_tolerance * units.scale
    assert episode.reached, episode.error or (
        f"the robot must come within {near:.4g} {units.length} of the goal in at most "
        f"{nominal.horizon} steps; the episode ended after {episode.trajectory.steps} "
        f"steps: {episode.outcome}"
    )


@pytest.mark.jitter
@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_jittered_start(rollout, number):
    """Reaches the goal from a start moved by <= 1 radius and turned by <= 0.5 rad."""
    episode = rollout(f"jitter {number}")
    figures = not episode.held_out or episode.outcome == "not run"
    ending = episode.error or episode.outcome if figures else "failed"
    assert episode.reached, ending
    assert episode.collisions == 0, "failed"


def check_path(oracle, case, path, is_point, unit="px"):
    """Checks a planned path: free, connected, and at most 1.1 x the shortest length.

    Args:
        oracle: The fixture.
        case: One of `oracle.plan_cases()`.
        path: The controller's answer; must be [] if there is no path.
        is_point: Returns whether a value is a pair of whole numbers.
        unit: Unit of lengths.
    """
    assert isinstance(path, list), (
        f"{case.name}: returned a {type(path).__name__}, not a list"
    )
    if math.isinf(case.length):
        assert path == [], (
            f"{case.name}: returned {len(path)} points, but there is no path: "
            "expected []"
        )
        return
    assert path, (
        f"{case.name}: returned [], but there is a path of {case.length:.1f} {unit}"
    )
    assert all(map(is_point, path)), f"{case.name}: points must be (int, int)"
    ends = (path[0], path[-1])
    assert ends == (case.start, case.goal), (
        f"{case.name}: the ends of the path are {shown(ends)}, not start and goal "
        f"{(case.start, case.goal)}"
    )
    error = oracle.path_error(case.occ, path)
    assert error is None, f"{case.name}: {error}"
    length = oracle.path_length(path)
    assert length <= 1.1 * case.length + 1e-6, (
        f"{case.name}: the path has {length:.1f} {unit}, more than 1.1 x the "
        f"shortest ({case.length:.1f} {unit})"
    )
