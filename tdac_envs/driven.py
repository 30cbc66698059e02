"""What the environments share: a robot on two wheels drives to a goal."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tdac_envs.arguments import not_negative, one_of, wheel_command, whole_number
from tdac_envs.render import ending
from tdac_envs.rewards import RewardWeights, step_reward

if TYPE_CHECKING:
    from tdac_envs.window import Window

Observation = dict[str, NDArray[np.float32]]
# Whether something was touched, whether the goal was reached, the length of the way
# that is left, the straight distance to the goal, and the room around the body.
Outcome = tuple[bool, bool, float, float, float]


class DrivenEnv(gym.Env[Observation, NDArray[np.float32]]):
    """An environment whose actions are the speeds of two wheels.

    A subclass moves the robot (`_moved`), observes (`_observation`) and draws
    (`_frame`); its `reset` calls `_begin`.

    Args:
        on_collision: `"terminate"` or `"block"`.
        wheel_slip: Standard deviation of each wheel's speed, relative to it.
        motor_lag: Time constant of the wheel speeds, s.
        delay: Steps by which an action takes effect late.
        full_step: Way of one step at full speed, px or m.
        dt: Duration of a step, s.
        render_mode: `"rgb_array"`, `"human"` or None.

    Attributes:
        title: Of the window.
    """

    title: str

    def __init__(
        self,
        *,
        on_collision: str,
        wheel_slip: float,
        motor_lag: float,
        delay: int,
        full_step: float,
        dt: float,
        render_mode: str | None,
    ) -> None:
        one_of("on_collision", on_collision, ("terminate", "block"))
        one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        self.on_collision = on_collision
        self.wheel_slip = not_negative("wheel_slip", wheel_slip)
        self.motor_lag = not_negative("motor_lag", motor_lag)
        self.delay = whole_number("delay", delay, 0)
        self.weights = RewardWeights()
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": max(round(1.0 / dt), 1)}
        self.action_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._full_step = full_step
        self._command = np.array([0.0, 0.0, 1.0, 1.0])
        self._window: Window | None = None

    def _begin(self, start: tuple[float, float], way: float, horizon: int) -> None:
        """Begins an episode; `way` is the length of the shortest path."""
        self._queue = deque([(0.0, 0.0)] * self.delay)
        self._steps = self._collisions = self._clipped = 0
        self._horizon = horizon
        self._remaining = way
        self._trail = [start]
        self._status = ""

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Applies wheel speeds for one `dt`.

        Raises:
            ValueError: The action is not two finite numbers.
        """
        self._command[0], self._command[1] = self._wanted(action)
        if self.wheel_slip:
            self._command[2:] = self.np_random.normal(1.0, self.wheel_slip, 2)
        collided, reached, remaining, gap, room = self._moved()
        self._steps += 1
        self._collisions += collided
        progress = (self._remaining - remaining) / self._full_step
        self._remaining = remaining
        terminated = reached or (collided and self.on_collision == "terminate")
        truncated = not terminated and self._steps >= self._horizon
        if self.render_mode is not None:
            self._note(reached, collided, truncated)
        reward = step_reward(self.weights, progress, reached, collided)
        info = self._info(reached, collided, gap, room)
        return self._observation(), reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """The current frame, uint8 (height, width, 3), or None in a window."""
        if self.render_mode is None:
            gym.logger.warn("render() needs gym.make(..., render_mode='rgb_array')")
            return None
        frame = self._frame()
        if self.render_mode == "rgb_array":
            return frame
        if self._window is None:
            from tdac_envs.window import Window

            self._window = Window(self.title, self.metadata["render_fps"])
        self._window.show(frame)
        return None

    def close(self) -> None:
        """Closes the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def pose(self) -> NDArray[np.float64]:
        """The true pose, shape (3,): x, y (px or m), heading (rad)."""
        raise NotImplementedError

    def _moved(self) -> Outcome:
        """Moves the robot as `_command` says: speeds and slip of both wheels."""
        raise NotImplementedError

    def _observation(self) -> Observation:
        raise NotImplementedError

    def _frame(self) -> NDArray[np.uint8]:
        raise NotImplementedError

    def _wanted(self, action: Any) -> tuple[float, float]:
        """The wheel speeds of an action, clipped and delayed."""
        wheels, clipped = wheel_command(action)
        self._clipped += clipped
        if self.delay:
            self._queue.append(wheels)
            wheels = self._queue.popleft()
        return wheels

    def _info(
        self, reached: bool, collided: bool, gap: float, room: float
    ) -> dict[str, Any]:
        return {
            "is_success": reached,
            "collision": collided,
            "collisions": self._collisions,
            "clipped": self._clipped,
            "distance_to_goal": gap,
            "path_distance": self._remaining,
            "clearance": room,
        }

    def _note(self, reached: bool, collided: bool, truncated: bool) -> None:
        x, y, _ = self.pose().tolist()
        self._trail.append((x, y))
        self._status = ending(reached, collided, truncated) or self._status
        if self.render_mode == "human":
            self.render()
