"""TDAC-Map2D-v0: a differential-drive robot with range rays on an occupancy grid."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_envs.errors import TaskError
from tdac_envs.kernels import advance, cast_rays, path_distance, sees
from tdac_envs.params import RobotParams
from tdac_envs.render import Scene, Status
from tdac_envs.rewards import RewardWeights, step_reward
from tdac_envs.source2d import MapSource, prepare
from tdac_envs.task2d import (
    Map2DTask,
    Pose,
    Terrain,
    jittered_start,
    make_task,
    random_task,
)

if TYPE_CHECKING:
    from tdac_envs.window import Window

Observation = dict[str, NDArray[np.float32]]
VARIATIONS = ("nominal", "jitter", "random")


class Map2DEnv(gym.Env[Observation, NDArray[np.float32]]):
    """A disc-shaped robot drives over a map image to a goal and touches nothing.

    ## Description
    The world is an occupancy grid made from a map image. The pixel frame has x to
    the right and y down; headings go from +x towards +y, so a positive turn is
    clockwise on the screen. Pixel (i, j) is the square [i-1/2, i+1/2) x
    [j-1/2, j+1/2), and everything outside the map is occupied. Motion follows the
    exact arc of constant wheel speeds, and the disc swept along it is tested exactly
    against the occupied squares: no step jumps through a thin wall.

    ## Action Space
    `Box(-1, 1, (2,), float32)`: speed of the left and of the right wheel as a
    fraction of `max_wheel_speed`. Values out of range are clipped and counted in
    `info["clipped"]`.

    ## Observation Space
    `Dict` of float32 arrays:

    | key | shape | unit | content |
    |---|---|---|---|
    | `pose` | (3,) | px, px, rad | x, y, heading in (-pi, pi] |
    | `goal` | (2,) | px | x, y of the goal |
    | `wheel_speeds` | (2,) | fraction | left, right, as last applied |
    | `ranges` | (n_rays,) | px | distance to the first wall along each ray |

    Ray i points at `-field_of_view/2 + i * field_of_view/(n_rays - 1)` from the
    heading: `ranges[0]` is the robot's leftmost ray, `ranges[-1]` its rightmost.
    Rays start at the centre; no hit gives `range_max`.

    ## Rewards
    Progress along the shortest path for the body (in full-speed steps) x 0.1, goal
    +10, collision -10, each step -0.01; see `tdac_envs.rewards.RewardWeights`.

    ## Starting State
    `variation="nominal"`: the given start. `"jitter"`: within one body radius of it,
    heading +- 0.5 rad. `"random"`: any feasible start and goal.
    `reset(options={"start": (x, y, heading), "goal": (x, y)})` sets them.

    ## Episode End
    Terminated when the centre is within `goal_tolerance` of the goal with no wall in
    between (`info["is_success"]`), or on a collision (with `on_collision="block"` the
    robot is stopped there and the contact counted). Truncated after `horizon` steps.

    ## Arguments
    Args:
        map: Bundled name (`tdac_envs.bundled_maps()`); path of an image, ROS
            `map.yaml`, MovingAI `.map` or `.npy` grid; folder with `occupancy.npy`
            and `params.json`; or a bool array `[y, x]`, True = occupied.
        start: (x, y) or (x, y, heading), px and rad. Default: the map's own.
        goal: (x, y), px. Default: the map's own.
        heading: Nominal start heading, rad.
        robot_radius: Radius of the body, px.
        axle_length: Distance of the wheels, px. Default: twice the radius.
        max_wheel_speed: px/s; 75.59 is the paper's 0.02 m/s at 3779.52 px/m.
        n_rays: Number of range rays.
        field_of_view: Whole angle of the fan, degrees.
        range_max: Range without a hit, px.
        dt: Duration of a step, s.
        horizon: Steps. Default: max(2500, 6 * d0 / (max_wheel_speed * dt)).
        goal_tolerance: px. Default: min(20, d0 / 4).
        on_collision: `"terminate"` or `"block"`.
        variation: `"nominal"`, `"jitter"` or `"random"`.
        range_noise: Standard deviation of each range, relative to it.
        wheel_slip: Standard deviation of each wheel's speed, relative to it.
        motor_lag: Time constant of the wheel speeds, s.
        delay: Steps by which an action takes effect late.
        snap: Move start and goal to the nearest place that holds the body.
        render_mode: `"rgb_array"`, `"human"` (extra `tdac[human]`) or None.

    ## Version History
    * v0: first version.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": ["rgb_array", "human"],
        "render_fps": 20,
    }

    def __init__(
        self,
        map: MapSource = "maze",  # noqa: A002 - the field's word
        start: tuple[float, ...] | None = None,
        goal: tuple[float, float] | None = None,
        heading: float | None = None,
        robot_radius: float | None = None,
        axle_length: float | None = None,
        max_wheel_speed: float | None = None,
        n_rays: int | None = None,
        field_of_view: float | None = None,
        range_max: float | None = None,
        dt: float = 0.05,
        horizon: int | None = None,
        goal_tolerance: float | None = None,
        on_collision: str = "terminate",
        variation: str = "nominal",
        range_noise: float = 0.0,
        wheel_slip: float = 0.0,
        motor_lag: float = 0.0,
        delay: int = 0,
        snap: bool = False,
        render_mode: str | None = None,
    ) -> None:
        _choose("on_collision", on_collision, ("terminate", "block"))
        _choose("variation", variation, VARIATIONS)
        _choose("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        _not_negative(
            range_noise=range_noise,
            wheel_slip=wheel_slip,
            motor_lag=motor_lag,
            delay=delay,
        )
        prepared = prepare(
            map, start, goal, heading=heading, robot_radius=robot_radius, snap=snap
        )
        params = prepared.params
        robot = _override(
            params.robot,
            axle_length=axle_length,
            max_wheel_speed=max_wheel_speed,
            n_rays=n_rays,
            field_of_view_deg=field_of_view,
            range_max=range_max,
        )
        assert params.start is not None
        assert params.goal is not None
        self.nominal = make_task(
            Terrain.of(prepared.grid),
            Pose(*params.start, params.heading),
            params.goal,
            robot,
            dt=dt,
            goal_tolerance=goal_tolerance,
            horizon=horizon,
        )
        self.params = params
        self.task = self.nominal
        self.on_collision = on_collision
        self.variation = variation
        self.range_noise = range_noise
        self.wheel_slip = wheel_slip
        self.motor_lag = motor_lag
        self.delay = delay
        self.weights = RewardWeights()
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": round(1.0 / dt)}
        self.observation_space = observation_space(self.nominal)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._state = np.zeros(3)
        self._ranges = np.zeros(robot.n_rays, np.float32)
        self._scene: Scene | None = None
        self._window: Window | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; see the class for `options`."""
        super().reset(seed=seed)
        self.task = self._draw_task(options or {})
        self._state[:] = self.task.start
        self._state[2] = math.remainder(self._state[2], 2.0 * math.pi)
        self._speeds = np.zeros(2, np.float32)
        self._queue = [np.zeros(2, np.float32)] * self.delay
        self._steps = self._collisions = self._clipped = 0
        self._remaining = self.task.shortest
        self._trail = [(float(self._state[0]), float(self._state[1]))]
        self._status = ""
        self._scene = None
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info(reached=False, collided=False)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Applies wheel speeds for one `dt`.

        Raises:
            ValueError: The action is not two finite numbers.
        """
        left, right = self._wheels(action)
        task, robot = self.task, self.task.robot
        terrain = task.terrain
        collided = advance(
            terrain.padded,
            terrain.padded_clear,
            self._state,
            left * robot.max_wheel_speed,
            right * robot.max_wheel_speed,
            robot.axle_length,
            task.dt,
            robot.radius,
        )
        self._steps += 1
        self._collisions += collided
        x, y = float(self._state[0]), float(self._state[1])
        remaining = float(path_distance(task.field, x, y, self._remaining))
        full_step = robot.max_wheel_speed * task.dt
        progress = (self._remaining - remaining) / full_step
        self._remaining = remaining
        gap = math.hypot(task.goal[0] - x, task.goal[1] - y)
        reached = gap <= task.goal_tolerance and sees(
            terrain.padded, terrain.padded_clear, x, y, task.goal[0], task.goal[1]
        )
        terminated = bool(reached or (collided and self.on_collision == "terminate"))
        truncated = not terminated and self._steps >= task.horizon
        if self.render_mode is not None:
            self._note(x, y, reached, collided, truncated)
        reward = step_reward(self.weights, progress, reached, collided)
        info = self._info(reached=bool(reached), collided=bool(collided))
        return self._observation(), reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """The current frame, uint8 (height, width, 3), or None in a window."""
        if self.render_mode is None:
            gym.logger.warn("render() needs gym.make(..., render_mode='rgb_array')")
            return None
        frame = self._frame()
        if self.render_mode == "rgb_array":
            return frame
        if self._window is None:
            from tdac_envs.window import Window

            self._window = Window("TDAC-Map2D-v0", self.metadata["render_fps"])
        self._window.show(frame)
        return None

    def pose(self) -> NDArray[np.float64]:
        """The true pose, shape (3,): x, y (px), heading (rad)."""
        return self._state.copy()

    def close(self) -> None:
        """Closes the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _draw_task(self, options: dict[str, Any]) -> Map2DTask:
        unknown = set(options) - {"start", "goal"}
        if unknown:
            raise ValueError(f"unknown reset options {sorted(unknown)}")
        task = self.nominal
        if options:
            start = Pose(*options.get("start", task.start))
            goal = tuple(options.get("goal", task.goal))
            return make_task(
                task.terrain,
                start,
                (float(goal[0]), float(goal[1])),
                task.robot,
                dt=task.dt,
                goal_tolerance=task.goal_tolerance,
                horizon=task.horizon,
            )
        if self.variation == "jitter":
            return task.moved(jittered_start(task, self.np_random))
        if self.variation == "random":
            return random_task(task, self.np_random)
        return task

    def _wheels(self, action: Any) -> tuple[float, float]:
        """Clips, delays, lags and slips an action; returns what the wheels do."""
        wanted = np.asarray(action, np.float32)
        if wanted.shape != (2,) or not np.isfinite(wanted).all():
            raise ValueError(
                f"expected an action of two finite numbers in [-1, 1], got {action!r}"
            )
        applied = np.clip(wanted, -1.0, 1.0)
        self._clipped += int((applied != wanted).any())
        if self.delay:
            self._queue.append(applied)
            applied = self._queue.pop(0)
        if self.motor_lag > 0.0:
            keep = math.exp(-self.task.dt / self.motor_lag)
            applied = applied + np.float32(keep) * (self._speeds - applied)
        self._speeds = applied
        if self.wheel_slip > 0.0:
            factor = 1.0 + self.wheel_slip * self.np_random.standard_normal(2)
            applied = np.clip(applied * factor, -1.0, 1.0)
        return float(applied[0]), float(applied[1])

    def _observation(self) -> Observation:
        robot, terrain = self.task.robot, self.task.terrain
        x, y, heading = self._state
        fan = math.radians(robot.field_of_view_deg)
        cast_rays(
            terrain.padded,
            terrain.padded_clear,
            x,
            y,
            heading,
            fan,
            robot.range_max,
            self._ranges,
        )
        ranges = self._ranges.copy()
        if self.range_noise > 0.0:
            noise = self.range_noise * self.np_random.standard_normal(ranges.size)
            ranges = np.clip(ranges * (1.0 + noise), 0, robot.range_max)
        return {
            "pose": self._state.astype(np.float32),
            "goal": np.array(self.task.goal, np.float32),
            "wheel_speeds": self._speeds.copy(),
            "ranges": ranges.astype(np.float32, copy=False),
        }

    def _info(self, *, reached: bool, collided: bool) -> dict[str, Any]:
        x, y = float(self._state[0]), float(self._state[1])
        goal = self.task.goal
        clear = self.task.terrain.clear
        return {
            "is_success": reached,
            "collision": collided,
            "collisions": self._collisions,
            "clipped": self._clipped,
            "distance_to_goal": math.hypot(goal[0] - x, goal[1] - y),
            "path_distance": self._remaining,
            "clearance": float(clear[math.floor(y + 0.5), math.floor(x + 0.5)]),
        }

    def _note(
        self, x: float, y: float, reached: bool, collided: bool, truncated: bool
    ) -> None:
        self._trail.append((x, y))
        if reached:
            self._status = "reached"
        elif collided:
            self._status = "collision"
        elif truncated:
            self._status = "out of time"
        if self.render_mode == "human":
            self.render()

    def _frame(self) -> NDArray[np.uint8]:
        task = self.task
        if self._scene is None:
            self._scene = Scene(
                task.terrain.grid.cells,
                task.start,
                task.goal,
                goal_tolerance=task.goal_tolerance,
                robot=task.robot,
                path=task.path_from(task.start),
            )
        gap = math.dist(self._trail[-1], task.goal)
        status = Status(self._steps, task.horizon, gap, self._status)
        return self._scene.frame(self._state, self._ranges, self._trail, status)


def observation_space(task: Map2DTask) -> spaces.Dict:
    """The observation space of a task; see `Map2DEnv`."""
    grid, robot = task.terrain.grid, task.robot
    corner = np.array([grid.width - 0.5, grid.height - 0.5], np.float32)
    least = np.full(2, -0.5, np.float32)
    pi = np.float32(math.pi)
    return spaces.Dict(
        {
            "pose": spaces.Box(np.append(least, -pi), np.append(corner, pi)),
            "goal": spaces.Box(least, corner),
            "wheel_speeds": spaces.Box(-1.0, 1.0, (2,), np.float32),
            "ranges": spaces.Box(0.0, robot.range_max, (robot.n_rays,), np.float32),
        }
    )


def _override(robot: RobotParams, **given: float | None) -> RobotParams:
    changes = {name: value for name, value in given.items() if value is not None}
    return RobotParams(**{**robot.model_dump(), **changes})


def _choose(name: str, value: object, allowed: tuple[object, ...]) -> None:
    if value not in allowed:
        choices = ", ".join(map(repr, allowed))
        raise TaskError(f"expected {name} to be one of {choices}, got {value!r}")


def _not_negative(**given: float) -> None:
    for name, value in given.items():
        if not value >= 0:
            raise TaskError(f"expected {name} of at least 0, got {value!r}")
