"""TDAC-Map2D-v0: a differential-drive robot with range rays on an occupancy grid."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Addresses
from tdac_envs.drawing.marks import GHOST_SECONDS
from tdac_envs.drawing.runs import Status
from tdac_envs.drive.disturbances import Disturbances, with_odometry
from tdac_envs.drive.env import DrivenEnv, Observation
from tdac_envs.drive.rewards import weights_of
from tdac_envs.drive.stepping import STEPS, place
from tdac_envs.drive.task import Pose, with_tolerance_note
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.map2d.among import begin_among, drive_among
from tdac_envs.map2d.carried import carried_by
from tdac_envs.map2d.kernels import begin, drive, drive_or_slide
from tdac_envs.map2d.metric_input import in_pixels, options_in_pixels
from tdac_envs.map2d.metric_view import MetricView
from tdac_envs.map2d.observed import info_of, noisy, observation_space
from tdac_envs.map2d.picture import MapScene
from tdac_envs.map2d.reception import RECEIVED, Receiver, Reception
from tdac_envs.map2d.robot import Map2DArrays
from tdac_envs.map2d.robot_options import RobotSource, with_robot
from tdac_envs.map2d.setup import OVERRIDDEN, Map2DSetup, override
from tdac_envs.map2d.smallest_gap import note_gap, note_gap_among
from tdac_envs.map2d.solid_picture import SolidPicture
from tdac_envs.map2d.sonar import noise_of
from tdac_envs.map2d.source import MapSource, metric_units, prepare, units_of
from tdac_envs.map2d.task import Terrain, make_task
from tdac_envs.mapping.params import FrameName, ReadingOptions, Shade
from tdac_envs.movers.spec import MoversOption, read_specs
from tdac_envs.movers.state import Movers
from tdac_envs.physics.engine_choice import PhysicsOption, engine_of
from tdac_envs.physics.moved import EXACT

MOST_GHOSTS = 200
"""Frames show where the movers were in the last second, in at most 200 steps."""


class Map2DEnv(DrivenEnv, gym.Env[Observation, NDArray[np.float32]]):
    """A disc-shaped robot drives across a map to a goal without touching anything.

    ## Description
    The world is an occupancy grid made from a map image. Coordinates are pixels: x
    points right, y points down, and headings are measured from +x towards +y, so a
    positive turn is clockwise on the screen. Pixel (i, j) is the square
    [i-1/2, i+1/2) x [j-1/2, j+1/2), and everything outside the map is occupied. The
    robot moves along the exact arc of its wheel speeds, which are constant during a
    step. The disc swept along this arc is tested exactly against the occupied squares,
    so no step can jump through a thin wall.

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
    | `odometry` | (2,) | px, rad | motion in the last step, with `odometry=True` |

    Ray i points at `-field_of_view/2 + i * field_of_view/(n_rays - 1)` from the
    heading: `ranges[0]` is the robot's leftmost ray, `ranges[-1]` its rightmost.
    Rays start at the centre; no hit gives `range_max`.

    ## Other Scanners
    Ray i points at `ray_angles[i]` from the heading (rad; also in `params.json`): of a
    full circle, which begins behind the robot, at `-180° + i * 360°/n_rays`; of the
    scanner of a robot's file, as the file says. Rays start at the centre, or at the
    file's `scanner.offset`; no hit gives `range_max`.

    ## In metres
    With `frame="metres"`, for maps with a resolution (ROS `map.yaml`), all places,
    lengths and speeds of arguments, options, observations, `info` and pictures are in
    metres, in the frame of the map: the outer corner of the lower-left pixel is at the
    `origin` of the map, and without a rotation of this origin, x points right and y
    points up. Headings, `ray_angles` and turns, also that of `odometry`, are
    counter-clockwise. The simulation is the same to the bit, and the rays keep their
    order. `pose()` and `discs()` stay in px.

    Maps with a resolution have defaults in metres, also with `frame="pixels"`: 0.5 m/s,
    ranges up to 3.5 m, and a goal tolerance of a body radius. Their `robot_radius` has
    no default.

    ## Movers
    With `movers`, discs move about: they follow routes, bounce off walls, or walk in a
    crowd, exactly within a step, and never enter a wall. They block rays and touch the
    robot, but never in the first 2 s if it stands at its start. The people of a crowd
    avoid each other and all other movers; those who see the robot make way for it. The
    other movers react to nothing. The observation shows movers in `ranges` alone, whose
    rays end at the first wall or mover.

    ## Rewards
    The reward of a step is the sum of these terms; `reward_weights` changes them:
    - `progress`: +0.1 times the decrease of the grid path length to the goal,
      divided by the distance of one step at full speed,
    - `goal`: +10 if the goal is reached,
    - `collision`: -10 if the body touches an obstacle or a mover,
    - `time`: -0.01.

    ## Starting State
    The start depends on `variation`:
    - `"nominal"`: the given start pose,
    - `"jitter"`: within one body radius of the given start, heading +- 0.5 rad,
    - `"mixed"`: as `"jitter"`, or with probability 0.5 any feasible start,
    - `"random"`: any feasible start and goal.

    `reset(options={"start": (x, y, heading), "goal": (x, y)})` overrides `variation`.

    Where movers start is drawn at each reset, unless it is given. A drawn start at
    which a mover would touch the robot within 2 s is drawn again.

    ## Info
    `reset` and `step` return these entries; distances are in px:

    | key | content |
    |---|---|
    | `is_success` | whether the goal is reached |
    | `collision` | whether the body touched an obstacle or a mover in this step |
    | `contact` | what it touched: `"wall"`, `"mover"`, `"mover_standing"`, or None |
    | `collisions` | number of such steps so far |
    | `clipped` | number of actions out of range so far |
    | `distance_to_goal` | straight distance from the robot's centre to the goal |
    | `path_distance` | length of the shortest grid path to the goal |
    | `clearance` | distance from the robot's centre to the nearest obstacle |

    The border of the map counts as an obstacle. `clearance` is never negative; it is
    measured from the centre of the pixel in which the robot's centre lies, so it is
    exact to 0.71 px. The gap between the body and the obstacle is
    `clearance - robot_radius`. Movers do not count for `path_distance` and `clearance`.

    `collision` is a bool, as libraries expect; `contact` is its cause. It is
    `"mover_standing"` if a mover touched a robot that stood: one that had moved by less
    than 2 % of what it can in the last 0.5 s. Of a wall and a mover, the first counts.

    ## Episode End
    The episode ends if one of the following happens:
    1. Termination: the robot's centre is within `goal_tolerance` of the goal, with no
       wall in between (`info["is_success"]`).
    2. Termination: the body touches an obstacle or a mover (`info["collision"]`). With
       `on_collision="block"` the episode goes on: the wheels slip, so that the robot
       turns and slides along the obstacle (`docs/contacts.md`), and
       `info["collisions"]` counts the steps in contact. Robot and mover stop at
       their contact until the end of the step; the robot may turn. A mover that would
       press against the robot waits.
    3. Truncation: the episode has lasted `horizon` steps.

    After its end, call `reset`: a further step only warns, and its results are
    undefined.

    ## Arguments
    Args:
        map: Bundled name (`tdac_envs.bundled_maps()`); path of an image, ROS
            `map.yaml`, MovingAI `.map` or `.npy` grid; folder with `occupancy.npy`
            and `params.json`; or a bool array `[y, x]`, True = occupied.
        start: (x, y) or (x, y, heading), px and rad. Default: the map's own.
        goal: (x, y), px. Default: the map's own.
        heading: Nominal start heading, rad; overrides that of `start`.
        robot_radius: Radius of the body, px. Default: the map's own, else 15; a map
            with a resolution needs one.
        axle_length: Distance between the wheels, px. Default: twice the radius.
        max_wheel_speed: Wheel speed at action 1, px/s. The default of images, 75.59,
            is the paper's 0.02 m/s at 3779.52 px/m; with a resolution it is 0.5 m/s.
        n_rays: Number of range rays.
        field_of_view: Angle between the first and the last ray, degrees; 360 for a
            full circle of rays that are 360°/n_rays apart.
        range_max: Largest range, px; observed if a ray hits nothing. The default of
            images is 220; with a resolution it is 3.5 m.
        dt: Duration of a step, s. Default: 0.05, or that of the robot.
        horizon: Steps before truncation. Default: max(2500, 6 * d0 / (max_wheel_speed *
            dt)), where d0 is the length of the shortest grid path, px.
        goal_tolerance: Distance at which the goal is reached, px. Default:
            min(20, d0 / 4), on a map with a resolution min(robot_radius, d0 / 4).
        on_collision: `"terminate"` or `"block"`; see Episode End.
        variation: `"nominal"`, `"jitter"`, `"mixed"` or `"random"`; see Starting State.
        sensor: `"rays"`, which are exact, or `"sonar"`: a range is the nearest echo in
            a beam of 30 degrees around its ray, and a surface that a ray meets at more
            than 22.5 degrees from the normal gives none (`docs/disturbances.md`).
        range_noise: Relative standard deviation of each range. Default: 0, or 0.05 with
            sonar.
        range_dropout: Probability that a ray reads `range_max` in a step.
        wheel_slip: Relative standard deviation of each wheel's speed.
        wheel_gains: Bound b of the wheels' hidden gains, uniform in [1 - b, 1 + b] and
            drawn at each reset. `wheel_speeds` are commands: they do not show gains.
        axle_error: Bound of the hidden relative error of the axle length, uniform, too.
        odometry: Whether to observe the distance and turn of each step's arc, (0, 0)
            after a reset; `docs/disturbances.md` defines them.
        odometry_scale: Standard deviation of the hidden scale errors of `odometry`.
        odometry_noise: Relative standard deviation of each measurement of `odometry`.
        wheel_radius_error: Bound of each wheel's hidden relative error of its radius,
            uniform, drawn at each reset.
        motor_lag: Time constant of the wheel speeds, s.
        delay: Number of steps until an action takes effect.
        max_acceleration: Largest acceleration of a wheel, px/s².
        max_speed: Largest speed of the body, px/s. A faster command is scaled down,
            both wheels by the same factor, so that the robot drives the same curve.
        max_turn_rate: Largest turn of the body, rad/s; commands are scaled likewise.
        max_turn_acceleration: Largest acceleration of its turn, rad/s².
        stopping_distance: From full speed to standstill, px. It changes no motion, but
            the gap to obstacles that the robot should keep (`required_gap`).
        pose_noise: Standard deviation of the error of the observed x and y, px.
            `info`, reward and the end of an episode always use the true pose.
        heading_noise: Standard deviation of the error of the observed heading, rad.
        pose_correlation: Time constant of both errors, s; 0 for new ones in each step.
        pose_jumps: Mean number of jumps of the observed pose in a minute: the errors
            are drawn anew, three times as large.
        pose_delay: Number of steps by which `pose` is late.
        scan_delay: Number of steps by which `ranges` are late.
        message_drop: Probability that the pose and the scan of a step are lost: the
            last ones are observed again.
        range_min, below_min: Smallest range, px, and what a ray reads below it:
            `"range_max"` (the default), `"range_min"` or `"zero"`.
        scanner_offset: Where the rays start, from the centre: ahead and, in pixels, to
            the right; in metres, to the left.
        robot: Bundled name (`tdac_envs.bundled_robots()`) or path of a robot file: its
            body, limits, scanner and control rate, where no other argument says
            otherwise. `ranges` are in the order of its scanner. A robot in metres needs
            a map with a resolution.
        disturbed: Whether the noise, latency and other errors of this robot are on,
            too, where no other argument says otherwise. Its limits always hold.
        reward_weights: Reward weights by name, where they differ from the defaults.
            Keep the defaults when comparing rewards.
        snap: Whether to move start and goal to the nearest place where the body fits.
        polarity: Which pixels of a map image are obstacles: `"dark"`, `"light"`, or
            None to decide from the image.
        movers: A list with a dict for each mover or group of movers, such as
            `{"kind": "route", "points": [[40, 40], [90, 40]], "speed": 30, "radius": 8,
            "loop": False}`, `{"kind": "bounce", "count": 3, "speed": 30}` or
            `{"kind": "crowd", "count": 20}`; `"bounce:5"` stands for five movers with
            the defaults, half as fast as the robot and as large.
            `tdac_envs.movers.spec` has all keys.
        frame: `"pixels"` or `"metres"`; see In metres.
        ray_angles: Directions of the rays from the heading, rad, in the order of
            `ranges`, instead of `n_rays` and `field_of_view`. Default: an even fan.
        physics: `"exact"`, or `"mujoco"` (extra `tdac[physics]`): a 3D contact solver
            moves the robot. A dict such as `{"engine": "mujoco", "resolution": 0.05,
            "torque": 0.1}` also tells metres per px, and figures of the body
            (`docs/physics.md`). With `"mujoco-rays"`, MuJoCo measures `ranges`, too.
        view: Of frames: `"2d"`, or `"3d"`, rendered by MuJoCo (extra `tdac[physics]`).
        render_mode: `"rgb_array"`, `"human"` (extra `tdac[human]`) or None.

    ## Version History
    * v0: Initial version. Before the first release, `on_collision="block"` changed,
      rays of a full circle became 360°/n apart, and maps with a resolution got
      defaults in metres. Since then, dynamics are frozen as Ladder 1.0.
    """

    title = "TDAC-Map2D-v0"
    metadata: dict[str, Any] = {  # noqa: RUF012 - as declared by gym.Env
        "render_modes": ["rgb_array", "human"],
        "render_fps": 20,
    }
    readings = "ranges"
    """Observation key of the distance sensors."""
    info_of = staticmethod(info_of)
    _solid_picture = SolidPicture

    def __init__(
        self,
        map: MapSource = "maze",  # noqa: A002 - the usual term
        start: tuple[float, ...] | None = None,
        goal: tuple[float, float] | None = None,
        heading: float | None = None,
        robot_radius: float | None = None,
        axle_length: float | None = None,
        max_wheel_speed: float | None = None,
        n_rays: int | None = None,
        field_of_view: float | None = None,
        range_max: float | None = None,
        dt: float | None = None,
        horizon: int | None = None,
        goal_tolerance: float | None = None,
        on_collision: str = "terminate",
        variation: str = "nominal",
        sensor: str = "rays",
        range_noise: float | None = None,
        range_dropout: float = 0.0,
        wheel_slip: float | None = None,
        wheel_gains: float = 0.0,
        axle_error: float = 0.0,
        odometry: bool = False,
        odometry_scale: float = 0.0,
        odometry_noise: float = 0.0,
        wheel_radius_error: float | None = None,
        motor_lag: float = 0.0,
        delay: int = 0,
        max_acceleration: float | None = None,
        max_turn_acceleration: float | None = None,
        stopping_distance: float | None = None,
        max_speed: float | None = None,
        max_turn_rate: float | None = None,
        pose_noise: float | None = None,
        heading_noise: float | None = None,
        pose_correlation: float | None = None,
        pose_jumps: float | None = None,
        pose_delay: int | None = None,
        scan_delay: int | None = None,
        message_drop: float = 0.0,
        range_min: float | None = None,
        below_min: str | None = None,
        scanner_offset: tuple[float, float] | None = None,
        robot: RobotSource = None,
        disturbed: bool = False,
        reward_weights: Mapping[str, float] | None = None,
        snap: bool = False,
        polarity: Shade | None = None,
        movers: MoversOption = None,
        frame: FrameName = "pixels",
        ray_angles: Sequence[float] | None = None,
        physics: PhysicsOption = EXACT,
        view: str = "2d",
        render_mode: str | None = None,
    ) -> None:
        units = units_of(map, frame)
        typed = {
            "start": start,
            "goal": goal,
            "heading": heading,
            "robot_radius": robot_radius,
            "axle_length": axle_length,
            "max_wheel_speed": max_wheel_speed,
            "n_rays": n_rays,
            "field_of_view": field_of_view,
            "range_max": range_max,
            "goal_tolerance": goal_tolerance,
            "movers": read_specs(movers),
            "ray_angles": ray_angles,
            "range_min": range_min,
            "below_min": below_min,
            "scanner_offset": scanner_offset,
            "max_acceleration": max_acceleration,
            "max_turn_acceleration": max_turn_acceleration,
            "stopping_distance": stopping_distance,
            "max_speed": max_speed,
            "max_turn_rate": max_turn_rate,
            "dt": dt,
            "range_noise": range_noise,
            "wheel_slip": wheel_slip,
            "wheel_radius_error": wheel_radius_error,
            "pose_noise": pose_noise,
            "heading_noise": heading_noise,
            "pose_correlation": pose_correlation,
            "pose_jumps": pose_jumps,
            "pose_delay": pose_delay,
            "scan_delay": scan_delay,
        }
        metric = None if robot is None else metric_units(map)
        own = with_robot(robot, disturbed, metric, units.frame is not None, typed)
        given = in_pixels(units, **own)
        prepared = prepare(
            map,
            given["start"],
            given["goal"],
            heading=given["heading"],
            robot_radius=given["robot_radius"],
            snap=snap,
            options=ReadingOptions(polarity),
            units=units,
        )
        params = prepared.params
        body = override(params.robot, **{name: given[name] for name in OVERRIDDEN})
        assert params.start is not None
        assert params.goal is not None
        nominal = make_task(
            Terrain.of(prepared.grid),
            Pose(*params.start, params.heading),
            params.goal,
            body,
            dt=0.05 if given["dt"] is None else given["dt"],
            goal_tolerance=given["goal_tolerance"],
            horizon=horizon,
            units=units,
        )
        setup = Map2DSetup(
            nominal=nominal,
            variation=variation,
            fixed_horizon=horizon is not None,
            on_collision=on_collision,
            motor_lag=motor_lag,
            delay=delay,
            disturbances=Disturbances(
                given["wheel_slip"] or 0.0,
                wheel_gains,
                axle_error,
                odometry,
                odometry_scale,
                odometry_noise,
                given["wheel_radius_error"] or 0.0,
            ),
            weights=weights_of(reward_weights),
            source=None,
            range_noise=noise_of(sensor, given["range_noise"]),
            range_dropout=range_dropout,
            movers=given["movers"],
            metric=units.frame,
            sensor=sensor,
            reception=Reception(
                **{n: given[n] or 0 for n in RECEIVED}, message_drop=message_drop
            ),
            physics=engine_of(physics, robot),
            view=view,
            pixel_size=params.resolution,
        )
        notes = with_tolerance_note(params.notes, nominal, units.length)
        self.params = params.model_copy(update={"notes": notes})
        self._prepare(setup, render_mode)

    @classmethod
    def of(cls, setup: Map2DSetup, render_mode: str | None = None) -> Map2DEnv:
        """The environment of a setup; it has no `params`."""
        env = cls.__new__(cls)
        env._prepare(setup, render_mode)
        return env

    def _prepare(self, setup: Map2DSetup, render_mode: str | None) -> None:
        super().__init__(setup, render_mode)
        self.range_noise, self.range_dropout = setup.range_noise, setup.range_dropout
        space = observation_space(setup.nominal)
        self._is_inexact = setup.has_inexact_ranges
        if self.disturbances.odometry:
            space = with_odometry(space, self._limits)
            self._is_inexact = True
        self._receiver = setup.receiver()
        self._is_inexact |= self._receiver is not None
        self._units = MapUnits(setup.metric)
        self._view = None if setup.metric is None else MetricView(setup.metric)
        if self._view is not None:
            space = self._view.space(space)
            self.info_of = self._view.info_of
        self.observation_space = space  # type: ignore[assignment]
        self.robot = Map2DArrays.blank(setup.nominal.robot.n_rays, self.delay)
        self.robot.constants[:] = setup.constants()
        self._goal = np.array(self.nominal.goal, np.float32)
        self.movers: Movers = self.nominal.fresh_movers()
        self._carried = carried_by(setup, setup.nominal)
        self._bind()
        self._scene: MapScene | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; the class documents `options`.

        Raises:
            TaskError: An option is unknown, or the start or goal is not feasible.
        """
        super().reset(seed=seed)
        before = self.task
        self._draw(options_in_pixels(options or {}, self._units))
        if self.setup.has_movers:
            self.movers = self.task.fresh_movers()
        if self.task.field is not before.field or self.setup.has_movers:
            self._bind()
        task, robot = self.task, self.robot
        if self._carried is not None:
            self._carried.reset(task.start)
        place(robot, task)
        self._hide()
        self._goal[:] = task.goal
        self._call_begin()
        self._begin_trail()
        if self.render_mode == "human":
            self.render()
        return self._observation(), self.info_of(robot.outcome.tolist())

    def observed_pose(self) -> NDArray[np.float64]:
        """The pose as it is observed, shape (3,): x, y (px), heading (rad)."""
        return self.pose() if self._receiver is None else self._receiver.pose.copy()

    def discs(self) -> NDArray[np.float64]:
        """The movers as they are now, shape (n, 3): x, y, radius, px."""
        return self.movers.discs()

    def __getstate__(self) -> dict[str, Any]:
        own = "addresses", "_call_begin", "_call_drive", "_copies", "_solid"
        return {**self.__dict__, **dict.fromkeys(own)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    def _bind(self) -> None:
        """Binds the kernels to this environment's own arrays."""
        arrays = *self.setup.world(self.task), *self.robot
        among = self.setup.has_movers
        self.addresses = Addresses([(*arrays, *self.movers) if among else arrays])
        (words,) = self.addresses.words
        alone = begin, drive if self.on_collision == "terminate" else drive_or_slide
        kernels = (begin_among, drive_among) if among else alone
        calls: list[Callable[[], None]] = [partial(call, words) for call in kernels]
        if self._carried is not None:
            own = words, self.robot, self.task, self.setup.physics.measures
            calls = self._carried.calls(calls[0], *own)
        if self.setup.sonar is not None:
            calls = [partial(self._then_listen, call) for call in calls]
        self._call_begin, self._call_drive = calls
        self._note_gap = note_gap_among if among else note_gap
        robot = self.robot
        seen = robot.pose, self._goal, robot.wheel_speeds, robot.ranges
        self._copies = [array.copy for array in seen]

    def _then_listen(self, call: Callable[[], None]) -> None:
        """Calls a kernel, and replaces its ranges by those of the sonars."""
        call()
        robot = self.robot
        discs, terrain = self.discs(), self.task.terrain
        self.setup.sonar.read(terrain, robot.state, discs, robot.ranges)

    def _observation(self) -> Observation:
        pose, goal, wheels, ranges = self._copies
        seen = {
            "pose": pose(),
            "goal": goal(),
            "wheel_speeds": wheels(),
            "ranges": ranges(),
        }
        if self._is_inexact:
            if self.setup.has_inexact_ranges:
                seen["ranges"][:] = noisy(seen["ranges"], self.setup, self._random)
            if self.disturbances.odometry:
                seen["odometry"] = self._odometry()
            if self._receiver is not None:
                self._receive(self._receiver, seen)
        return seen if self._view is None else self._view.seen(seen)

    def _receive(self, receiver: Receiver, seen: Observation) -> None:
        """Replaces pose and ranges by those that have reached the robot."""
        begins = bool(self.robot.state[STEPS] == 0.0)
        receiver.receive(self.pose(), seen["ranges"], begins, self._random)
        seen["pose"][:] = receiver.pose
        seen["ranges"] = receiver.ranges.copy()

    def _begin_trail(self) -> None:
        super()._begin_trail()
        steps = math.ceil(GHOST_SECONDS / self.task.dt)
        self._ghosts: deque[NDArray[np.float64]] = deque(
            [self.discs()], min(steps + 1, MOST_GHOSTS)
        )

    def _note(self, reached: bool, collided: bool, truncated: bool) -> None:
        self._ghosts.append(self.discs())
        super()._note(reached, collided, truncated)

    def _frame(self) -> NDArray[np.uint8]:
        task, robot = self.task, self.robot
        if self._scene is None:
            self._scene = MapScene(
                task.terrain.grid.cells,
                task.start,
                task.goal,
                goal_tolerance=task.goal_tolerance,
                robot=task.robot,
                path=task.shortest_path(task.start),
                units=self._units,
            )
        gap = math.dist(self._trail[-1], task.goal)
        status = Status(self._steps, task.horizon, gap, self._status)
        return self._scene.frame(
            robot.state[:3].tolist(), robot.ranges, self._trail, status, self._ghosts
        )
