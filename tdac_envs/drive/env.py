"""Base class of the environments: a two-wheeled robot drives to a goal."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Addresses, Words
from tdac_envs.core.arguments import one_of
from tdac_envs.drawing.runs import outcome_of
from tdac_envs.drive.disturbances import measured
from tdac_envs.drive.gap_search import GapWatch
from tdac_envs.drive.setup import DriveSetup
from tdac_envs.drive.stepping import (
    HEADING,
    LEFT,
    RIGHT,
    info_of,
)

if TYPE_CHECKING:
    from tdac_envs.drawing.window import Window

Observation = dict[str, NDArray[np.float32]]


class DrivenEnv(gym.Env[Observation, NDArray[np.float32]]):
    """Base class of the environments whose actions are two wheel speeds.

    A subclass provides the robot's arrays (`robot`), the compiled step (`_call_drive`),
    the observation (`_observation`) and the picture (`_frame`).

    Args:
        setup: What does not change between episodes.
        render_mode: `"rgb_array"`, `"human"` or None.

    Attributes:
        info_of: The `info` of a step, from `robot.outcome` as a list.
        title: Title of the window.
        robot: Arrays of the robot; see `tdac_envs.drive.stepping`.
        ends: Whether an episode must not be stepped on after its end.
        task: The task of the current episode.
        nominal: The task without variation.
    """

    info_of: Callable[[list[float]], dict[str, Any]] = staticmethod(info_of)
    title: str
    ends = True
    robot: Any
    task: Any
    nominal: Any
    _scene: Any
    _solid: Any = None
    _solid_picture: Callable[[Any], Any]
    _call_drive: Callable[[], None]
    _note_gap: Callable[..., None]
    addresses: Addresses
    _random: np.random.Generator
    _steps: int
    _trail: list[tuple[float, float]]
    _status: str
    _is_over = False
    _has_warned = False

    def __init__(self, setup: DriveSetup, render_mode: str | None) -> None:
        one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        self.setup: Any = setup
        self.nominal = self.task = nominal = setup.nominal
        self.variation, self.on_collision = setup.variation, setup.on_collision
        self.motor_lag, self.delay = setup.motor_lag, setup.delay
        self.weights, self.disturbances = setup.weights, setup.disturbances
        self.wheel_slip = self.disturbances.wheel_slip
        sizes = nominal.full_step, nominal.axle_length
        self._limits = self.disturbances.odometry_limits(*sizes)
        self.render_mode = render_mode
        rate = max(round(1.0 / nominal.dt), 1)
        self.metadata = {**self.metadata, "render_fps": rate}
        self.action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._window: Window | None = None

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Runs one time step with the wheel speeds of an action.

        After the end of an episode it warns, once: `reset` must be called first.

        Raises:
            ValueError: The action is not two finite numbers.
        """
        if self._is_over:
            self._warn_of_the_end()
        state = self.robot.state
        state[LEFT], state[RIGHT] = wheel_speeds(action)
        if self.wheel_slip:
            self.disturbances.slip(state, self._random)
        self._call_drive()
        outcome = self.robot.outcome.tolist()
        reward, terminated, truncated = outcome[0], outcome[1] == 1.0, outcome[2] == 1.0
        if terminated or truncated:
            self._is_over = self.ends
        info = self.info_of(outcome)
        if self.render_mode is not None:
            self._note(info["is_success"], info["collision"], truncated)
        return self._observation(), reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """The current frame, uint8 (height, width, 3); None for `"human"`."""
        if self.render_mode is None:
            gym.logger.warn("render() needs gym.make(..., render_mode='rgb_array')")
            return None
        frame = self._frame() if self.setup.view == "2d" else self._solid_frame()
        if self.render_mode == "rgb_array":
            return frame
        if self._window is None:
            from tdac_envs.drawing.window import Window

            self._window = Window(self.title, self.metadata["render_fps"])
        self._window.show(frame)
        return None

    def _solid_frame(self) -> NDArray[np.uint8]:
        """The current frame in three dimensions."""
        if self._solid is None:
            self._solid = self._solid_picture(self.task)
        pose = self.robot.state[: HEADING + 1].tolist()
        shown = self._trail, self.things(), self.discs()
        frame: NDArray[np.uint8] = self._solid.frame(pose, *shown)
        return frame

    def close(self) -> None:
        """Closes the window, if one is open."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def pose(self) -> NDArray[np.float64]:
        """The true pose, shape (3,): x, y (px or m), heading (rad)."""
        pose: NDArray[np.float64] = self.robot.state[: HEADING + 1].copy()
        return pose

    def observed_pose(self) -> NDArray[np.float64]:
        """The pose as it is observed, in the frame of `pose`, shape (3,)."""
        return self.pose()

    def discs(self) -> NDArray[np.float64]:
        """Moving obstacles as they are now, shape (n, 3): x, y, radius (px or m)."""
        return np.zeros((0, 3))

    def things(self) -> NDArray[np.float64]:
        """Centre and rotation since the reset (rad) of movable objects, (k, 3)."""
        return np.zeros((0, 3))

    def watch_gap(
        self, words: Words | None = None, required: float | None = None
    ) -> GapWatch:
        """A watch of the smallest gap in the episode that has just begun.

        Args:
            words: Addresses of the arrays of another robot; by default the own ones.
            required: The gap that this robot should keep; by default `required_gap`.
        """
        own = self.addresses.words[0] if words is None else words
        kept = self.required_gap if required is None else required
        return GapWatch(self._note_gap, own, kept, self.nominal.body_radius)

    @property
    def required_gap(self) -> float:
        """The gap to obstacles that the robot should keep, px or m."""
        required: float = self.setup.gap_in_episode(self.task)
        return required

    def _draw(self, options: dict[str, Any]) -> Any:
        """Draws the task of an episode, and returns it."""
        drawn = self.setup.draw(options, self.np_random)
        self.task, self._random = drawn
        self._is_over = self._has_warned = False
        return self.task

    def _warn_of_the_end(self) -> None:
        """Warns once in an episode that it has ended."""
        if not self._has_warned:
            self._has_warned = True
            gym.logger.warn(
                "You are calling step() although the episode has ended (terminated or "
                "truncated). Call reset() first: the results of further steps are "
                "undefined."
            )

    def _hide(self) -> None:
        """Draws the hidden errors of an episode, after its task."""
        axle_length = self.task.axle_length
        self.disturbances.hide(self.robot.constants, axle_length, self._random)

    def _odometry(self) -> NDArray[np.float32]:
        """The measured distance and turn of the last step, shape (2,)."""
        robot, own = self.robot, self.disturbances
        noise = own.noise(robot.state, self._random)
        return measured(robot.state, robot.constants, noise, self._limits)

    def _observation(self) -> Observation:
        raise NotImplementedError

    def _frame(self) -> NDArray[np.uint8]:
        raise NotImplementedError

    def _begin_trail(self) -> None:
        """Begins the picture of an episode at the start of the task."""
        self._steps = 0
        self._trail = [self.task.start[:2]]
        self._status = ""
        self._scene = self._solid = None

    def _note(self, reached: bool, collided: bool, truncated: bool) -> None:
        """Adds a step to the picture of the episode."""
        self._steps += 1
        x, y, _ = self.pose().tolist()
        self._trail.append((x, y))
        self._status = outcome_of(reached, collided, truncated) or self._status
        if self.render_mode == "human":
            self.render()


def wheel_speeds(action: Any) -> tuple[float, float]:
    """The wheel speeds of an action, unclipped.

    Raises:
        ValueError: The action is not two finite numbers.
    """
    try:
        array = action if type(action) is np.ndarray else np.asarray(action)
        left, right = array.tolist()
        # False for NaN and infinity.
        if 0.0 * left + 0.0 * right == 0.0:
            return float(left), float(right)
    except (TypeError, ValueError):
        pass
    raise ValueError(_not_an_action(action)) from None


def _not_an_action(action: Any) -> str:
    return f"expected an action of two finite numbers in [-1, 1], got {action!r}"
