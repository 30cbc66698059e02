"""TDAC-EPuck-v0: an e-puck among the obstacles of a Webots world."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_envs.arguments import (
    check_reset_options,
    finite_numbers,
    not_negative,
    one_of,
)
from tdac_envs.bodies import BODY_RADIUS
from tdac_envs.driven import DrivenEnv, Observation, Outcome
from tdac_envs.epuck import kernels
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.infrared import LARGEST, N_SENSORS, sense_ground
from tdac_envs.epuck.nearby import Surroundings, surroundings
from tdac_envs.epuck.source import WorldSource, open_world
from tdac_envs.epuck.task import (
    TOLERANCE,
    EPuckTask,
    default_horizon,
    jittered_start,
    make_task,
    random_task,
)
from tdac_envs.render import Status

if TYPE_CHECKING:
    from tdac_envs.epuck.picture import EPuckScene

VARIATIONS = ("nominal", "jitter", "random")


class EPuckEnv(DrivenEnv):
    """An e-puck drives through a Webots world to a goal and touches nothing.

    ## Description
    The world is a `.wbt` file, in metres: x and y in the ground plane, headings
    counter-clockwise from +x. The robot is a disc of 37 mm radius on two wheels of
    20 mm radius, 52 mm apart. Motion follows the exact arc of constant wheel speeds,
    and the disc swept along it is tested exactly against the shapes of all that it can
    hit: no step jumps through a thin wall, and a contact stops the robot there. Around
    the whole is a fence, which nobody sees (0.5 m away, where the world has no walls).

    ## Action Space
    `Box(-1, 1, (2,), float32)`: speed of the left and of the right wheel as a
    fraction of `max_wheel_speed`. Values out of range are clipped and counted in
    `info["clipped"]`.

    ## Observation Space
    `Dict` of float32 arrays:

    | key | shape | unit | content |
    |---|---|---|---|
    | `pose` | (3,) | m, m, rad | x, y, heading in (-pi, pi] |
    | `goal` | (2,) | m | x, y of the goal |
    | `wheel_speeds` | (2,) | fraction | left, right, as last applied |
    | `ps` | (8,) | | readings of ps0 to ps7, 67 (nothing near) to 4095 (contact) |
    | `wheel_positions` | (2,) | rad | by how much the wheels have turned |
    | `ground` | (3,) | | gs0 to gs2, with `ground_sensors=True` |
    | `gps` | (3,) | m | x, y, z, with `gps=True` |
    | `compass` | (3,) | | north (+y) as the robot sees it, with `compass=True` |

    The infra-red sensors `ps` are numbered clockwise from the front: ps0, ps1, ps2
    look ahead, 46 degrees and 90 degrees to the right, ps3 behind to the right, ps4
    behind to the left, ps5, ps6, ps7 left and ahead again. Each sees 70 mm far along
    one ray that rises from 33 to 44 mm above the ground, so low things are not seen.

    ## Rewards
    Progress along the shortest path for the body (in full-speed steps) x 0.1, goal
    +10, collision -10, each step -0.01; see `tdac_envs.rewards.RewardWeights`. Paths
    lie on a grid of 5 mm (wider above 25 m²) in eight directions, so a length is at
    most 8.3 % above the true one.

    ## Starting State
    `variation="nominal"`: the given start. `"jitter"`: within one body radius of it,
    heading +- 0.5 rad. `"random"`: any feasible start and goal.
    `reset(options={"start": (x, y, heading), "goal": (x, y)})` sets them.

    ## Episode End
    Terminated when the centre is within `goal_tolerance` of the goal with nothing
    solid in between (`info["is_success"]`), or on a collision. With
    `on_collision="block"` contacts are counted and the robot drives on: it is stopped
    at what is fixed, and pushes what the file gives a mass. Truncated after `horizon`
    steps.

    ## Arguments
    Args:
        world: Bundled name (`tdac_envs.bundled_worlds()`), path of a `.wbt` file, or
            a `tdac_envs.World`.
        start: (x, y) or (x, y, heading), m and rad. Default: the file's first e-puck.
        goal: (x, y), m. Default: the file's node named GOAL.
        goal_tolerance: m.
        dt: Duration of a step, s. Default: the file's `basicTimeStep`.
        horizon: Steps. Default: max(2500, 6 * d0 / (full speed * dt)).
        max_wheel_speed: rad/s. Default: 6.28, or 7.536 of an e-puck of version 2.
        on_collision: `"terminate"` or `"block"`.
        variation: `"nominal"`, `"jitter"` or `"random"`.
        sensor_noise: Factor on the published noise of the infra-red sensors.
        reflectance: `"ideal"`: everything is seen as in the sensor's table;
            `"webots"`: with the reflectance of the file's materials, so that for
            instance a WoodenBox is seen from 15 mm only.
        goal_visible: Whether the sensors see the file's goal marker.
        wheel_slip: Standard deviation of each wheel's speed, relative to it.
        motor_lag: Time constant of the wheel speeds, s.
        delay: Steps by which an action takes effect late.
        ignore: Names or types of nodes that may be solid and are not modelled.
        ground_sensors: Whether to observe `ground`.
        gps: Whether to observe `gps`.
        compass: Whether to observe `compass`.
        render_mode: `"rgb_array"`, `"human"` (extra `tdac[human]`) or None.

    ## Version History
    * v0: first version.
    """

    title = "TDAC-EPuck-v0"
    metadata: dict[str, Any] = {  # noqa: RUF012 - as declared by gym.Env
        "render_modes": ["rgb_array", "human"],
        "render_fps": 31,
    }
    readings = "ps"
    """Key of the distance sensors in an observation."""

    def __init__(
        self,
        world: WorldSource = "arena",
        start: Sequence[float] | None = None,
        goal: Sequence[float] | None = None,
        goal_tolerance: float = TOLERANCE,
        dt: float | None = None,
        horizon: int | None = None,
        max_wheel_speed: float | None = None,
        on_collision: str = "terminate",
        variation: str = "nominal",
        sensor_noise: float = 0.0,
        reflectance: str = "ideal",
        goal_visible: bool = False,
        wheel_slip: float = 0.0,
        motor_lag: float = 0.0,
        delay: int = 0,
        ignore: Sequence[str] = (),
        ground_sensors: bool = False,
        gps: bool = False,
        compass: bool = False,
        render_mode: str | None = None,
    ) -> None:
        one_of("variation", variation, VARIATIONS)
        one_of("reflectance", reflectance, ("ideal", "webots"))
        opened = open_world(world, start, goal, ignore)
        assert opened.goal is not None
        robot = opened.robot
        ground = Ground.of(opened)
        self.nominal = make_task(
            ground,
            robot.pose,
            opened.goal,
            max_wheel_speed=(
                robot.max_wheel_speed if max_wheel_speed is None else max_wheel_speed
            ),
            dt=opened.time_step / 1e3 if dt is None else dt,
            goal_tolerance=goal_tolerance,
            horizon=horizon,
        )
        self.task = self.nominal
        super().__init__(
            on_collision=on_collision,
            wheel_slip=wheel_slip,
            motor_lag=motor_lag,
            delay=delay,
            full_step=self.nominal.full_step,
            dt=self.nominal.dt,
            render_mode=render_mode,
        )
        self.variation = variation
        self.sensor_noise = not_negative("sensor_noise", sensor_noise)
        self.ground_sensors = bool(ground_sensors)
        self.gps, self.compass = bool(gps), bool(compass)
        space = observation_space(
            self.nominal, ground=self.ground_sensors, gps=self.gps, compass=self.compass
        )
        self.observation_space = space  # type: ignore[assignment]
        self._fixed_horizon = horizon is not None
        self._surroundings = surroundings(
            ground,
            reflectance == "webots",
            bool(goal_visible),
            BODY_RADIUS + self.nominal.full_step,
        )
        visible = self._surroundings.visible
        self._pushes = on_collision == "block" and len(ground.masses) > 0
        # Where things are now; the originals stay where they were at first.
        self._solid = ground.solid.copy() if self._pushes else ground.solid
        self._seen = visible.copy() if self._pushes else visible
        self._things = np.zeros((len(ground.masses), 6))
        self._speed = np.zeros(3)
        self._constants = _constants(self.nominal, self.motor_lag, self._surroundings)
        self._state = np.zeros(6)
        self._pose = np.zeros(3, np.float32)
        self._turned = np.zeros(2, np.float32)
        self._wheel_speeds = np.zeros(2, np.float32)
        self._readings = np.zeros(N_SENSORS, np.float32)
        self._hits = np.zeros((N_SENSORS, 3))
        self._outcome = np.zeros(7)
        self._drive: Callable[[], None]
        self._observe: Callable[[], None]
        self._is_bound = False
        self._scene: EPuckScene | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; see the class for `options`.

        Raises:
            TaskError: The options name something else than a start and a goal, or
                these are not feasible.
        """
        super().reset(seed=seed)
        self.task = task = self._draw_task(options or {})
        self._constants[kernels.GOAL_X : kernels.GOAL_Y + 1] = task.goal
        self._state[:] = *task.start, task.shortest, 0.0, 0.0
        self._goal = np.array(task.goal, np.float32)
        self._wheel_speeds[:] = 0.0
        self._speed[:] = 0.0
        if self._pushes:
            self._things[:] = 0.0
            self._things[:, :2] = task.ground.centres
            self._carry()
        self._begin(task.start[:2], task.shortest, task.horizon)
        self._scene = None
        self._bind()
        self._observe()
        _, _, _, gap, room, *_ = self._outcome.tolist()
        info = self._info(False, False, gap, room)
        if self.render_mode == "human":
            self.render()
        return self._observation(), info

    def pose(self) -> NDArray[np.float64]:
        """The true pose, shape (3,): x, y (m), heading (rad)."""
        return self._state[:3].copy()

    def things(self) -> NDArray[np.float64]:
        """Centre (m) and turn since the start (rad) of what can be pushed, (k, 3)."""
        if self._pushes:
            return self._things[:, :3].copy()
        centres = self.task.ground.centres
        return np.column_stack([centres, np.zeros(len(centres))])

    def __getstate__(self) -> dict[str, Any]:
        bound = {"_drive": None, "_observe": None, "_is_bound": False}
        return {**self.__dict__, **bound, "_scene": None}

    def _moved(self) -> Outcome:
        if not self._is_bound:
            self._bind()
        if self._pushes and self._pushed():
            self._observe()
        else:
            self._drive()
        touched, arrived, remaining, gap, room, *_ = self._outcome.tolist()
        return touched == 1.0, arrived == 1.0, remaining, gap, room

    def _bind(self) -> None:
        """Ties the kernels to this environment's own arrays."""
        solid, seen, near = self._solid, self._seen, self._surroundings
        shapes = (
            solid.points, solid.first, solid.extent, near.solid.cells,
            near.solid.listed,
            seen.points, seen.first, seen.extent, near.seen.cells, near.seen.listed,
            self.task.field, self._constants,
        )  # fmt: skip
        observed = (self._pose, self._turned, self._readings, self._hits, self._outcome)
        self._drive = kernels.drive.bind(
            *shapes, self._command, self._state, self._wheel_speeds, *observed
        )
        self._observe = kernels.observe.bind(*shapes, self._state, *observed)
        self._is_bound = True

    def _pushed(self) -> bool:
        """Takes the step with physics, if something that can be pushed is near."""
        from tdac_envs.epuck.pushing import Drive, is_near, push

        ground, reach = self.task.ground, 1.5 * self.task.full_step
        if not is_near(self._solid, self._state, self._things, reach):
            self._speed[:] = 0.0
            return False
        kernels.turn_wheels(
            self._constants, self._command, self._state, self._wheel_speeds,
            self._outcome,
        )  # fmt: skip
        forward, turn = self._outcome[-2:].tolist()
        wish = Drive(forward, turn, self.task.dt)
        self._outcome[kernels.TOUCHED] = push(
            self._solid, ground.solid, ground.centres, ground.masses,
            self._state, self._speed, self._things, wish,
        )  # fmt: skip
        self._carry()
        return True

    def _carry(self) -> None:
        """Puts what is solid and what is seen where the things are."""
        ground = self.task.ground
        self._solid.carry(ground.solid, ground.centres, self._things)
        visible = self._surroundings.visible
        self._seen.carry(visible, ground.centres, self._things)

    def _draw_task(self, options: dict[str, Any]) -> EPuckTask:
        check_reset_options(options)
        task = self.nominal
        if options:
            start = tuple(options.get("start", task.start))
            drawn = make_task(
                task.ground,
                finite_numbers("start", (*start, task.start.heading)[:3], 3),
                options.get("goal", task.goal),
                max_wheel_speed=task.max_wheel_speed,
                dt=task.dt,
                goal_tolerance=task.goal_tolerance,
                horizon=task.horizon,
            )
        elif self.variation == "random":
            drawn = random_task(task, self.np_random)
        elif self.variation == "jitter":
            return task.moved(jittered_start(task, self.np_random))
        else:
            return task
        if self._fixed_horizon or drawn.goal == task.goal:
            return drawn
        return replace(drawn, horizon=default_horizon(drawn))

    def _observation(self) -> Observation:
        observation = {
            "pose": self._pose.copy(),
            "goal": self._goal.copy(),
            "wheel_speeds": self._wheel_speeds.copy(),
            "ps": self._noisy(self._readings, self._hits[:, 2]),
            "wheel_positions": self._turned.copy(),
        }
        if self.ground_sensors:
            observation["ground"] = self._ground_readings()
        if self.gps:
            height = self.task.ground.floor
            observation["gps"] = np.append(self._pose[:2], np.float32(height))
        if self.compass:
            heading = self._state[2]
            north = (math.sin(heading), math.cos(heading), 0.0)
            observation["compass"] = np.array(north, np.float32)
        return observation

    def _noisy(
        self, readings: NDArray[np.float32], spreads: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        if not self.sensor_noise:
            return readings.copy()
        factor = self.np_random.normal(1.0, self.sensor_noise * spreads)
        return np.clip(readings * factor, 0.0, LARGEST).astype(np.float32)

    def _ground_readings(self) -> NDArray[np.float32]:
        seen, readings, spreads = self._seen, np.zeros(3, np.float32), np.zeros(3)
        floor = self.task.ground.floor
        sense_ground(
            seen.points, seen.first, seen.extent, floor, self._state, readings, spreads
        )
        return self._noisy(readings, spreads)

    def _frame(self) -> NDArray[np.uint8]:
        from tdac_envs.epuck.picture import EPuckScene

        task = self.task
        if self._scene is None:
            self._scene = EPuckScene(task, movable=self._pushes)
        gap = math.dist(self._trail[-1], task.goal)
        status = Status(self._steps, task.horizon, gap, self._status)
        return self._scene.frame(
            self._state[:3].tolist(),
            readings=self._readings,
            reaches=self._hits[:, 0],
            trail=self._trail,
            solid=self._solid,
            status=status,
        )


def observation_space(
    task: EPuckTask, *, ground: bool = False, gps: bool = False, compass: bool = False
) -> spaces.Dict:
    """The observation space of a task; see `EPuckEnv`."""
    # A body inside the fence; a little more for what physics lets in.
    left, low, right, high = task.ground.bounds
    least = np.array([left, low], np.float32) - np.float32(BODY_RADIUS)
    most = np.array([right, high], np.float32) + np.float32(BODY_RADIUS)
    pi, floor = np.float32(math.pi), np.float32(task.ground.floor)
    turned = np.float32(kernels.MOST_TURNED)
    space: dict[str, spaces.Space[Any]] = {
        "pose": spaces.Box(np.append(least, -pi), np.append(most, pi)),
        "goal": spaces.Box(least, most),
        "wheel_speeds": spaces.Box(-1.0, 1.0, (2,), np.float32),
        "ps": spaces.Box(0.0, LARGEST, (N_SENSORS,), np.float32),
        "wheel_positions": spaces.Box(-turned, turned, (2,), np.float32),
    }
    if ground:
        space["ground"] = spaces.Box(0.0, LARGEST, (3,), np.float32)
    if gps:
        space["gps"] = spaces.Box(
            np.append(least, floor - 1), np.append(most, floor + 1)
        )
    if compass:
        space["compass"] = spaces.Box(-1.0, 1.0, (3,), np.float32)
    return spaces.Dict(space)


def _constants(
    task: EPuckTask, motor_lag: float, near: Surroundings
) -> NDArray[np.float64]:
    """What `kernels.observe` takes as `constants`, in its order."""
    ground = task.ground
    return np.array(
        [
            task.max_wheel_speed,
            task.dt,
            BODY_RADIUS,
            *task.goal,
            task.goal_tolerance,
            math.exp(-task.dt / motor_lag) if motor_lag else 0.0,
            ground.floor,
            *ground.bounds[:2],
            ground.spacing,
            near.width,
        ]
    )
