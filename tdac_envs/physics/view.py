"""Pictures of a robot in three dimensions, rendered by MuJoCo without a display."""

from __future__ import annotations

import functools
import importlib
import itertools
import math
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.physics.body import BodySpec
from tdac_envs.physics.moved import Pose

if TYPE_CHECKING:
    # Loaded with the first picture: an environment needs no code of worlds.
    from tdac_envs.physics.scene import Scene

Image = NDArray[np.uint8]
WIDTH, HEIGHT = 800, 480
"""Size of a picture, px."""
_INSET = 220
"""Length of the inset's longer side, px."""
_FRAME, _EDGE = 12, 2
_LAG = 0.15
"""Part of a turn that the camera follows from one picture to the next."""
_MOST_SEGMENTS = 400
_PATH = (0.10, 0.35, 0.75, 0.9)
_GOAL = (0.10, 0.62, 0.30, 0.55)
_MOVER = (0.75, 0.25, 0.22, 1.0)
_PLACES = ("egl", "osmesa")


class View3D:
    """Draws a robot from behind, with the whole scene from above in a corner.

    Args:
        scene: The scene.
        body: The robot's body.
        goal: x and y of the goal, m.
        tolerance: Distance at which it is reached, m.

    Raises:
        TaskError: MuJoCo is not installed, or cannot render here.
    """

    def __init__(
        self,
        scene: Scene,
        body: BodySpec,
        goal: tuple[float, float],
        tolerance: float,
    ) -> None:
        from tdac_envs.physics import mjcf
        from tdac_envs.physics.decor import DRAWN, drawn_model
        from tdac_envs.physics.engine import mujoco_module

        engine = self._engine = mujoco_module()
        self._context = current_context()
        self._floor, self._body = scene.floor, body
        self._goal, self._tolerance = goal, tolerance
        text = drawn_model(scene, body, WIDTH, HEIGHT)
        self._model = engine.MjModel.from_xml_string(text)
        self._data = engine.MjData(self._model)
        count = self._model.ngeom + 2 * _MOST_SEGMENTS + 400
        self._scene = engine.MjvScene(self._model, maxgeom=count)
        self._options = engine.MjvOption()
        self._options.geomgroup[:] = 0
        self._options.geomgroup[[mjcf.SEEN, DRAWN]] = 1
        scale = engine.mjtFontScale.mjFONTSCALE_100.value
        try:
            self._renderer = engine.MjrContext(self._model, scale)
        except engine.FatalError:  # the display was closed, and current all the same
            self._context = another_context(self._context)
            self._renderer = engine.MjrContext(self._model, scale)
        self._azimuth: float | None = None
        bounds = _bounds(scene, goal)
        self._inset = _inset_of(bounds)
        self._above = self._camera_above(bounds)
        free = [self._model.joint(mjcf.name_of(k)) for k in range(len(scene.things))]
        self._free = [int(joint.qposadr[0]) for joint in free]
        self._robot = int(self._model.joint(mjcf.ROBOT).qposadr[0])

    def frame(
        self,
        pose: Pose,
        trail: Sequence[tuple[float, float]] = (),
        things: NDArray[np.float64] | None = None,
        discs: NDArray[np.float64] | None = None,
    ) -> Image:
        """A picture, uint8 (height, width, 3).

        Args:
            pose: x, y (m) and heading (rad) of the robot.
            trail: Where it was before, m.
            things: Shape (k, 3): x, y (m) and rotation (rad) of free things; by default
                where they stand at first.
            discs: Shape (n, 3): x, y, radius of moving obstacles, m.
        """
        self._context.make_current()
        # Another view may have been drawn since.
        offscreen = self._engine.mjtFramebuffer.mjFB_OFFSCREEN.value
        self._engine.mjr_setBuffer(offscreen, self._renderer)
        self._place(pose, things)
        marks = [*_thinned([*trail, pose[:2]])], discs
        image = self._picture(self._camera_behind(pose), WIDTH, HEIGHT, marks, True)
        wide, high = self._inset
        inset = self._picture(self._above, wide, high, marks, False)
        right, top = WIDTH - _FRAME, _FRAME
        image[
            top - _EDGE : top + high + _EDGE, right - wide - _EDGE : right + _EDGE
        ] = 255
        image[top : top + high, right - wide : right] = inset
        return image

    def _place(self, pose: Pose, things: NDArray[np.float64] | None) -> None:
        qpos, (x, y, heading), at = self._data.qpos, pose, self._robot
        qpos[at : at + 3] = x, y, self._floor + self._body.wheel_radius
        qpos[at + 3 : at + 7] = _about_z(heading)
        for start, row in zip(
            self._free, () if things is None else things, strict=False
        ):
            qpos[start : start + 2] = row[:2]
            qpos[start + 3 : start + 7] = _about_z(float(row[2]))
        self._engine.mj_kinematics(self._model, self._data)
        self._engine.mj_comPos(self._model, self._data)
        self._engine.mj_camlight(self._model, self._data)
        # The lamp stays above the robot, so that shadows near it are sharp.
        self._data.light_xpos[0, :2] += x, y

    def _camera_behind(self, pose: Pose) -> Any:
        """The camera that follows the robot; it turns a little later."""
        x, y, heading = pose
        radius = self._body.radius
        before = heading if self._azimuth is None else self._azimuth
        self._azimuth = before + _LAG * math.remainder(heading - before, math.tau)
        if abs(math.remainder(heading - self._azimuth, math.tau)) > 0.9:
            behind = math.copysign(0.9, math.remainder(heading - before, math.tau))
            self._azimuth = heading - behind
        camera = self._engine.MjvCamera()
        ahead = 4.5 * radius
        camera.lookat[:] = (
            x + ahead * math.cos(self._azimuth),
            y + ahead * math.sin(self._azimuth),
            self._floor + radius,
        )
        camera.distance, camera.elevation = 21.0 * radius, -27.0
        camera.azimuth = math.degrees(self._azimuth)
        return camera

    def _camera_above(self, bounds: tuple[float, float, float, float]) -> Any:
        left, low, right, high = bounds
        camera = self._engine.MjvCamera()
        camera.lookat[:] = (left + right) / 2, (low + high) / 2, self._floor
        wide, tall = self._inset
        half = 0.52 * max(high - low, (right - left) * tall / wide)
        camera.distance = half / math.tan(math.radians(38.0) / 2)
        camera.azimuth, camera.elevation = 90.0, -90.0
        return camera

    def _picture(
        self, camera: Any, width: int, height: int, marks: Any, near: bool
    ) -> Image:
        engine, scene = self._engine, self._scene
        every = engine.mjtCatBit.mjCAT_ALL.value
        engine.mjv_updateScene(
            self._model, self._data, self._options, None, camera, every, scene
        )
        trail, discs = marks
        self._mark(trail, discs, near)
        scene.flags[engine.mjtRndFlag.mjRND_SHADOW] = near
        scene.flags[engine.mjtRndFlag.mjRND_REFLECTION] = False
        port = engine.MjrRect(0, 0, width, height)
        engine.mjr_render(port, scene, self._renderer)
        image = np.empty((height, width, 3), np.uint8)
        engine.mjr_readPixels(image, None, port, self._renderer)
        return np.ascontiguousarray(image[::-1])

    def _mark(
        self,
        trail: Sequence[tuple[float, float]],
        discs: NDArray[np.float64] | None,
        near: bool,
    ) -> None:
        """Adds goal, path and movers; from afar, the path is wider."""
        kinds, radius, floor = self._engine.mjtGeom, self._body.radius, self._floor
        flat = 0.02 * radius
        x, y = self._goal
        wide = max(self._tolerance, (0.4 if near else 1.2) * radius)
        self._add(kinds.mjGEOM_CYLINDER, (wide, flat, 0), (x, y, floor + flat), _GOAL)
        tall = 3.0 * radius
        pole = (0.06 * radius, tall / 2, 0)
        self._add(
            kinds.mjGEOM_CYLINDER, pole, (x, y, floor + tall / 2), (*_GOAL[:3], 1)
        )
        ball = (0.35 * radius,) * 3
        self._add(kinds.mjGEOM_SPHERE, ball, (x, y, floor + tall), (*_GOAL[:3], 1))
        line = (0.07 if near else 0.40) * radius
        for begin, end in itertools.pairwise(trail):
            geom = self._add(kinds.mjGEOM_CAPSULE, (line,) * 3, (0, 0, 0), _PATH)
            if geom is not None:
                ends = (np.array([*p, floor + 0.1 * flat]) for p in (begin, end))
                self._engine.mjv_connector(geom, kinds.mjGEOM_CAPSULE, line, *ends)
        for x, y, size in () if discs is None else discs.tolist():
            tall = self._body.top / 2
            self._add(
                kinds.mjGEOM_CYLINDER, (size, tall, 0), (x, y, floor + tall), _MOVER
            )

    def _add(self, kind: Any, size: Any, place: Any, colour: Any) -> Any:
        """Adds a geom to the picture; None if there is no room for it."""
        scene = self._scene
        if scene.ngeom >= scene.maxgeom:
            return None
        geom = scene.geoms[scene.ngeom]
        self._engine.mjv_initGeom(
            geom, kind, np.array(size, float), np.array(place, float),
            np.eye(3).ravel(), np.array(colour, np.float32),
        )  # fmt: skip
        scene.ngeom += 1
        return geom


_TOLD = "PYOPENGL_PLATFORM"
_ENDED: list[Any] = []
"""Contexts whose display another library has closed: freeing them is an error."""


def current_context() -> Any:
    """The context of this process, made current.

    A library that opens windows, such as SDL, may have closed the display that EGL
    gives to all; then a new one is opened.

    Raises:
        TaskError: As for `gl_context`.
    """
    context = gl_context()
    try:
        context.make_current()
    except Exception:  # of any kind, as below
        return another_context(context)
    return context


def another_context(ended: Any) -> Any:
    """A new context in place of one whose display was closed, made current.

    Raises:
        TaskError: As for `gl_context`.
    """
    _ENDED.append(ended)
    gl_context.cache_clear()
    module: Any = sys.modules.get("mujoco.egl")
    if module is not None:
        module.EGL_DISPLAY = None  # the next context opens it anew
    return gl_context()


@functools.cache
def gl_context() -> Any:
    """The OpenGL context of this process, without a window: EGL, or else OSMesa.

    All views share it: an object that is freed while another context is current would
    take one of that context with it.

    `MUJOCO_GL` chooses one of them.

    Raises:
        TaskError: There is neither.
    """
    wanted = os.environ.get("MUJOCO_GL", "").lower()
    # MuJoCo tells PyOpenGL by a variable, which other processes must not inherit.
    before = os.environ.get(_TOLD)
    reasons = []
    for place in (wanted,) if wanted in _PLACES else _PLACES:
        try:
            module = importlib.import_module(f"mujoco.{place}")
            context = module.GLContext(WIDTH, HEIGHT)
            context.make_current()
        except Exception as error:  # the packages below raise errors of any kind
            reasons.append(f"{place}: {' '.join(str(error).split())[:80]}")
        else:
            return context
        finally:
            os.environ.pop(_TOLD, None)
            if before is not None:
                os.environ[_TOLD] = before
    raise TaskError(
        "view '3d' needs OpenGL without a window: install libegl1 (EGL) or libosmesa6 "
        f"(OSMesa) and the package PyOpenGL ({'; '.join(reasons)})"
    )


def _about_z(heading: float) -> tuple[float, float, float, float]:
    return math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)


def _bounds(
    scene: Scene, goal: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Bounds of what is visible, with the goal, m."""
    edges = [prism.shape.bounds for prism in scene.prisms if prism.visible]
    box = np.array([*edges, (*goal, *goal)])
    left, low = box[:, :2].min(axis=0).tolist()
    right, high = box[:, 2:].max(axis=0).tolist()
    return left, low, max(right, left + 0.5), max(high, low + 0.5)


def _inset_of(bounds: tuple[float, float, float, float]) -> tuple[int, int]:
    """Width and height of the inset, px: in the proportion of the scene."""
    left, low, right, high = bounds
    scale = _INSET / max(right - left, high - low)
    return max(round(scale * (right - left)), 60), max(round(scale * (high - low)), 60)


def _thinned(trail: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """At most `_MOST_SEGMENTS` points of a path, with its last one."""
    step = max(math.ceil(len(trail) / _MOST_SEGMENTS), 1)
    return [*trail[:-1:step], *trail[-1:]]
