"""Training on a task set: its worlds, its record, what it refuses."""

import csv
import json
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from few_worlds import write_short_set

from tdac_agent.bench.bench import bench
from tdac_agent.episodes.sb3_file import POLICY, load_weights, read_policy
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.evaluation.evaluate import evaluate
from tdac_agent.storage.locks import LOCK_FILE, hold
from tdac_agent.tasks.trust import NotTrustedError
from tdac_agent.training.checkpoint_marks import CHECKPOINT
from tdac_agent.training.curve import read_curve
from tdac_agent.training.first_weights import begun_from
from tdac_agent.training.hyperparameters import config_file
from tdac_agent.training.plan import read_plan, write_plan
from tdac_agent.training.seeds import seed_folder, train_seeds
from tdac_agent.training.set_plan import make_set_plan, make_trials
from tdac_agent.training.train import train
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError

SMALL = {"n_envs": 8, "n_steps": 16, "batch_size": 64, "n_epochs": 2}
LOST = {
    "observed": ["odometry", "goal", "wheel_speeds", "ranges"],
    "disturbances": {"odometry_scale": 0.05, "wheel_gains": 0.1, "delay": 1},
}


@pytest.fixture
def config(tmp_path):
    """Writes the shipped hyperparameters, made small; gives the file."""

    def write(algo="ppo", **changes):
        own = yaml.safe_load(config_file(algo).read_text())["TDAC-Ladder-v0"]
        sizes = own["policy_kwargs"] | {"net_arch": [8]}
        sizes |= {"lstm_hidden_size": 8} if algo == "recurrent-ppo" else {}
        small = own | SMALL | {"policy_kwargs": sizes} | changes
        file = tmp_path / f"{algo}.yml"
        file.write_text(yaml.safe_dump({"TDAC-Ladder-v0": small}))
        return file

    return write


@pytest.fixture
def few(tmp_path):
    """Writes a set of small worlds and short episodes; gives its path."""

    def write(name="few", **values):
        return write_short_set(tmp_path / f"{name}.yaml", 30, name=name, **values)

    return write


@pytest.fixture
def trained(tmp_path, few, config):
    """A short training, and the set that it was on."""

    def run(algo="ppo", **values):
        level = few(**values)
        plan = make_set_plan(level, algo, steps=256, episodes=4, config=config(algo))
        points = train(plan, tmp_path / "out")
        return load_set(level), plan, points, tmp_path / "out"

    return run


@pytest.mark.parametrize("level", ["known", "unknown", "lost"])
def test_a_plan_has_what_robots_of_the_level_have(level):
    """No guidance, closeness, no view of the map unless one asks for it; 256 robots."""
    plan = make_set_plan(level, steps=1000)
    assert plan.wrappers == ("goal-relative", "closeness", "flatten")
    assert (plan.set, plan.set_sha256) == (level, load_set(level).sha256)
    assert (plan.n_envs, plan.episodes, plan.tasks) == (256, 100, ())


@pytest.mark.parametrize("values", [{}, LOST])
def test_a_training_records_its_set(trained, values):
    """Name and hash, in the plan, the facts, and the policy itself."""
    tasks, plan, points, out = trained(**values)
    assert points[-1].steps == 256
    assert read_plan(out) == plan
    saved = read_policy(out / "policy.zip").saved
    assert (saved.set, saved.set_sha256, saved.tasks) == ("few", tasks.sha256, ())
    facts = json.loads((out / "policy.json").read_text())
    assert facts["set_sha256"] == tasks.sha256
    assert len(read_curve(out)) == len(points)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("algo", ["recurrent-ppo", "ppo"])
def test_its_evaluation_is_that_of_the_judge(trained, algo, warm, monkeypatch):
    """Three robots share the worlds of dev: the judge drives the same, one by one.

    A recurrent policy begins each episode with an empty memory.
    """
    monkeypatch.setattr("tdac_agent.training.set_plan._AT_ONCE", 3)
    tasks, _, points, out = trained(algo, **LOST)
    best = max(points, key=lambda point: point.worth)
    found = evaluate([out / "policy.zip"], [tasks], 4, split="dev", judge=warm)
    (row,), (report,) = found.rows, found.results
    assert row.successes / 4 == best.success_rate
    assert row.collided / 4 == best.collision_rate
    steps = np.mean([episode.steps for episode in report.episodes])
    assert steps == pytest.approx(best.mean_length)


@pytest.mark.slow
def test_a_policy_in_a_bench(trained, few, tmp_path, monkeypatch):
    """Beside a program, on hidden worlds, too; one that does not fit is a row."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    tasks, plan, _, out = trained(**LOST)
    level, file = tmp_path / "few.yaml", out / "policy.zip"
    still = tmp_path / "still.py"
    still.write_text("def policy(obs):\n    return 0.0, 0.0\n")
    words = [f"ppo={file}", str(still)]
    found = bench(words, [level], "dev", 4, out=tmp_path / "bench")
    alone = evaluate([file], [tasks], 4, split="dev")
    learned, program = found.rows
    assert learned.success.value == alone.rows[0].successes / 4
    assert (learned.kind, learned.knows, program.kind) == (
        "learned", "sensors", "controller",
    )  # fmt: skip
    assert 0 < learned.steps <= plan.steps
    assert (learned.trained_here, program.trained_here) == (True, None)
    hidden = bench(words, [level], "hidden", 3, out=tmp_path / "hidden")
    assert [row.files[0].hidden for row in hidden.rows] == [1, 1]
    ledger = tmp_path / "state" / "tdac" / "hidden-evaluations.jsonl"
    assert len(ledger.read_text().splitlines()) == 4
    other = few(name="others")
    (row, drove) = bench(words, [other], "dev", 1, out=tmp_path / "other").rows
    assert "the task set 'few', not on 'others'" in row.problem
    assert (row.time, drove.worlds) == (None, 1)


def test_trials_begin_in_their_own_worlds(few, config):
    """Robot i is in world i of dev, and none of train is among them."""
    level = few()
    plan = make_set_plan(level, steps=64, episodes=3, config=config())
    trials = make_trials(plan)
    tasks = load_set(level)
    for i in (2, 1, 0):
        mask = np.arange(3) == i
        trials.reset(options={"index": i, "reset_mask": mask})
    for i, task in enumerate(trials.batch.tasks):
        assert np.array_equal(task.field, tasks.task("dev", i).field)
    trials.close()


def test_a_training_goes_on(trained):
    """Longer; a set that has changed since is refused."""
    _, plan, points, out = trained()
    longer = plan.model_copy(update={"steps": 512})
    more = train(longer, out)
    assert more[: len(points)] == points
    assert more[-1].steps == 512
    other = plan.model_copy(update={"set_sha256": "0" * 64})
    with pytest.raises(RunError, match="contains another training"):
        train(other, out)


def test_a_changed_set_is_refused(tmp_path, few, config):
    plan = make_set_plan(few(), steps=64, config=config())
    few(goal_tolerance=5)
    with pytest.raises(TaskError, match="has changed since the training began"):
        train(plan, tmp_path / "out")


def test_a_policy_of_another_training_is_refused(trained, few):
    """One line for another set, another version, and tasks."""
    _, _, _, out = trained()
    file = str(out / "policy.zip")
    other = load_set(few(name="others"))
    with pytest.raises(ControllerFileError, match=r"the task set 'few', not on 'oth"):
        evaluate([file], [other], 1)
    changed = load_set(few(goal_tolerance=5))
    with pytest.raises(ControllerFileError, match="on another version of the task set"):
        evaluate([file], [changed], 1)
    with pytest.raises(TaskError, match="the task set 'few', not on tasks: evaluate"):
        evaluate([file], ["maze"], 1)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "--set brings its own tasks; leave out --task"),
        (("--variation", "mixed"), "leave out --variation"),
        (("--delay", "1"), "leave out --delay"),
        (("--set", "unknow"), "did you mean 'unknown'?"),
        (("--wrapper", "guidance"), "leave out the wrapper 'guidance'"),
        (("--episodes", "0"), "--episodes"),
        (("--from", "nowhere.zip"), "nowhere.zip"),
    ],
)
def test_mistakes_are_one_line(refused, words, message):
    given = ("--set", "unknown") if "--set" not in words else ()
    task = () if words else ("--task", "maze")
    err = refused("train", *given, *task, *words)
    assert message in err


def test_hyperparameters_do_not_choose_the_worlds(few, config):
    """A training on `test` would be no training for others to compare with."""
    with pytest.raises(TaskError, match="env_kwargs: split is set by the training"):
        make_set_plan(few(), config=config(env_kwargs={"split": "test"}))
    with pytest.raises(TaskError, match="env_kwargs: privileged is set by the train"):
        make_set_plan(few(), config=config(env_kwargs={"privileged": True}))


@pytest.mark.slow
def test_the_commands_in_turn(tdac, rejected, done, tmp_path, few, config):
    """train, runs, evaluate: what each prints leads to the next."""
    level = few()
    words = ("--set", level, "--steps", 128, "--episodes", 2, "--config", config())
    out = rejected("train", *words, "--out", "out")
    assert "worlds of train (2 of dev in evaluations)" in out
    assert "not learnt" in out
    assert f"to compare: tdac bench out/policy.zip builtin --set {level}" in out
    assert str(level) in tdac("runs", ".")[1]
    out = done(
        "evaluate", "out/policy.zip", "--set", level, "-n", 2, "--csv", "rows.csv"
    )
    assert "few" in out
    with (tmp_path / "here" / "rows.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["index"] for row in rows] == ["0", "1"]
    assert {row["knows"] for row in rows} == {"sensors"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("uses", "first", "knows"),
    [("memory", "seen-map", "+ memory"), ("planner", "waypoints", "+ planner")],
)
def test_a_policy_with_a_map_of_its_own(
    few, config, tmp_path, warm, uses, first, knows
):
    """It trains and drives, and the tables say what it uses."""
    level = few()
    plan = make_set_plan(level, steps=128, episodes=2, config=config(), uses=uses)
    assert plan.wrappers == (first, "goal-relative", "closeness", "flatten")
    train(plan, tmp_path / "out")
    tasks = load_set(level)
    found = evaluate([tmp_path / "out"], [tasks], 2, split="dev", judge=warm)
    assert found.rows[0].knows == knows


def test_a_new_policy_drives_forward(few, config, tmp_path):
    """Before the training both wheels do what `initial_action` says, on average."""
    level = few()
    file = config(learning_rate=1e-12, initial_action=0.25)
    plan = make_set_plan(level, steps=128, episodes=2, config=file)
    train(plan, tmp_path / "out")
    from stable_baselines3 import PPO

    policy = PPO.load(tmp_path / "out" / "policy.zip").policy
    bias = policy.action_net.bias.detach().numpy()
    assert np.allclose(bias, 0.25, atol=1e-6)
    for value in (2.0, "fast"):
        with pytest.raises(TaskError, match="initial_action: expected"):
            make_set_plan(level, config=config(initial_action=value))


def test_a_training_begins_with_the_weights_of_a_policy(few, config, tmp_path):
    """Those of the file; another network, other wrappers, a changed file: one line."""
    level, first = few(), tmp_path / "first"
    common = {"steps": 128, "episodes": 2}
    train(make_set_plan(level, **common, seed=1, config=config()), first)
    file = first / "policy.zip"
    still = config(learning_rate=1e-12)
    plan = begun_from(make_set_plan(level, **common, seed=2, config=still), file)
    train(plan, tmp_path / "second")
    before, after = (
        read_policy(each / "policy.zip") for each in (first, tmp_path / "second")
    )
    for name, tensor in load_weights(before.weights).items():
        assert np.allclose(tensor, load_weights(after.weights)[name], atol=1e-6)
    wide = config(policy_kwargs={"net_arch": [9]})
    other = begun_from(make_set_plan(level, **common, config=wide), file)
    with pytest.raises(RunError, match="its network is another one"):
        train(other, tmp_path / "third")
    planner = make_set_plan(level, **common, uses="planner", config=config())
    with pytest.raises(TaskError, match="it was trained with the wrappers goal-rel"):
        begun_from(planner, file)
    file.write_bytes(file.read_bytes() + b" ")
    with pytest.raises(RunError, match="has changed since this training was planned"):
        train(plan, tmp_path / "fourth")


@pytest.mark.slow
def test_seeds_are_trained_side_by_side(few, config, tmp_path):
    """Each as alone, to the last digit; the same call again leaves them as they are."""
    level = few()
    plan = make_set_plan(level, steps=256, episodes=3, config=config())
    told = []
    curves = train_seeds(plan, range(3, 5), tmp_path / "s", lambda *a: told.append(a))
    assert list(curves) == [3, 4]
    alone = train(plan.model_copy(update={"seed": 4}), tmp_path / "alone")
    plain = [replace(point, seconds=0.0) for point in alone]
    assert [replace(point, seconds=0.0) for point in curves[4]] == plain
    assert {seed for seed, _, _ in told} == {3, 4}
    again = train_seeds(plan, range(3, 5), tmp_path / "s", lambda *_: None)
    assert again == curves
    (tmp_path / "s" / "seed-4" / "training.json").unlink()
    with pytest.raises(RunError, match="not empty and contains no training"):
        train_seeds(plan, range(3, 5), tmp_path / "s", lambda *_: None)


def test_seeds_are_checked_first(few, config, tmp_path):
    """What is wrong at once is told at once."""
    plan = make_set_plan(few(), steps=128, episodes=2, config=config())
    with pytest.raises(TaskError, match="expected seed to be a whole number from 0"):
        train_seeds(plan, range(2**31, 2**31 + 2), tmp_path / "s", lambda *_: None)
    assert not (tmp_path / "s" / f"seed-{2**31 + 1}").exists()
    folder = seed_folder(tmp_path / "s", 1)
    folder.mkdir(parents=True)
    with hold(folder / LOCK_FILE), pytest.raises(RunError, match="contains no train"):
        train_seeds(plan, range(1, 3), tmp_path / "s", lambda *_: None)
    write_plan(folder, plan.model_copy(update={"seed": 1}))
    (folder / CHECKPOINT).write_text("somebody else's")
    with pytest.raises(NotTrustedError, match=CHECKPOINT) as told:
        train_seeds(plan, range(1, 3), tmp_path / "s", lambda *_: None)
    assert pickle.loads(pickle.dumps(told.value)).lines == told.value.lines


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_a_seed_that_fails_stops_no_other(few, config, tmp_path, count):
    """The others train as alone, to the last digit; their progress is told."""
    plan = make_set_plan(few(), steps=128, episodes=2, config=config())
    folder, told = seed_folder(tmp_path / "s", 1), []
    folder.mkdir(parents=True)
    write_plan(folder, plan.model_copy(update={"seed": 1}))
    seeds = range(1, 2 + count)
    with hold(folder / LOCK_FILE), pytest.raises(RunError, match="another process tr"):
        train_seeds(plan, seeds, tmp_path / "s", lambda *a: told.append(a))
    assert {seed for seed, _, _ in told} == set(seeds[1:])
    for seed in seeds[1:]:
        folder = seed_folder(tmp_path / "s", seed)
        assert (folder / POLICY).is_file()
        alone = train(plan.model_copy(update={"seed": seed}), tmp_path / f"{seed}")
        plain = [replace(point, seconds=0.0) for point in alone]
        assert [replace(point, seconds=0.0) for point in read_curve(folder)] == plain


@pytest.mark.slow
def test_processes_of_a_killed_command_end(few, config, tmp_path):
    """So that the same command can go on."""
    level, file = few(), config()
    code = (
        "import sys\n"
        "from tdac_agent.training.seeds import train_seeds\n"
        "from tdac_agent.training.set_plan import make_set_plan\n"
        "if __name__ == '__main__':\n"
        f"    plan = make_set_plan({str(level)!r}, steps=10**8, episodes=2,"
        f" config={str(file)!r})\n"
        f"    train_seeds(plan, range(2), __import__('pathlib').Path("
        f"{str(tmp_path / 's')!r}), lambda *_: print('on', flush=True))\n"
    )
    script = tmp_path / "run.py"
    script.write_text(code)
    command = [sys.executable, str(script)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "on\n"
        process.kill()
        # The processes that it started have this pipe, too: it ends with them.
        process.stdout.read()
    with hold(seed_folder(tmp_path / "s", 0) / LOCK_FILE) as held:
        assert held
