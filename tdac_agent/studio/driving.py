"""Driving through a world of a task set with the keyboard."""

from __future__ import annotations

import numpy as np

from tdac_envs.drawing.canvas import Image
from tdac_envs.ladder.env import TaskSetEnv, make

FORWARD = {"ArrowUp", "w", "W"}
BACKWARD = {"ArrowDown", "s", "S"}
LEFT = {"ArrowLeft", "a", "A"}
RIGHT = {"ArrowRight", "d", "D"}
TURN = 0.45
"""Change of a wheel's speed while a turn key is pressed, as a part of full speed."""


class KeyboardDrive:
    """A drive on a world.

    Args:
        env: The environment.
        index: Number of the world.
    """

    def __init__(self, env: TaskSetEnv, index: int) -> None:
        self._env, self._index = env, index
        self._pressed: set[str] = set()
        self.dt = env.task.dt if env.setup.source is None else env.set.file.dt
        self.begin()

    @classmethod
    def of(cls, name: str, split: str, index: int) -> KeyboardDrive:
        """A drive on a world of a set."""
        return cls(make(name, split=split, render_mode="rgb_array"), index)

    def begin(self) -> None:
        """Puts the robot at its start."""
        self._env.reset(seed=0, options={"index": self._index})
        self._pressed.clear()
        self.over, self.status, self._steps = False, "", 0

    def press(self, key: str, down: bool) -> None:
        """Notes that a key was pressed or released."""
        if down:
            self._pressed.add(key)
        else:
            self._pressed.discard(key)

    def action(self) -> tuple[float, float]:
        """Wheel speeds, left and right, for the pressed keys."""
        ahead = bool(self._pressed & FORWARD) - bool(self._pressed & BACKWARD)
        turn = bool(self._pressed & RIGHT) - bool(self._pressed & LEFT)
        if not ahead:
            return TURN * turn, -TURN * turn
        left, right = 1.0 + min(0.0, TURN * turn), 1.0 - max(0.0, TURN * turn)
        return ahead * left, ahead * right

    def step(self) -> Image:
        """Drives one step, and draws it."""
        if not self.over:
            action = np.array(self.action(), np.float32)
            _, _, terminated, truncated, info = self._env.step(action)
            self._steps += 1
            self.over = bool(terminated or truncated)
            seconds = f"{self._steps * self.dt:.1f} s"
            self.status = seconds
            if self.over:
                reached = "goal reached" if info["is_success"] else "contact"
                self.status = f"{reached if terminated else 'out of time'}, {seconds}"
        frame = self._env.render()
        assert isinstance(frame, np.ndarray)
        return frame
