"""Light sensors, as the reference of Webots' LightSensor describes them.

The irradiance at a sensor is the sum over all lights that are on of
(F . C) / 3 (Ia + spot I cos phi) attenuation. F is the sensor's colour filter; C, Ia
and I are the light's colour, ambient intensity and intensity; phi is the angle between
the sensor's axis and the direction to the light. Nothing casts a shadow. The sensor's
table maps the irradiance to a reading, without noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from tdac_envs.core.errors import WorldError
from tdac_envs.epuck.infrared import PLACES
from tdac_envs.epuck.prisms import Array
from tdac_envs.webots.mounts import in_world, lookup_table, sorted_rows
from tdac_envs.worlds.wbt.fields import (
    children,
    flag,
    number,
    numbers,
    text,
)
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.geometry import GROUPS
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.tree import WbtNode

_HEIGHT = 0.0329
_TABLE = (1.0, 4095.0, 0.01, 2.0, 0.0, 0.01)
_USUAL = (0.0, 0.0, 0.0, 1000.0, 1000.0, 0.0)
_KINDS = ("DirectionalLight", "PointLight", "SpotLight")
_CUT_OFF, _BEAM = 0.785398, 1.570796
_AMBIENT = 1.0
"""Ambient intensity of a TexturedBackgroundLight; its direction depends on images
and is not modelled."""


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """A light.

    Attributes:
        kind: Its node type.
        place: Position, m, shape (3,); not used for a DirectionalLight.
        direction: Direction of its rays, of length 1, shape (3,); not used for a
            PointLight.
        colour: Its colour, shape (3,).
        intensity: Its intensity.
        ambient: Its ambient intensity.
        attenuation: Coefficients for distances to the powers 0, 1 and 2.
        cone: Beam width and cut-off angle of a SpotLight, rad.
    """

    kind: str
    place: Array
    direction: Array
    colour: Array
    intensity: float
    ambient: float
    attenuation: tuple[float, ...]
    cone: tuple[float, float]

    def irradiance(self, at: Array, axis: Array, colours: Array) -> float:
        """Irradiance at a point.

        Args:
            at: The point, m, shape (3,).
            axis: Axis of the sensor, shape (3,).
            colours: Colour filter of the sensor, shape (3,).
        """
        towards, damping, spot = -self.direction, 1.0, 1.0
        if self.kind != "DirectionalLight":
            offset = self.place - at
            distance = float(np.linalg.norm(offset))
            towards = offset / max(distance, 1e-9)
            a, b, c = self.attenuation
            damping = 1.0 / max(a + b * distance + c * distance**2, 1e-9)
        if self.kind == "SpotLight":
            angle = math.acos(float(np.clip(-towards @ self.direction, -1.0, 1.0)))
            spot = _spot(angle, *self.cone)
        direct = spot * self.intensity * max(float(axis @ towards), 0.0)
        return float(colours @ self.colour) / 3.0 * damping * (self.ambient + direct)


def _spot(angle: float, width: float, cut_off: float) -> float:
    if angle > cut_off:
        return 0.0
    if angle <= width:
        return 1.0
    return (angle - cut_off) / (width - cut_off)


def find_lights(nodes: Iterable[WbtNode], frame: NodeFrame) -> tuple[Light, ...]:
    """The lights of a file that are on.

    Args:
        nodes: Top-level nodes.
        frame: Their frame.
    """
    return tuple(_lights(nodes, frame))


def _lights(nodes: Iterable[WbtNode], frame: NodeFrame) -> Iterator[Light]:
    for node in nodes:
        try:
            if node.kind in _KINDS and flag(node, "on", True):
                yield _light(node, frame)
            elif node.kind == "TexturedBackgroundLight":
                yield _ambient()
            elif node.kind in GROUPS or node.kind == "Solid":
                inner = frame if node.kind == "Group" else placed(node, frame)
                yield from _lights(children(node), inner)
        except WorldError:  # an invalid light affects nothing else
            continue


def _light(node: WbtNode, frame: NodeFrame) -> Light:
    down = (0.0, -1.0, 0.0) if frame.y_up else (0.0, 0.0, -1.0)
    if node.kind == "SpotLight":
        down = (0.0, 0.0, -1.0)
    direction = frame.matrix @ numbers(node, "direction", down)
    usual = (0.3, 0.3, 0.3) if node.kind == "PointLight" else (0.0, 0.0, 10.0)
    return Light(
        kind=node.kind,
        place=frame.at(numbers(node, "location", usual)),
        direction=direction / max(float(np.linalg.norm(direction)), 1e-9),
        colour=np.array(numbers(node, "color", (1.0, 1.0, 1.0))),
        intensity=number(node, "intensity", 1.0),
        ambient=number(node, "ambientIntensity", 0.0),
        attenuation=numbers(node, "attenuation", (1.0, 0.0, 0.0)),
        cone=(
            number(node, "beamWidth", _BEAM),
            number(node, "cutOffAngle", _CUT_OFF),
        ),
    )


def _ambient() -> Light:
    none = np.zeros(3)
    usual = (1.0, 0.0, 0.0)
    return Light(
        "DirectionalLight", none, none, np.ones(3), 0.0, _AMBIENT, usual, (0.0, 0.0)
    )


@dataclass(frozen=True, slots=True, eq=False)
class LightCell:
    """A light sensor.

    Attributes:
        name: Device name.
        place: Position relative to the robot: forward, left, up, m, shape (3,).
        axis: Direction in which it points, in these axes, of length 1, shape (3,).
        table: Shape (n, 3): irradiance; reading; relative noise.
        colours: Colour filter, shape (3,).
    """

    name: str
    place: Array
    axis: Array
    table: Array
    colours: Array

    def plain(self) -> dict[str, object]:
        """The facts that are sent to the controller."""
        return {"table": [float(value) for value in self.table.ravel()]}

    def reading(
        self,
        pose: tuple[float, float, float],
        base: float,
        lights: Iterable[Light],
    ) -> float:
        """The reading of the sensor.

        Args:
            pose: x, y (m) and heading (rad) of the robot.
            base: Height of the robot's origin, m.
            lights: The lights.
        """
        at, axis = in_world(pose, base, self.place, self.axis)
        total = sum(light.irradiance(at, axis, self.colours) for light in lights)
        return float(np.interp(total, self.table[:, 0], self.table[:, 1]))


def standard_cells() -> tuple[LightCell, ...]:
    """The sensors ls0 to ls7: directions of ps0 to ps7, but horizontal."""
    table = np.array(_TABLE).reshape(-1, 3)
    return tuple(
        LightCell(
            f"ls{k}",
            np.array([x, y, _HEIGHT]),
            np.array([math.cos(azimuth), math.sin(azimuth), 0.0]),
            table,
            np.ones(3),
        )
        for k, (x, y, azimuth) in enumerate(PLACES.tolist())
    )


def read_cell(node: WbtNode, frame: NodeFrame) -> LightCell:
    """Reads a LightSensor.

    Args:
        node: The node.
        frame: Its frame relative to the robot.

    Raises:
        WorldError: A field is invalid.
    """
    axis = frame.matrix[:, 0]
    return LightCell(
        text(node, "name", "light sensor"),
        np.asarray(frame.origin),
        axis / max(float(np.linalg.norm(axis)), 1e-9),
        sorted_rows(lookup_table(node, _USUAL)),
        np.array(numbers(node, "colorFilter", (1.0, 1.0, 1.0))),
    )
