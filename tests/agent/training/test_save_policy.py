"""Policies of other trainings: what they were trained with goes with them."""

import json
import os
import zipfile

import gymnasium as gym
import numpy as np
import pytest
from few_worlds import write_short_set

pytest.importorskip("stable_baselines3")

from tdac_agent.bench.bench import bench
from tdac_agent.episodes.sb3_file import read_policy
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.evaluation.evaluate import evaluate
from tdac_agent.evaluation.policies import entrant_of, fitted
from tdac_agent.evaluation.replay import drive_episode
from tdac_agent.problems.part import Part
from tdac_agent.training.save_policy import save_policy
from tdac_envs import load_set, wrap_for_rl

LADDER = "TDAC-Ladder-v0"


@pytest.fixture
def level(tmp_path):
    """A set of small worlds and short episodes; its path."""
    return write_short_set(tmp_path / "few.yaml", 30, name="few")


def batch(level, wrappers=None):
    """Eight robots of a training."""
    from tdac_envs.sb3 import SB3VecEnv

    made = gym.make_vec(LADDER, 8, level=level, autoreset_mode="SameStep", train_pool=4)
    return SB3VecEnv(wrap_for_rl(made, wrappers))


def learned(envs, **options):
    """A model after a short training."""
    from stable_baselines3 import PPO

    sizes = {"n_steps": 16, "batch_size": 16, "n_epochs": 1, "device": "cpu", "seed": 0}
    policy = options.pop("policy", "MlpPolicy")
    return PPO(policy, envs, **sizes, **options).learn(256)


def driven(model, make, worlds):
    """Steps and successes of each world, as SB3's own environments drive it."""
    found = []
    for index in range(worlds):
        envs = make()
        envs.set_options({"index": index})
        seen, over, steps = envs.reset(), [False], 0
        while not over[0]:
            action, _ = model.predict(seen, deterministic=True)
            seen, _, over, infos = envs.step(action)
            steps += 1
        found.append((steps, infos[0]["is_success"]))
    return found


@pytest.mark.slow
def test_statistics_and_stacked_frames_go_with_it(level, tmp_path, warm):
    """The judge drives as SB3 does, to the step."""
    from stable_baselines3.common.vec_env import (
        DummyVecEnv,
        VecFrameStack,
        VecNormalize,
    )

    envs = VecNormalize(VecFrameStack(batch(level), 3), clip_obs=5.0)
    model = learned(envs)
    saved = save_policy(model, tmp_path / "mine.zip")
    assert [each.kind for each in saved.after] == ["frames", "normalize"]
    assert (saved.set, saved.set_sha256) == ("few", load_set(level).sha256)
    assert saved.wrappers == ("goal-relative", "closeness", "flatten")
    assert read_policy(tmp_path / "mine.zip").saved == saved

    def make():
        one = DummyVecEnv(
            [lambda: wrap_for_rl(gym.make(LADDER, level=level, split="dev"))]
        )
        own = VecNormalize(VecFrameStack(one, 3), clip_obs=5.0, training=False)
        own.obs_rms = envs.obs_rms
        return own

    tasks = load_set(level)
    found = evaluate([tmp_path / "mine.zip"], [tasks], 4, split="dev", judge=warm)
    rows = [(each.steps, each.success) for each in found.results[0].episodes]
    assert rows == driven(model, make, 4)


@pytest.mark.slow
def test_a_policy_of_single_environments(level, tmp_path, warm):
    """Wrappers are found by their classes; observations in a Dict, with statistics."""
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    names = ["goal-relative", "closeness"]

    def make():
        return Monitor(wrap_for_rl(gym.make(LADDER, level=level), names))

    envs = VecNormalize(DummyVecEnv([make]), norm_obs_keys=["ranges"])
    kwargs = {"features_extractor_kwargs": {"cnn_output_dim": 8}}
    model = learned(envs, policy="MultiInputPolicy", policy_kwargs=kwargs)
    saved = save_policy(model, tmp_path / "mine.zip")
    assert saved.wrappers == tuple(names)
    assert list(saved.after[0].mean) == ["ranges"]
    tasks = load_set(level)
    found = evaluate([tmp_path / "mine.zip"], [tasks], 2, split="dev", judge=warm)
    assert found.rows[0].episodes == 2


@pytest.mark.slow
def test_noise_is_the_same_again(level, tmp_path, warm):
    """It is drawn from the world's number; without it, the drive is another."""
    model = learned(batch(level))
    files = [tmp_path / name for name in ("noisy.zip", "likely.zip")]
    save_policy(model, files[0], noisy=True)
    save_policy(model, files[1])
    tasks = load_set(level)
    runs = [
        evaluate([file], [tasks], 3, split="dev", judge=warm).results[0].episodes
        for file in (files[0], files[0], files[1])
    ]
    first, again, likely = ([(e.steps, e.driven) for e in run] for run in runs)
    assert first == again != likely


@pytest.mark.slow
def test_what_cannot_be_recorded_is_refused(level, tmp_path):
    """In one line that says what to do; nothing is written."""
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    class Own(gym.ObservationWrapper):
        def observation(self, observation):
            return observation

    own = DummyVecEnv([lambda: Own(wrap_for_rl(gym.make(LADDER, level=level)))])
    with pytest.raises(RunError, match="Own cannot be recorded: train with"):
        save_policy(learned(own), tmp_path / "mine.zip")
    with pytest.raises(RunError, match="expected environments of tdac_envs"):
        save_policy(learned(DummyVecEnv([lambda: gym.make("Pendulum-v1")])), "x.zip")
    model = learned(batch(level))
    with pytest.raises(RunError, match=r"expected a file NAME\.zip"):
        save_policy(model, tmp_path / "mine")
    with pytest.raises(RunError, match="cannot write"):
        save_policy(model, level / "mine.zip")
    model.env = None
    with pytest.raises(RunError, match="no environments"):
        save_policy(model, tmp_path / "mine.zip")
    assert not list(tmp_path.glob("*.zip"))
    assert SubprocVecEnv is not None


def changed(file, **parts):
    """Replaces parts of a policy's file, by functions of their values."""
    with zipfile.ZipFile(file) as old:
        held = {name: old.read(name) for name in old.namelist()}
    for name, change in parts.items():
        key = {"record": "tdac.json"}.get(name, name)
        held[key] = json.dumps(change(json.loads(held[key]))).encode()
    with zipfile.ZipFile(file, "w") as new:
        for name, content in held.items():
            new.writestr(name, content)


SCALED = {"kind": "normalize", "mean": [0.0] * 77, "var": [1.0] * 77}
MANY = {str(number): [0.0] for number in range(65)}


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A set, and the file of a policy for it."""
    folder = tmp_path_factory.mktemp("trained")
    level = write_short_set(folder / "few.yaml", 30, name="few")
    save_policy(learned(batch(level)), folder / "mine.zip")
    return level, folder / "mine.zip"


@pytest.mark.parametrize(
    ("after", "match"),
    [
        ([SCALED | {"mean": [0.0], "var": [1.0]}], "normalises 1 numbers"),
        ([SCALED | {"var": [-1.0]}], "var"),
        ([SCALED | {"mean": [1e300]}], "mean"),
        ([SCALED | {"clip": 1e300}], "clip"),
        ([SCALED | {"clip": float("inf")}], "finite"),
        ([SCALED | {"mean": MANY, "var": MANY}], "valid list"),
        ([{"kind": "frames", "count": 1000}], "at most 64"),
        ([{"kind": "frames", "count": 64}] * 8, "stacks [0-9,]* numbers"),
        ([{"kind": "pickle", "file": "x"}], "expected"),
        ([{"kind": "frames", "count": 1, "x": "a" * 17_000_000}], "is larger than"),
    ],
)
def test_a_record_that_does_not_fit_is_refused(trained, tmp_path, after, match):
    """Before anything is driven, and before it takes memory."""
    level, file = trained
    own = tmp_path / "own.zip"
    own.write_bytes(file.read_bytes())
    changed(own, record=lambda record: record | {"after": after})
    with pytest.raises(ControllerFileError, match=match):
        evaluate([own], [load_set(level)], 1, split="dev")


@pytest.mark.parametrize("name", ["CombinedExtractor", "NatureCNN"])
def test_an_extractor_that_does_not_fit_is_refused(trained, tmp_path, name):
    """Extractors of pictures or of a Dict, for a row of numbers."""
    level, file = trained
    own = tmp_path / "own.zip"
    own.write_bytes(file.read_bytes())
    kind = f"<class 'stable_baselines3.common.torch_layers.{name}'>"
    kwargs = {"features_extractor_class": kind}
    changed(own, data=lambda data: data | {"policy_kwargs": kwargs})
    with pytest.raises(ControllerFileError, match="settings do not fit its class"):
        evaluate([own], [load_set(level)], 1, split="dev")


def test_statistics_without_bounds_are_recorded_or_refused(level, tmp_path):
    """No clipping is clipping at a huge number; what is not a number is refused."""
    from stable_baselines3.common.vec_env import VecNormalize

    envs = VecNormalize(batch(level), clip_obs=np.inf)
    model = learned(envs)
    (stage,) = save_policy(model, tmp_path / "mine.zip").after
    assert stage.clip == 1e30
    assert read_policy(tmp_path / "mine.zip").saved.after == (stage,)
    envs.obs_rms.mean[0] = np.nan
    with pytest.raises(RunError, match="cannot record the policy"):
        save_policy(model, tmp_path / "other.zip")
    assert not list(tmp_path.glob("*other*"))


WEIGHTED = """
import numpy as np

W = np.load("weights.npz")
scale = W["scale"]


def policy(obs):
    return scale * 1.0, scale * 0.5
"""


@pytest.mark.slow
def test_another_trainers_policy_has_its_weights_beside_it(level, tmp_path, warm):
    """They are in the sandbox as weights.npz; the table calls it learned."""
    file = tmp_path / "mine.py"
    file.write_text(WEIGHTED)
    np.savez(tmp_path / "mine.npz", scale=0.5)
    tasks = load_set(level)
    one = evaluate([file], [tasks], 2, split="dev", judge=warm)
    out = tmp_path / "bench"
    (row,) = bench([str(file)], [level], "dev", 2, out=out, judge=warm).rows
    assert (row.kind, row.worlds) == ("learned", 2)
    assert row.trained_here is False
    np.savez(tmp_path / "mine.npz", scale=-0.5)
    other = evaluate([file], [tasks], 2, split="dev", judge=warm)
    hashes = {found.rows[0].controller_sha256 for found in (one, other)}
    assert len(hashes) == 2
    steps = [[e.steps for e in found.results[0].episodes] for found in (one, other)]
    assert steps[0] != steps[1]
    (tmp_path / "mine.npz").write_bytes(bytes(17 << 20))
    with pytest.raises(ControllerFileError, match="weights"):
        evaluate([file], [tasks], 2, split="dev")


@pytest.mark.parametrize("odd", ["link", "lost link", "pipe", "folder", "text"])
def test_odd_weights_are_refused(tmp_path, odd):
    """Links could show the controller any file; a pipe could wait for ever."""
    controller, weights = tmp_path / "mine.py", tmp_path / "mine.npz"
    controller.write_text(WEIGHTED)
    np.savez(tmp_path / "other.npz", scale=0.5)
    if odd.endswith("link"):
        weights.symlink_to(tmp_path / ("other.npz" if odd == "link" else "none.npz"))
    elif odd == "pipe":
        os.mkfifo(weights)
    elif odd == "folder":
        weights.mkdir()
    else:
        weights.write_text("a secret")
    with pytest.raises(ControllerFileError, match=r"'.*': weights .*mine\.npz: \w+"):
        entrant_of(str(controller))


@pytest.mark.slow
def test_what_was_hashed_is_what_drives(level, tmp_path):
    """Files of a controller that change after it was named change nothing."""
    file = tmp_path / "mine.py"
    file.write_text(WEIGHTED)
    np.savez(tmp_path / "mine.npz", scale=0.5)
    tasks = load_set(level)
    entrant = fitted(entrant_of(str(file)), tasks)
    first = drive_episode(entrant, tasks, Part((0,), "dev")).row
    np.savez(tmp_path / "mine.npz", scale=-0.5)
    file.write_text("def policy(obs):\n    return 0.0, 0.0\n")
    again = drive_episode(entrant, tasks, Part((0,), "dev")).row
    assert (first.steps, first.driven) == (again.steps, again.driven)
    assert entrant_of(str(file)).sha256 != entrant.sha256


@pytest.mark.parametrize("command", ["verify", "play"])
def test_commands_without_weights_say_so(tmp_path, command, tdac):
    """Instead of a controller that does not find its file."""
    (tmp_path / "mine.py").write_text(WEIGHTED)
    np.savez(tmp_path / "mine.npz", scale=0.5)
    more = ["--video", tmp_path / "x.gif"] if command == "play" else []
    code, _, err = tdac(command, tmp_path / "mine.py", "--task", "maze", *more)
    assert code == 2
    assert "has weights beside it, mine.npz" in err


def test_what_a_policy_observes_is_part_of_its_hash(trained, tmp_path):
    """A record beside the file, with other frames or noise, makes another policy."""
    file = tmp_path / "mine.zip"
    with zipfile.ZipFile(trained[1]) as old, zipfile.ZipFile(file, "w") as new:
        for name in old.namelist():
            if name != "tdac.json":
                new.writestr(name, old.read(name))
    plain = {"algo": "ppo", "wrappers": ["flatten"]}
    found = set()
    for more in (
        {},
        {"actions": "noisy"},
        {"after": [{"kind": "frames", "count": 2}]},
        {"after": [{"kind": "frames", "count": 3}]},
    ):
        file.with_suffix(".json").write_text(json.dumps(plain | more))
        found.add(entrant_of(str(file)).sha256)
    assert len(found) == 4
