"""A robot's body in MuJoCo."""

from __future__ import annotations

import importlib
import math
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command
from tdac_envs.physics import mjcf
from tdac_envs.physics.body import BodySpec
from tdac_envs.physics.moved import Moved, Pose
from tdac_envs.physics.scene import Scene
from tdac_envs.physics.varied import AS_DESCRIBED, Described, Variation, variation_at

Array = NDArray[np.float64]
_REST = 0.5
"""Time in which a robot settles on its wheels, and things on the ground, s."""
_ASIDE = 100.0
"""Height of the robot while things settle, m."""
_VISIBLE = np.zeros(6, np.uint8)
_VISIBLE[mjcf.SEEN] = 1


def mujoco_module() -> Any:
    """The package `mujoco`.

    Raises:
        TaskError: It is not installed, or its parts do not match.
    """
    try:
        return importlib.import_module("mujoco")
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith("mujoco"):
            raise
    except ImportError as error:
        reason = str(error).split(". ", maxsplit=1)[0].strip()
        raise TaskError(
            f"MuJoCo cannot be imported: {reason}; mujoco and mujoco-core must have "
            "the same version: pip install --force-reinstall mujoco mujoco-core"
        ) from None
    raise TaskError(f"physics 'mujoco' needs MuJoCo: {install_command('physics')}")


def engine_version() -> str:
    """Name and version, such as `MuJoCo 4.0.0`."""
    return f"MuJoCo {mujoco_module().__version__}"


class MujocoBody:
    """A robot that MuJoCo moves through a scene; implements `moved.Physics`.

    Motors follow the commanded wheel speeds with limited torque. Before the first
    episode the robot and the free things settle on the ground.

    Args:
        scene: What the robot can touch.
        body: The robot's body.

    Raises:
        TaskError: MuJoCo is not installed, or refuses the scene.
    """

    def __init__(self, scene: Scene, body: BodySpec) -> None:
        self._scene, self._body = scene, body
        self._load()
        self._rest = self._settled()
        self.reset((0.0, 0.0, 0.0))

    def _load(self) -> None:
        engine = self._engine = mujoco_module()
        text = mjcf.model_of(self._scene, self._body)
        try:
            self.model = engine.MjModel.from_xml_string(text)
        except ValueError as error:
            reason = " ".join(str(error).split())
            raise TaskError(f"MuJoCo refuses the world: {reason:.200}") from None
        self.data = engine.MjData(self.model)
        self._described = Described(engine, self.model)
        self.variation = AS_DESCRIBED
        self._hull = self.model.geom(mjcf.HULL).id
        self._ground = self.model.geom(mjcf.GROUND).id
        self._hit = np.full(1, -1, np.int32)
        self._has_clouds = any(p.visible > p.solid for p in self._scene.prisms)
        self._at, self._going = self._joint(mjcf.ROBOT)
        self._wheels = [self._joint(n)[0] for n in (mjcf.LEFT, mjcf.RIGHT)]
        self._free = [
            self._joint(mjcf.name_of(k))[0] for k in range(len(self._scene.things))
        ]

    def _joint(self, name: str) -> tuple[int, int]:
        """Indices in `qpos` and `qvel` at which a joint begins."""
        joint = self.model.joint(name)
        return int(joint.qposadr[0]), int(joint.dofadr[0])

    def _settled(self) -> Array:
        """`qpos` of everything at rest, with the robot at the origin."""
        if not self._scene.things and not self._scene.prisms:
            return self._after(self.data.qpos.copy())
        aside = self.data.qpos.copy()
        aside[self._at + 2] += _ASIDE
        rest = self._after(aside) if self._scene.things else aside
        alone = MujocoBody(Scene((), (), self._scene.floor), self._body)
        rest[self._at : self._at + 7] = alone._rest[:7]
        return rest

    def _after(self, begin: Array) -> Array:
        """`qpos` after `_REST` from a position, with the motors off."""
        self._engine.mj_resetData(self.model, self.data)
        self.data.qpos[:] = begin
        self.model.opt.timestep = mjcf.SUBSTEP
        for _ in range(round(_REST / mjcf.SUBSTEP)):
            self._engine.mj_step(self.model, self.data)
        rest: Array = self.data.qpos.copy()
        return rest

    def reset(self, pose: Pose) -> None:
        """Begins an episode at a pose; see `moved.Physics`."""
        engine, data, at = self._engine, self.data, self._at
        self._vary(variation_at(pose, self._body.varied))
        engine.mj_resetData(self.model, data)
        data.qpos[:] = self._rest
        data.qpos[at : at + 2] = pose[:2]
        turn = np.array([math.cos(pose[2] / 2), 0.0, 0.0, math.sin(pose[2] / 2)])
        turned = np.zeros(4)
        engine.mju_mulQuat(turned, turn, self._rest[at + 3 : at + 7])
        data.qpos[at + 3 : at + 7] = turned
        engine.mj_forward(self.model, data)
        self._origins = self._things_now()

    def _vary(self, found: Variation) -> None:
        """Takes over how the robot differs from its description."""
        if found != self.variation:
            self._described.apply(found, self.data)
            self.variation = found

    def step(self, left: float, right: float, dt: float) -> Moved:
        """Drives for one control step; see `moved.Physics`."""
        model, data, hull, ground = self.model, self.data, self._hull, self._ground
        count = max(math.ceil(dt / mjcf.SUBSTEP - 1e-9), 1)
        model.opt.timestep = dt / count
        radius, (one, other) = self._body.wheel_radius, self.variation.wheels
        data.ctrl[:] = one * left / radius, other * right / radius
        before = data.qpos[self._wheels]
        touched, advance, contact = False, self._engine.mj_step, data.contact
        for _ in range(count):
            advance(model, data)
            if not touched:  # few pairs: lists are faster than arrays
                pairs = contact.geom.tolist()
                touched = any(hull in pair and ground not in pair for pair in pairs)
        turned = data.qpos[self._wheels] - before
        return Moved(self.pose(), touched, (float(turned[0]), float(turned[1])))

    def pose(self) -> Pose:
        """x, y (m) of the middle of the axle and heading (rad)."""
        at, qpos = self._at, self.data.qpos
        x, y = qpos[at : at + 2].tolist()
        return x, y, mjcf.heading_of(qpos[at + 3 : at + 7])

    def tilt(self) -> float:
        """Angle between the robot's axis and the vertical, rad."""
        at = self._at
        _, x, y, _ = self.data.qpos[at + 3 : at + 7].tolist()
        return math.acos(max(min(1 - 2 * (x * x + y * y), 1.0), -1.0))

    def things(self) -> Array:
        """Free things; see `moved.Physics`."""
        now = self._things_now()
        now[:, 2] -= self._origins[:, 2]
        return now

    def _things_now(self) -> Array:
        qpos = self.data.qpos
        rows = [
            (*qpos[k : k + 2].tolist(), mjcf.heading_of(qpos[k + 3 : k + 7]))
            for k in self._free
        ]
        return np.array(rows, np.float64).reshape(-1, 3)

    def ranges(self, origins: Array, directions: Array, most: float) -> Array:
        """Distances along rays to what is visible, without the robot and the ground.

        Args:
            origins: Shape (n, 3): where the rays begin, m.
            directions: Shape (n, 3): unit vectors.
            most: Returned where a ray hits nothing nearer, m.
        """
        rays = zip(origins, directions, strict=True)
        return np.array([min(self._ray(*each)[0], most) for each in rays])

    def hits(self, origins: Array, directions: Array, most: float) -> Array:
        """Distances along rays, and the reflectances of what they hit.

        Arguments as for `ranges`. A ray that begins in a part has the distance 0.

        Returns:
            Shape (n, 2): distance, m, and reflectance, 1 where a ray hits nothing.
        """
        if self._free:  # `mj_step` leaves the places of things one substep ago
            self._engine.mj_kinematics(self.model, self.data)
        found = np.full((len(origins), 2), (most, 1.0))
        for row, origin, along in zip(found, origins, directions, strict=True):
            gap, geom = self._around(origin, along) or self._ray(origin, along)
            if gap < most:
                row[:] = gap, self._reflectances[geom]
        return found

    def _around(self, origin: Array, along: Array) -> tuple[float, int] | None:
        """The distance 0 and the geom in which a ray begins; None if in none.

        A robot is only in what is visible and not solid. Such parts are convex and
        upright: one that is ahead and behind on the same level is also here.
        """
        if not self._has_clouds:
            return None
        level = np.array([along[0], along[1], 0.0])
        _, ahead = self._ray(origin, level)
        _, behind = self._ray(origin, -level)
        return (0.0, ahead) if ahead == behind >= 0 else None

    def _ray(self, origin: Array, along: Array) -> tuple[float, int]:
        """Distance to what a ray hits, and its geom; inf and -1 for nothing."""
        gap = self._engine.mj_ray(
            self.model, self.data, origin, along, _VISIBLE, True, -1, self._hit
        )
        geom = int(self._hit[0])
        return (math.inf, -1) if geom in (-1, self._ground) else (gap, geom)

    @cached_property
    def _reflectances(self) -> Array:
        """Reflectance of each geom."""
        found = np.ones(self.model.ngeom)
        for index, prism in enumerate(self._scene.prisms):
            found[self.model.geom(mjcf.prism_name(index)).id] = prism.reflectance
        return found

    def __getstate__(self) -> dict[str, Any]:
        kind = self._engine.mjtState.mjSTATE_INTEGRATION.value
        state = np.zeros(self._engine.mj_stateSize(self.model, kind))
        self._engine.mj_getState(self.model, self.data, state, kind)
        own: dict[str, Any] = {"_scene": self._scene, "_body": self._body}
        own["_rest"] = self._rest
        own |= {"_origins": self._origins, "variation": self.variation}
        return {**own, "state": state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        now, variation = state.pop("state"), state.pop("variation")
        self.__dict__.update(state)
        self._load()
        self._vary(variation)
        kind = self._engine.mjtState.mjSTATE_INTEGRATION.value
        self._engine.mj_setState(self.model, self.data, now, kind)
        self._engine.mj_forward(self.model, self.data)
