"""TDAC-EPuck-v0: an e-puck robot among the obstacles of a Webots world."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Addresses
from tdac_envs.core.arguments import non_negative, one_of
from tdac_envs.drawing.runs import Status
from tdac_envs.drive.disturbances import Disturbances, with_odometry
from tdac_envs.drive.env import DrivenEnv, Observation
from tdac_envs.drive.rewards import weights_of
from tdac_envs.drive.stepping import info_of, place
from tdac_envs.epuck import kernels, observed
from tdac_envs.epuck.carried import Carried, movables_of
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.robot import EPuckArrays
from tdac_envs.epuck.robot_options import (
    RobotSource,
    e_puck_of,
    with_robot,
    with_version,
)
from tdac_envs.epuck.setup import EPuckSetup
from tdac_envs.epuck.smallest_gap import note_gap
from tdac_envs.epuck.solid_picture import SolidPicture
from tdac_envs.epuck.source import WorldSource, open_world
from tdac_envs.epuck.task import TOLERANCE, make_task
from tdac_envs.physics.engine_choice import PhysicsOption, engine_of
from tdac_envs.physics.moved import EXACT

if TYPE_CHECKING:
    from tdac_envs.epuck.picture import EPuckScene


class EPuckEnv(DrivenEnv, gym.Env[Observation, NDArray[np.float32]]):
    """An e-puck drives through a Webots world to a goal without touching anything.

    ## Description
    The world is a Webots `.wbt` file. Coordinates are metres: x and y lie in the ground
    plane, and headings are measured counter-clockwise from +x. The robot is a disc of
    37 mm radius with two wheels of 20 mm radius and an effective axle of 57 mm: Webots'
    wheels are cylinders of 5 mm width whose joints are 52 mm apart, and they stand on
    their outer rims. (An e-puck with `kinematic TRUE` has an axle of 52 mm, as Webots
    then moves it.) The robot moves along the exact arc of its wheel speeds, which are
    constant during a step. The disc swept along this arc is tested exactly against the
    shapes of all solid objects, so no step can jump through a thin wall. The world is
    surrounded by a fence, invisible to the sensors (0.5 m from the outermost objects if
    there are no walls).

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
    | `ps` | (8,) | | ps0 to ps7: 67 with nothing near, 2000 to 2700 at a contact |
    | `wheel_positions` | (2,) | rad | angles turned by the wheels since the reset |
    | `ground` | (3,) | | readings of gs0 to gs2, with `ground_sensors=True` |
    | `gps` | (3,) | m | x, y, z, with `gps=True` |
    | `compass` | (3,) | | north (+y) in the robot's frame, with `compass=True` |
    | `encoders` | (2,) | rad | angles in steps of 0.00628 rad, with `encoders=True` |
    | `odometry` | (2,) | m, rad | motion in the last step, with `odometry=True` |

    The infra-red sensors `ps` are numbered clockwise from the front: ps0, ps1 and ps2
    point ahead, 46 degrees and 90 degrees to the right, ps3 to the right rear, ps4 to
    the left rear, and ps5, ps6 and ps7 mirror ps2, ps1 and ps0 on the left. Each sensor
    sees along one ray of 70 mm that rises from 33 to 44 mm above the ground, so it does
    not see low objects.

    ## Rewards
    The reward of a step is the sum of these terms; `reward_weights` changes them:
    - `progress`: +0.1 times the decrease of the grid path length to the goal,
      divided by the distance of one step at full speed,
    - `goal`: +10 if the goal is reached,
    - `collision`: -10 if the body touches an obstacle,
    - `time`: -0.01.

    Paths follow a grid of 5 mm (wider above 25 m²) in eight directions, so they are at
    most 8.3 % longer than the true shortest path.

    ## Starting State
    The start depends on `variation`:
    - `"nominal"`: the given start pose,
    - `"jitter"`: within one body radius of the given start, heading +- 0.5 rad,
    - `"mixed"`: as `"jitter"`, or with probability 0.5 any feasible start,
    - `"random"`: any feasible start and goal.

    `reset(options={"start": (x, y, heading), "goal": (x, y)})` overrides `variation`.

    ## Info
    `reset` and `step` return these entries; distances are in m:

    | key | content |
    |---|---|
    | `is_success` | whether the goal is reached |
    | `collision` | whether the body touched an obstacle in this step |
    | `collisions` | number of such steps so far |
    | `clipped` | number of actions out of range so far |
    | `distance_to_goal` | straight distance from the robot's centre to the goal |
    | `path_distance` | length of the shortest grid path to the goal |
    | `clearance` | distance from the robot's centre to the nearest solid object |

    The fence counts as an object. `clearance` is negative if the centre is inside of
    an object. The gap between the body and the object is `clearance - 0.037`.

    ## Episode End
    The episode ends if one of the following happens:
    1. Termination: the robot's centre is within `goal_tolerance` of the goal, with
       nothing solid in between (`info["is_success"]`).
    2. Termination: the body touches an obstacle (`info["collision"]`). With
       `on_collision="block"` the episode goes on: the robot turns and slides along
       fixed obstacles (`docs/contacts.md`) and pushes those that have a mass, and
       `info["collisions"]` counts the steps in contact.
    3. Truncation: the episode has lasted `horizon` steps.

    After its end, call `reset`: a further step only warns, and its results are
    undefined.

    ## Arguments
    Args:
        world: Bundled name (`tdac_envs.bundled_worlds()`), path of a `.wbt` file, or
            a `tdac_envs.World`.
        start: (x, y) or (x, y, heading), m and rad. Default: the file's first e-puck.
        goal: (x, y), m. Default: the file's node named GOAL.
        goal_tolerance: Distance at which the goal is reached, m.
        dt: Duration of a step, s. Default: the file's `basicTimeStep`.
        horizon: Steps before truncation. Default: max(2500, 6 * d0 / (v * dt)), where
            d0 is the length of the shortest grid path, m, and v the full speed, m/s.
        max_wheel_speed: Wheel speed at action 1, rad/s. Default: 6.28, or 7.536 for an
            e-puck of version 2.
        on_collision: `"terminate"` or `"block"`; see Episode End.
        variation: `"nominal"`, `"jitter"`, `"mixed"` or `"random"`; see Starting State.
        sensor_noise: Infra-red noise relative to the published noise; 0 for none.
        reflectance: `"ideal"`: every object has the reflectance of the sensor's table;
            `"webots"`: objects have the reflectance of the file's materials; a
            WoodenBox, for example, is visible only within 15 mm.
        goal_visible: Whether the sensors see the file's goal marker.
        wheel_slip: Relative standard deviation of each wheel's speed over ground.
        wheel_gains: Bound b of the wheels' hidden gains, uniform in [1 - b, 1 + b] and
            drawn at each reset. `wheel_speeds` are commands: they do not show gains.
        axle_error: Bound of the hidden relative error of the axle length, uniform, too.
        wheel_radius_error: Bound of each wheel's hidden relative error of its radius,
            uniform; `wheel_positions` and `encoders` do not show it.
        odometry: Whether to observe the distance and turn of each step's arc, (0, 0)
            after a reset; `docs/disturbances.md` defines them.
        odometry_scale: Standard deviation of the hidden scale errors of `odometry`.
        odometry_noise: Relative standard deviation of each measurement of `odometry`.
        motor_lag: Time constant of the wheel speeds, s.
        delay: Number of steps until an action takes effect.
        reward_weights: Reward weights by name, where they differ from the defaults.
            Keep the defaults when comparing rewards.
        ignore: Names or types of unmodelled nodes to leave out. Any other unmodelled
            node that may be solid raises an error.
        ground_sensors, gps, compass, encoders: Whether to observe what the table says.
        robot: `"e-puck"`, `"e-puck2"` or the path of a robot file of an e-puck: its
            version, with the mass and the full speed, and its stopping distance. The
            time step stays that of the world.
        disturbed: Whether the errors of this robot are on, too, where no other argument
            says otherwise.
        stopping_distance: From full speed to standstill, m. It changes no motion, but
            the gap to obstacles that the robot should keep (`required_gap`).
        physics: `"exact"`, or `"mujoco"` (extra `tdac[physics]`): a 3D contact solver
            moves the robot and the objects that have a mass. A dict such as
            `{"engine": "mujoco", "torque": 0.001, "grip": 0.6}` also tells figures of
            the body (`docs/physics.md`). With `"mujoco-rays"`, MuJoCo measures the rays
            of `ps`, too.
        view: Of frames: `"2d"`, or `"3d"`, rendered by MuJoCo (extra `tdac[physics]`).
        render_mode: `"rgb_array"`, `"human"` (extra `tdac[human]`) or None.

    ## Version History
    * v0: Initial version. Changed before the first release: `on_collision="block"`;
      the axle is the effective one, 57 mm instead of 52 mm, so that the robot turns
      as in Webots; objects that are pushed have the ground friction of the world's
      `contactProperties`, 1 by default instead of 0.5, and the robot the mass of its
      version, 0.16 or 0.14 kg. Since then, dynamics are frozen as Ladder 1.0.
    """

    title = "TDAC-EPuck-v0"
    metadata: dict[str, Any] = {  # noqa: RUF012 - as declared by gym.Env
        "render_modes": ["rgb_array", "human"],
        "render_fps": 31,
    }
    readings = "ps"
    _note_gap = staticmethod(note_gap)
    _solid_picture = SolidPicture

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
        wheel_slip: float | None = None,
        wheel_gains: float = 0.0,
        axle_error: float = 0.0,
        wheel_radius_error: float | None = None,
        odometry: bool = False,
        odometry_scale: float = 0.0,
        odometry_noise: float = 0.0,
        motor_lag: float = 0.0,
        delay: int = 0,
        reward_weights: Mapping[str, float] | None = None,
        ignore: Sequence[str] = (),
        ground_sensors: bool = False,
        gps: bool = False,
        compass: bool = False,
        encoders: bool = False,
        robot: RobotSource = None,
        disturbed: bool = False,
        stopping_distance: float | None = None,
        physics: PhysicsOption = EXACT,
        view: str = "2d",
        render_mode: str | None = None,
    ) -> None:
        one_of("reflectance", reflectance, ("ideal", "webots"))
        opened, own = open_world(world, start, goal, ignore), None
        if robot is not None:
            own = e_puck_of(robot)
            opened = with_version(opened, own)
        given = {
            "wheel_slip": wheel_slip,
            "wheel_radius_error": wheel_radius_error,
            "stopping_distance": stopping_distance,
        }
        sizes = with_robot(own, given, disturbed=disturbed)
        assert opened.goal is not None
        body, ground = opened.robot, Ground.of(opened)
        speed = body.max_wheel_speed if max_wheel_speed is None else max_wheel_speed
        nominal = make_task(
            ground,
            body.pose,
            opened.goal,
            max_wheel_speed=speed,
            dt=opened.time_step / 1e3 if dt is None else dt,
            goal_tolerance=goal_tolerance,
            horizon=horizon,
        )
        setup = EPuckSetup(
            nominal=nominal,
            variation=variation,
            fixed_horizon=horizon is not None,
            on_collision=on_collision,
            motor_lag=motor_lag,
            delay=delay,
            disturbances=Disturbances(
                sizes["wheel_slip"],
                wheel_gains,
                axle_error,
                odometry,
                odometry_scale,
                odometry_noise,
                sizes["wheel_radius_error"],
            ),
            weights=weights_of(reward_weights),
            source=None,
            webots=reflectance == "webots",
            goal_visible=bool(goal_visible),
            stopping_distance=sizes["stopping_distance"],
            physics=engine_of(physics, robot),
            view=view,
        )
        asked = (ground_sensors, gps, compass, encoders)
        further = tuple(itertools.compress(observed.INSTRUMENTS, asked))
        self._prepare(setup, sensor_noise, further, render_mode)

    @classmethod
    def of(
        cls,
        setup: EPuckSetup,
        sensor_noise: float = 0.0,
        further: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> EPuckEnv:
        """The environment of a setup.

        Args:
            setup: The setup; its source, if any, may draw tasks in other worlds, unless
                objects can be pushed.
            sensor_noise: See the class.
            further: Those of `observed.INSTRUMENTS` that are observed, in their order.
            render_mode: See the class.
        """
        env = cls.__new__(cls)
        env._prepare(setup, sensor_noise, tuple(further), render_mode)
        return env

    def _prepare(
        self,
        setup: EPuckSetup,
        sensor_noise: float,
        further: tuple[str, ...],
        render_mode: str | None,
    ) -> None:
        super().__init__(setup, render_mode)
        self.sensor_noise = non_negative("sensor_noise", sensor_noise)
        self.further = further
        space = observed.observation_space(self.nominal, self.further)
        if self.disturbances.odometry:
            space = with_odometry(space, self._limits)
        self._has_more = bool(self.further or self.disturbances.odometry)
        self.observation_space = space  # type: ignore[assignment]
        self._movables = movables_of(setup, setup.nominal)
        self.robot = EPuckArrays.blank(self.delay)
        self.robot.constants[:] = setup.constants()
        self._goal = np.array(self.nominal.goal, np.float32)
        self._bind()
        self._scene: EPuckScene | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; the class documents `options`.

        Raises:
            TaskError: An option is unknown, or the start or goal is not feasible.
        """
        super().reset(seed=seed)
        before = self.task
        task = self._draw(options or {})
        if task.ground is not before.ground:
            self._movables = movables_of(self.setup, task)
            self.setup.enter(self.robot.constants, task)
        if task.field is not before.field:
            self._bind()
        self._movables.reset(task.start)
        place(self.robot, task)
        self._hide()
        self._goal[:] = task.goal
        self._call_begin()
        self._begin_trail()
        info = info_of(self.robot.outcome.tolist())
        if self.render_mode == "human":
            self.render()
        return self._observation(), info

    def things(self) -> NDArray[np.float64]:
        """Centre (m) and rotation since the reset (rad) of movable objects, (k, 3)."""
        return self._movables.things[:, :3].copy()

    def __getstate__(self) -> dict[str, Any]:
        own = "addresses", "_call_begin", "_call_drive", "_scene", "_solid"
        return {**self.__dict__, **dict.fromkeys(own)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    def _bind(self) -> None:
        """Binds the kernels to this environment's own arrays."""
        things = self._movables
        world = self.setup.world(self.task, things.solid, things.seen)
        self.addresses = Addresses([(*world, *self.robot)])
        (words,) = self.addresses.words
        self._call_begin: Callable[[], None] = partial(kernels.begin, words)
        stops = self.on_collision == "terminate"
        drive = kernels.drive if stops else kernels.drive_or_slide
        self._call_drive = partial(drive, words)
        if things.moves:
            self._call_drive = partial(things.step, words, self.robot, self._call_drive)
        if isinstance(things, Carried) and self.setup.physics.measures:
            self._call_begin = partial(self._then_measure, things, self._call_begin)
            self._call_drive = partial(self._then_measure, things, self._call_drive)

    def _then_measure(self, things: Carried, call: Callable[[], None]) -> None:
        """Calls a kernel, and replaces its readings by those of MuJoCo."""
        call()
        things.measure(self.robot)

    def _observation(self) -> Observation:
        robot = self.robot
        observation = {
            "pose": robot.pose.copy(),
            "goal": self._goal.copy(),
            "wheel_speeds": robot.wheel_speeds.copy(),
            "ps": self._noisy(robot.readings.copy(), robot.hits[:, 2]),
            "wheel_positions": robot.turned.copy(),
        }
        if self._has_more:
            self._add_more(observation)
        return observation

    def _add_more(self, observation: Observation) -> None:
        """Adds what is observed only if an argument asks for it."""
        robot, floor = self.robot, self.task.ground.floor
        if "ground" in self.further:
            found = observed.ground_readings(self._movables.seen, floor, robot)
            observation["ground"] = self._noisy(*found)
        observed.add_instruments(observation, self.further, robot, floor)
        if self.disturbances.odometry:
            observation["odometry"] = self._odometry()

    def _noisy(
        self, readings: NDArray[np.float32], spreads: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        if not self.sensor_noise:
            return readings
        normal = self._random.standard_normal(readings.size)
        return observed.noisy(readings, self.sensor_noise * spreads, normal)

    def _frame(self) -> NDArray[np.uint8]:
        from tdac_envs.epuck.picture import EPuckScene

        task, robot = self.task, self.robot
        if self._scene is None:
            self._scene = EPuckScene(task, movable=self._movables.moves)
        gap = math.dist(self._trail[-1], task.goal)
        status = Status(self._steps, task.horizon, gap, self._status)
        return self._scene.frame(
            robot.state[:3].tolist(),
            readings=robot.readings,
            reaches=robot.hits[:, 0],
            trail=self._trail,
            solid=self._movables.solid if self._movables.moves else task.ground.solid,
            status=status,
        )
