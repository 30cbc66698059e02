"""Training of baselines: what it leaves, how it goes on, what it refuses."""

import base64
import csv
import json
import os
import pickle
import re
import signal
import subprocess
import sys
import zipfile
from dataclasses import replace
from importlib.metadata import version
from itertools import pairwise

import numpy as np
import pytest
import yaml
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.episodes.learned import Learned
from tdac_agent.episodes.sb3_file import read_policy
from tdac_agent.errors import RunError
from tdac_agent.training.curve import Point, read_curve, write_curve
from tdac_agent.training.hyperparameters import (
    config_file,
    model_arguments,
    read_hyperparameters,
)
from tdac_agent.training.plan import make_batch, make_plan, read_plan, write_plan
from tdac_agent.training.train import train
from tdac_envs.core.errors import TaskError
from tdac_envs.learning.wrappers import wrap
from tdac_envs.learning.wrapping import FOR_RL

WRAPPERS = ("goal-relative", "guidance", "flatten")
ENVS = ("TDAC-Map2D-v0", "TDAC-EPuck-v0")
SMALL = {
    "ppo": {"n_envs": 8, "n_steps": 16, "batch_size": 64, "n_epochs": 2},
    "sac": {"n_envs": 8, "learning_starts": 64, "buffer_size": 500},
    "td3": {"n_envs": 8, "learning_starts": 64, "buffer_size": 500},
}


@pytest.fixture
def config(tmp_path):
    """Files with the shipped hyperparameters, made small."""

    def write(algo="ppo", **changes):
        shipped = yaml.safe_load(config_file(algo).read_text())
        small = {**SMALL[algo], "policy_kwargs": {"net_arch": [8]}, **changes}
        file = tmp_path / f"{algo}.yml"
        file.write_text(yaml.safe_dump({e: shipped[e] | small for e in ENVS}))
        return file

    return write


@pytest.fixture
def small(tmp_path):
    return str(write_small_task(tmp_path / "small", horizon=60))


@pytest.mark.parametrize("steps", [256, 512, None])
def test_it_is_among_the_runs(tdac, tmp_path, small, config, steps):
    """With how far it came, and the way on; or why it cannot be read."""
    folder = tmp_path / "runs" / "ppo"
    folder.mkdir(parents=True)
    plan = make_plan((small,), steps=512, config=config())
    write_plan(folder, plan)
    if steps is None:
        (folder / "training.json").write_text("{")
    else:
        write_curve(folder, [Point(steps, 1.0, 0.25, 0.5, 1.0, 9.0, 0.5)])
    told = tdac("runs", folder.parent)[1]
    (row,) = json.loads(tdac("runs", folder.parent, "--json")[1])
    if steps is None:
        assert row["status"] == "unreadable"
        assert "training.json: " in told
        return
    assert f"{steps} of 512 steps, the best policy reached 25% of the goals" in told
    assert (row["status"] == "trained") == (steps == 512)
    assert (f"to continue: tdac train --resume {folder}" in told) == (steps == 256)


def without_seconds(points):
    return [str(replace(point, seconds=0.0)) for point in points]


@pytest.mark.parametrize(
    "algo", ["ppo", *(pytest.param(a, marks=pytest.mark.slow) for a in ("sac", "td3"))]
)
def test_a_training_leaves_a_policy_its_facts_and_a_curve(
    algo, tmp_path, small, config
):
    """The policy says how it sees, and drives as a wrapped environment is answered."""
    plan = make_plan((small,), algo, steps=512, episodes=4, seed=3, config=config(algo))
    told = []
    points = train(plan, tmp_path / "out", lambda *news: told.append(news))
    assert points[-1].steps == 512
    assert [point for _, point, _ in told if point is not None] == points
    assert without_seconds(read_curve(tmp_path / "out")) == without_seconds(points)
    assert all(a.seconds < b.seconds for a, b in pairwise(points))
    facts = json.loads((tmp_path / "out" / "policy.json").read_text())
    best = max(points, key=lambda point: point.worth)
    assert facts["evaluation"]["mean_return"] == best.mean_return
    assert facts["algo"] == algo
    assert facts["seed"] == 3
    assert facts["versions"]["torch"] == version("torch")
    file = tmp_path / "out" / "policy.zip"
    saved = read_policy(file).saved
    assert (saved.algo, saved.wrappers, saved.seed) == (algo, WRAPPERS, 3)
    assert saved.steps == best.steps
    env = load_task(small).make_env(variation="jitter")
    driver = Learned(file, saved.wrappers, env)
    observation, _ = env.reset(seed=0)
    assert driver.policy(observation) in env.action_space


@pytest.mark.slow
def test_equal_seeds_learn_alike(tmp_path, small, config):
    """The same plan gives the same curve, another seed another one."""

    def curve(name, seed):
        plan = make_plan((small,), steps=256, episodes=3, seed=seed, config=config())
        return without_seconds(train(plan, tmp_path / name))

    one, two, other = curve("one", 0), curve("two", 0), curve("other", 1)
    assert one == two
    assert one != other


@pytest.mark.slow
def test_a_finished_training_goes_on_to_another_end(tmp_path, small, config):
    """What was learnt stays; there is nothing to do for a training that is finished."""
    given = {"episodes": 3, "config": config()}
    first = train(make_plan((small,), steps=256, **given), tmp_path / "out")
    longer = make_plan((small,), steps=512, **given)
    points = train(longer, tmp_path / "out")
    assert without_seconds(points[: len(first)]) == without_seconds(first)
    assert points[-1].steps == 512
    assert points[-1].seconds > first[-1].seconds
    before = (tmp_path / "out" / "checkpoint.zip").read_bytes()
    assert without_seconds(train(longer, tmp_path / "out")) == without_seconds(points)
    assert (tmp_path / "out" / "checkpoint.zip").read_bytes() == before
    with pytest.raises(RunError, match="contains another training"):
        train(make_plan((small,), steps=512, seed=1, **given), tmp_path / "out")


class Evil:
    """Runs a command where it is loaded."""

    def __init__(self, canary):
        self.canary = canary

    def __reduce__(self):
        return os.system, (f"touch {self.canary}",)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["checkpoint.zip", "replay.pkl"])
def test_a_foreign_checkpoint_is_not_loaded(tmp_path, small, config, name, tdac):
    """It may run anything: one line, unless it is trusted; then the attack works."""
    out, canary = tmp_path / "out", tmp_path / "canary"
    plan = make_plan((small,), "sac", steps=64, episodes=2, config=config("sac"))
    train(plan, out)
    if name == "replay.pkl":
        (out / name).write_bytes(pickle.dumps(Evil(canary)))
    else:
        evil = base64.b64encode(pickle.dumps(Evil(canary))).decode()
        with zipfile.ZipFile(out / name, "w") as file:
            file.writestr("data", json.dumps({"x": {":serialized:": evil}}))
    words = ("train", "--resume", out, "--steps", 128)
    code, _, err = tdac(*words)
    line = (
        f"error: {out} was not created by this installation and wants to load "
        f"{out / name}, which"
    )
    assert code == 2
    assert [part.startswith(line) for part in err.splitlines()] == [True]
    assert err.endswith("allow it with --trust\n")
    assert not canary.exists()
    code, _, err = tdac(*words, "--trust")
    assert "trusted for this command only" in err
    assert canary.exists()


@pytest.mark.slow
def test_points_after_the_checkpoint_are_learnt_again(tmp_path, small, config):
    """Of a process that dies between an evaluation and its checkpoint."""
    plan = make_plan((small,), steps=512, episodes=3, config=config())
    first = train(plan.model_copy(update={"steps": 256}), tmp_path / "out")
    write_curve(tmp_path / "out", [*first, replace(first[-1], steps=384)])
    points = train(plan, tmp_path / "out")
    assert [p.steps for p in points[: len(first)]] == [p.steps for p in first]
    assert len({point.steps for point in points}) == len(points)
    assert points[-1].steps == 512


def start(*words):
    run = [sys.executable, "-m", "tdac_agent", "train", *map(str, words)]
    return subprocess.Popen(
        run, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_training_loses_little(number, tmp_path, small, config, rejected):
    """It goes on from its last checkpoint, with all that was evaluated till then."""
    out = tmp_path / "out"
    words = ["--task", small, "--config", config(), "--episodes", 3, "--out", out]
    process = start(*words, "--steps", 20_480)
    with process:
        for line in process.stdout:
            if re.match(r" +[23],\d+ steps", line):
                process.send_signal(number)
                break
        rest = process.stdout.read()
    assert process.wait() == (130 if number == signal.SIGINT else -number)
    if number == signal.SIGINT:
        assert f"tdac train --resume {out}" in rest
        assert "Traceback" not in rest
    before = read_curve(out)
    assert before[-1].steps >= 2048
    told = rejected("train", "--resume", out, "--steps", before[-1].steps + 1024)
    assert "not learnt" in told
    after = read_curve(out)
    kept = before if len(after) > len(before) else before[:-1]
    assert without_seconds(after[: len(kept)]) == without_seconds(kept)
    assert after[-1].steps >= before[-1].steps + 1024


def test_a_torn_checkpoint_is_told(tmp_path, small, config):
    """By one line; the files stay as they are."""
    plan = make_plan((small,), steps=256, episodes=3, config=config())
    train(plan, tmp_path / "out")
    file = tmp_path / "out" / "checkpoint.zip"
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(RunError, match=r"cannot resume from .*checkpoint"):
        train(plan, tmp_path / "out", trust=True)
    assert file.stat().st_size == 1000


def test_several_tasks_and_noise_reach_the_robots(tmp_path, config):
    """Robot i drives the task i modulo their number, disturbed as was asked for."""
    names = ["rooms", str(write_small_task(tmp_path / "small", robot={"radius": 15}))]
    goals = [load_task(name).nominal.goal for name in names]
    plan = make_plan(tuple(names), variation="random", n_envs=5, config=config())
    envs = make_batch(plan, 5)
    batch = envs.batch.unwrapped
    assert [s.nominal.goal for s in batch.setups] == [goals[i % 2] for i in range(5)]
    assert {setup.variation for setup in batch.setups} == {"random"}
    envs.seed(0)
    assert envs.reset().shape == (5, 25)
    envs.close()


def test_robots_that_learn_start_where_the_hyperparameters_say(small, config):
    """Those of the evaluations start as the task's do; a flag is for both."""
    file = config(env_kwargs={"variation": "mixed", "on_collision": "block"})

    def made(variation=None, **which):
        plan = make_plan((small,), variation=variation, config=file)
        envs = make_batch(plan, 2, **which)
        setup = envs.batch.unwrapped.setups[0]
        envs.close()
        return setup.variation, setup.on_collision

    assert made(training=True) == ("mixed", "block")
    assert made() == ("jitter", "terminate")
    assert made("nominal", training=True) == ("nominal", "block")
    assert made("nominal") == ("nominal", "terminate")


def test_the_batch_is_told_what_single_environments_are_told(small, config):
    """Trained on the batch, a policy drives in the wrapped environment of its task."""
    plan = make_plan((small,), config=config())
    envs = make_batch(plan, 3)
    envs.seed(5)
    batch = envs.reset()
    for i in range(3):
        one = wrap(load_task(small).make_env(variation="jitter"), WRAPPERS)
        np.testing.assert_array_equal(one.reset(seed=5 + i)[0], batch[i])
    envs.close()


@pytest.mark.parametrize("algo", ["ppo", "sac", "td3"])
@pytest.mark.parametrize("env", ENVS)
def test_the_shipped_hyperparameters_are_whole(algo, env):
    """Each algorithm takes them, and a rate falls to zero."""
    import stable_baselines3

    found = read_hyperparameters(config_file(algo), env)
    assert found.wrappers == WRAPPERS == FOR_RL
    arguments = model_arguments(found.model)
    rate = arguments["learning_rate"]
    assert rate(0.0) == 0.0
    assert rate(0.5) == pytest.approx(rate(1.0) / 2)
    assert 0.0 < rate(1.0) <= 1e-3
    kind = getattr(stable_baselines3, algo.upper())
    task = "rooms" if env == ENVS[0] else "epuck"
    envs = make_batch(make_plan((task,), algo), found.n_envs)
    arguments["policy_kwargs"] = {"net_arch": [8]}
    assert kind(found.policy, envs, **arguments).gamma < 1.0
    envs.close()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--task", "maez"], "no task 'maez'"),
        (["--task", "maze", "--task", "epuck"], "expected tasks of one environment"),
        (["--wrapper", "relative"], "unknown wrapper 'relative'"),
        (["--wrapper", "none", "--wrapper", "flatten"], "cannot be combined"),
        (["--task", "rooms", "--task", "maze", "--wrapper", "guidance"], "several"),
        (["--range-noise", "-1"], "expected a range noise from 0 to 1"),
        (["--algo", "dqn"], "'dqn' is not one of 'ppo', 'recurrent-ppo'"),
        (["--steps", "0"], "'--steps'"),
        (["--config", "none.yml"], "cannot read hyperparameters"),
        (["--resume", "nowhere"], "no training in 'nowhere'"),
        (["--resume", "nowhere", "--seed", "1"], "leave out --seed"),
    ],
)
def test_wrong_flags_are_refused_in_one_line(words, message, refused):
    """With exit code 2, before anything is trained."""
    error = refused("train", *words)
    assert message in error


def test_wrong_hyperparameters_are_refused(tmp_path, small, config):
    """What the file lacks, and what the algorithm does not know."""
    given = {"steps": 64, "episodes": 2}
    plan = make_plan((small,), **given, config=config(depth=3))
    with pytest.raises(RunError, match=r"hyperparameters of ppo: .*'depth'"):
        train(plan, tmp_path / "depth")
    plan = make_plan((small,), **given, config=config(learning_rate="lin_x"))
    with pytest.raises(TaskError, match="expected learning_rate as in lin_1e-3"):
        train(plan, tmp_path / "rate")
    with pytest.raises(
        TaskError, match=r"expected tdac_envs\.wrappers\.wrap_for_rl, or some of"
    ):
        make_plan((small,), config=config(env_wrapper=["gymnasium.wrappers.Other"]))
    with pytest.raises(TaskError, match="goal is set by the task; leave it out"):
        make_plan((small,), config=config(env_kwargs={"goal": [1, 2]}))
    plan = make_plan((small,), **given, config=config(env_kwargs={"walls": 3}))
    with pytest.raises(TaskError, match=r"env_kwargs .*: got an unexpected .*'walls'"):
        train(plan, tmp_path / "walls")
    for name in ("episodes", "n_envs", "seed"):
        with pytest.raises(TaskError, match=f"expected {name} to be a whole number"):
            make_plan((small,), config=config(), **{name: 10**18})
    file = tmp_path / "empty.yml"
    file.write_text("{}")
    with pytest.raises(TaskError, match="no hyperparameters for TDAC-Map2D-v0"):
        make_plan((small,), config=file)


def test_folders_and_tasks_of_others_are_left_alone(tmp_path, small, config):
    """A folder with other files is refused, and so is a task that has changed."""
    plan = make_plan((small,), steps=64, episodes=2, config=config())
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").touch()
    with pytest.raises(RunError, match="is not empty and contains no training"):
        train(plan, tmp_path / "full")
    with pytest.raises(RunError, match="cannot use"):
        train(plan, tmp_path / "full" / "thesis.txt")
    write_small_task(tmp_path / "small", horizon=61)
    with pytest.raises(TaskError, match="has changed since the training began"):
        train(plan, tmp_path / "out")
    assert read_plan(tmp_path / "out") == plan


def test_a_curve_is_read_as_it_was_written(tmp_path):
    """Also where no episode of training had ended yet; damage is told."""
    points = [Point(64, 1.5, 0.25, 0.5, -3.0, 41.5, float("nan"))]
    write_curve(tmp_path, points)
    assert str(read_curve(tmp_path)) == str(points)
    file = tmp_path / "learning_curve.csv"
    with file.open() as lines:
        assert next(csv.DictReader(lines))["success_rate"] == "0.25"
    file.write_text("steps\n64\n")
    with pytest.raises(RunError, match="cannot read"):
        read_curve(tmp_path)


@pytest.mark.slow
def test_ppo_with_guidance_learns(tmp_path):
    """The shipped hyperparameters lead around a wall, from all of the moved starts."""
    small = str(write_small_task(tmp_path / "small"))
    points = train(make_plan((small,), steps=300_000, seed=0), tmp_path / "out")
    best = max(points, key=lambda point: point.worth)
    assert best.success_rate >= 0.95
    assert best.collision_rate <= 0.05
