"""A training with stable-baselines3: steps, evaluations, checkpoints.

Needs the extra `tdac[sb3]`, so import this module only where it is used.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

from tdac_agent.episodes.memory_policy import MemoryPolicy
from tdac_agent.errors import RunError
from tdac_agent.training.checkpoint_marks import CHECKPOINT, REPLAY, install_checkpoint
from tdac_agent.training.curve import Point, read_curve, write_curve
from tdac_agent.training.first_weights import load_first
from tdac_agent.training.hyperparameters import model_arguments
from tdac_agent.training.plan import TrainingPlan, make_batch
from tdac_agent.training.policy_files import LAST, write_best, write_policy
from tdac_agent.training.set_plan import make_set_batch, make_trials
from tdac_envs.learning.wrapped_vector import Seen, WrappedVectorEnv

ALGOS = {"ppo": PPO, "recurrent-ppo": RecurrentPPO, "sac": SAC, "td3": TD3}
POLICIES = {f"{MemoryPolicy.__module__}.{MemoryPolicy.__qualname__}": MemoryPolicy}
"""Policy classes besides those that stable-baselines3 knows by name."""
EVALUATION_SEED = 1_000_000
"""Added to the training seed; `tdac evaluate` uses other episodes."""
_Trials = VecMonitor | WrappedVectorEnv
"""The robots of the evaluations: on tasks, or on worlds of a set."""
Watch = Callable[[int, Point | None, Point | None], None]
"""Called with the steps so far, the new evaluation if any, and the best one."""


def learn(
    plan: TrainingPlan, folder: Path, watch: Watch, threads: int | None = None
) -> list[Point]:
    """Trains to the end of a plan, from the folder's last checkpoint if it has one.

    A checkpoint follows each evaluation, so that a crash loses only the training since
    the last one. A resumed training begins new episodes.

    Args:
        plan: Plan of the training.
        folder: Folder of the training.
        watch: Called with the progress; see `Watch`.
        threads: Number of threads that step robots; by default the number of cores.

    Returns:
        The learning curve.

    Raises:
        RunError: The checkpoint cannot be read.
    """
    # Networks of this size are slower with more than one thread.
    torch.set_num_threads(1)
    if plan.set is None:
        batch = make_batch(plan, plan.n_envs, training=True, threads=threads)
    else:
        batch = make_set_batch(plan, threads)
    envs = VecMonitor(batch, info_keywords=("is_success",))
    trials = _trials(plan, threads)
    try:
        model = _model(plan, folder, envs)
        done = int(model.num_timesteps)
        points = [point for point in read_curve(folder) if point.steps <= done]
        envs.seed(plan.seed + done * plan.n_envs)
        callback = _Evaluations(plan, folder, trials, points, watch)
        if done < plan.steps:
            model.learn(plan.steps - done, callback, reset_num_timesteps=False)
            callback.finish()
        return callback.points
    finally:
        envs.close()
        trials.close()


def _trials(plan: TrainingPlan, threads: int | None) -> _Trials:
    if plan.set is not None:
        return make_trials(plan, threads)
    batch = make_batch(plan, plan.episodes, threads=threads)
    return VecMonitor(batch, info_keywords=("collision",))


def evaluate_batch(model: Any, envs: VecMonitor, seed: int | Sequence[int]) -> Point:
    """Runs one episode of each robot of a batch, with deterministic actions.

    Args:
        model: Model with a method `predict`.
        envs: The batch; the first episode of each robot counts.
        seed: Seed of the first robot's episode, or a seed for each robot.

    Returns:
        The results, with 0 steps, 0 seconds and no success rate in training (nan).
    """
    envs.venv.seed(seed)  # type: ignore[arg-type]
    observations: Any = envs.reset()
    ended: list[dict[str, Any] | None] = [None] * envs.num_envs
    state, over = None, np.ones(envs.num_envs, np.bool_)
    while None in ended:
        actions, state = model.predict(observations, state, over, deterministic=True)
        observations, _, over, infos = envs.step(actions)
        for i in np.flatnonzero(over).tolist():
            ended[i] = ended[i] or infos[i]
    episodes = [info for info in ended if info is not None]

    return _point(
        [info["is_success"] for info in episodes],
        [info["collision"] for info in episodes],
        [info["episode"]["r"] for info in episodes],
        [info["episode"]["l"] for info in episodes],
    )


def _point(*columns: Any) -> Point:
    """The results of an evaluation whose steps and seconds are not known yet."""
    reached, hit, gained, steps = (round(float(np.mean(each)), 6) for each in columns)
    return Point(0, 0.0, reached, hit, gained, steps, float("nan"))


class _Evaluations(BaseCallback):
    """Evaluates at intervals, keeps the best policy, and writes checkpoints."""

    def __init__(
        self,
        plan: TrainingPlan,
        folder: Path,
        trials: _Trials,
        points: list[Point],
        watch: Watch,
    ) -> None:
        super().__init__()
        self.points = points
        self._plan, self._folder, self._trials = plan, folder, trials
        self._watch = watch
        before = points[-1].seconds if points else 0.0
        self._began = time.perf_counter() - before
        self._best = max(points, key=lambda point: point.worth, default=None)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        steps = int(self.model.num_timesteps)
        self._watch(steps, None, self._best)
        last = self.points[-1].steps if self.points else 0
        if steps - last >= self._plan.evaluate_every:
            self._evaluate(steps)

    def finish(self) -> None:
        """Evaluates the model if it was trained after the last evaluation; keeps it."""
        steps = int(self.model.num_timesteps)
        write_policy(self.model, self._folder / LAST, self._plan, steps)
        if not self.points or self.points[-1].steps < steps:
            self._evaluate(steps)

    def _evaluate(self, steps: int) -> None:
        if isinstance(self._trials, WrappedVectorEnv):
            result = evaluate_on_worlds(self.model, self._trials, self._plan.episodes)
        else:
            seed = EVALUATION_SEED + self._plan.seed
            result = evaluate_batch(self.model, self._trials, seed)
        seen = [info["is_success"] for info in self.model.ep_info_buffer or ()]
        point = replace(
            result,
            steps=steps,
            seconds=round(time.perf_counter() - self._began, 3),
            train_success_rate=round(float(np.mean(seen)), 6) if seen else float("nan"),
        )
        if self._best is None or point.worth >= self._best.worth:
            self._best = point
            write_best(self.model, self._folder, self._plan, point)
        self.points.append(point)
        write_curve(self._folder, self.points)
        _write_checkpoint(self.model, self._folder)
        self._watch(steps, point, self._best)


def _model(plan: TrainingPlan, folder: Path, envs: VecMonitor) -> Any:
    """The model of the last checkpoint, or a new one."""
    kind: Any = ALGOS[plan.algo]
    log = None
    if importlib.util.find_spec("tensorboard") is not None:
        log = str(folder / "tensorboard")
    file = folder / CHECKPOINT
    if not file.is_file():
        chosen = {"seed": plan.seed, "device": "cpu", "tensorboard_log": log}
        chosen |= model_arguments(plan.hyperparameters)
        try:
            model = kind(POLICIES.get(plan.policy, plan.policy), envs, **chosen)
        except (TypeError, ValueError, AssertionError) as error:
            reason = " ".join(str(error).split())
            raise RunError(f"hyperparameters of {plan.algo}: {reason}") from error
        _act_at_first(model, plan)
        load_first(model, plan)
        return model
    try:
        model = kind.load(file, envs, device="cpu", tensorboard_log=log)
        if (folder / REPLAY).is_file():
            model.load_replay_buffer(folder / REPLAY)
    # The pickles in a damaged or foreign file may raise anything.
    except Exception as error:
        reason = " ".join(str(error).split())[:160]
        raise RunError(f"cannot resume from {file}: {reason}") from error
    return model


def _act_at_first(model: Any, plan: TrainingPlan) -> None:
    """Makes the initial action of a plan the mean of a new policy.

    Raises:
        RunError: The policy has no mean action.
    """
    if not plan.initial_action:
        return
    last = getattr(model.policy, "action_net", None)
    if not isinstance(last, torch.nn.Linear):
        raise RunError(f"hyperparameters of {plan.algo}: it has no initial_action")
    with torch.no_grad():
        last.bias.add_(plan.initial_action)


def _write_checkpoint(model: Any, folder: Path) -> None:
    saves = {CHECKPOINT: model.save}
    if hasattr(model, "replay_buffer"):
        saves = {REPLAY: model.save_replay_buffer, **saves}
    for name, save in saves.items():
        draft = folder / f".{name}"
        save(draft)
        install_checkpoint(draft, folder / name)


def evaluate_on_worlds(model: Any, trials: WrappedVectorEnv, worlds: int) -> Point:
    """Drives once through each of the first worlds, with deterministic actions.

    A robot that has ended takes the next world, so the few that drive until the horizon
    do not keep the others waiting.

    Args:
        model: Model with a method `predict`.
        trials: The robots, which are not reset automatically.
        worlds: Number of worlds.

    Returns:
        The results, with 0 steps, 0 seconds and no success rate in training (nan).
    """
    count = trials.num_envs
    reached, hit, returns, lengths = np.zeros((4, worlds))
    # The world of each robot; behind the last one, results do not count.
    world = np.arange(count)
    following = count
    seen = _begun(trials, world % worlds)
    state, over = None, np.ones(count, np.bool_)
    while (world < worlds).any():
        actions, state = model.predict(seen, state, over, deterministic=True)
        seen, rewards, terminated, truncated, infos = trials.step(actions)
        counts = world < worlds
        returns[world[counts]] += rewards[counts]
        lengths[world[counts]] += 1
        over = terminated | truncated
        ended = over & counts
        if ended.any():
            reached[world[ended]] = infos["is_success"][ended]
            hit[world[ended]] = infos["collision"][ended]
        for i in np.flatnonzero(over).tolist():
            world[i], following = following, following + 1
            mask = np.arange(count) == i
            index = min(int(world[i]), worlds - 1)
            seen, _ = trials.reset(options={"index": index, "reset_mask": mask})
    return _point(reached, hit, returns, lengths)


def _begun(trials: WrappedVectorEnv, worlds: NDArray[np.int64]) -> Seen:
    """The first observations, of each robot in its world."""
    rows: list[Any] = []
    for i, index in enumerate(worlds.tolist()):
        mask = np.arange(trials.num_envs) == i
        seen, _ = trials.reset(options={"index": index, "reset_mask": mask})
        rows.append(
            {key: value[i] for key, value in seen.items()}
            if isinstance(seen, dict)
            else seen[i]
        )
    if isinstance(rows[0], dict):
        return {key: np.stack([row[key] for row in rows]) for key in rows[0]}
    return np.stack(rows)
