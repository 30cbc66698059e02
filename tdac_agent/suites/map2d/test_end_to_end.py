"""End to end (Table I): episodes that the judge steps and records."""

import math

import numpy as np
import pytest

SCHEMA_STEPS = 50


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
    check_claims(rollout("nominal", steps=20, drive="truncated run_episode"), task)
    if rollout("nominal").reached:
        check_claims(rollout("nominal", drive="run_episode"), task)


def check_claims(episode, task):
    """Every entry against the judge's record, and no step after the end."""
    assert episode.error is None, episode.error
    result, record = episode.returned, episode.trajectory
    claimed = np.asarray([tuple(p)[:2] for p in result["positions"]], float)
    assert claimed.shape == (record.steps + 1, 2), f"positions: shape {claimed.shape}"
    worst = float(np.abs(claimed - record.poses[:, :2]).max())
    assert worst <= 0.01, f"positions differ from the record by up to {worst:.2f} px"
    forward = record.actions.mean(axis=1) * task.params.robot.max_wheel_speed
    speeds = np.asarray(result["speeds"], float)
    worst = float(np.abs(speeds - forward).max(initial=0.0))
    assert worst <= 0.01, f"speeds differ from the applied ones by up to {worst:.2f}"
    assert result["collisions"] == record.collisions, "collisions differ"
    assert math.isclose(result["dt"], record.dt), f"dt is {result['dt']}"
    goal = tuple(float(v) for v in result["goal"])
    assert np.allclose(goal, task.nominal.goal), f"goal is {goal}"


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
    episode, spec = rollout("nominal"), task.spec.progress
    distances = episode.distances(spec.distance)[: task.progress_steps + 1]
    d0, d_min = float(distances[0]), float(distances.min())
    assert d_min <= spec.fraction * d0, (
        f"d_min {d_min:.1f} px > {spec.fraction:g} x d0 {d0:.1f} px ({spec.distance}) "
        f"within {task.progress_steps} steps"
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
