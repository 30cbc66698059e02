"""Policies of other trainings: what they were trained with goes with them."""

import json
import zipfile

import gymnasium as gym
import numpy as np
import pytest
from few_worlds import write_short_set

from tdac_agent.bench.bench import bench
from tdac_agent.episodes.sb3_file import read_policy
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.evaluation.evaluate import evaluate
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


def test_statistics_and_stacked_frames_go_with_it(level, tmp_path):
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

    found = evaluate([tmp_path / "mine.zip"], [load_set(level)], 4, split="dev")
    rows = [(each.steps, each.success) for each in found.results[0].episodes]
    assert rows == driven(model, make, 4)


def test_a_policy_of_single_environments(level, tmp_path):
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
    found = evaluate([tmp_path / "mine.zip"], [load_set(level)], 2, split="dev")
    assert found.rows[0].episodes == 2


def test_noise_is_the_same_again(level, tmp_path):
    """It is drawn from the world's number; without it, the drive is another."""
    model = learned(batch(level))
    files = [tmp_path / name for name in ("noisy.zip", "likely.zip")]
    save_policy(model, files[0], noisy=True)
    save_policy(model, files[1])
    tasks = load_set(level)
    runs = [
        evaluate([file], [tasks], 3, split="dev").results[0].episodes
        for file in (files[0], files[0], files[1])
    ]
    first, again, likely = ([(e.steps, e.driven) for e in run] for run in runs)
    assert first == again != likely


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


@pytest.mark.parametrize(
    ("after", "match"),
    [
        ([{"kind": "normalize", "mean": [0.0], "var": [1.0]}], "normalises 1 numbers"),
        ([{"kind": "normalize", "mean": [0.0], "var": [-1.0]}], "var"),
        ([{"kind": "frames", "count": 1000}], "at most 64"),
        ([{"kind": "pickle", "file": "x"}], "expected"),
    ],
)
def test_a_record_that_does_not_fit_is_refused(level, tmp_path, after, match):
    """Before anything is driven."""
    file = tmp_path / "mine.zip"
    save_policy(learned(batch(level)), file)
    with zipfile.ZipFile(file) as old:
        parts = {name: old.read(name) for name in old.namelist()}
    record = json.loads(parts.pop("tdac.json"))
    with zipfile.ZipFile(file, "w") as new:
        for name, content in parts.items():
            new.writestr(name, content)
        new.writestr("tdac.json", json.dumps(record | {"after": after}))
    with pytest.raises(ControllerFileError, match=match):
        evaluate([file], [load_set(level)], 1, split="dev")


WEIGHTED = """
import numpy as np

W = np.load("weights.npz")
scale = W["scale"]


def policy(obs):
    return scale * 1.0, scale * 0.5
"""


def test_another_trainers_policy_has_its_weights_beside_it(level, tmp_path):
    """They are in the sandbox as weights.npz; the table calls it learned."""
    file = tmp_path / "mine.py"
    file.write_text(WEIGHTED)
    np.savez(tmp_path / "mine.npz", scale=0.5)
    tasks = load_set(level)
    one = evaluate([file], [tasks], 2, split="dev")
    (row,) = bench([str(file)], [level], "dev", 2, out=tmp_path / "bench").rows
    assert (row.kind, row.worlds) == ("learned", 2)
    np.savez(tmp_path / "mine.npz", scale=-0.5)
    other = evaluate([file], [tasks], 2, split="dev")
    hashes = {found.rows[0].controller_sha256 for found in (one, other)}
    assert len(hashes) == 2
    steps = [[e.steps for e in found.results[0].episodes] for found in (one, other)]
    assert steps[0] != steps[1]
    (tmp_path / "mine.npz").write_bytes(bytes(17 << 20))
    with pytest.raises(ControllerFileError, match="weights"):
        evaluate([file], [tasks], 2, split="dev")
