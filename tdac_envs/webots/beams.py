"""Distance sensors that a world file mounts on the robot, and those of its PROTO.

A sensor measures along one ray, whatever its aperture and number of rays. The ray can
hit the visible parts of the world and the floor. An infra-red sensor measures the
distance divided by the reflectance of the surface, as in Webots; on a textured floor,
the image determines the reflectance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tdac_envs.epuck.infrared import ELEVATION, TABLE
from tdac_envs.epuck.prisms import FACTOR, Array, Prisms
from tdac_envs.webots.floors import Floors
from tdac_envs.webots.mounts import in_world, lookup_table, sorted_rows
from tdac_envs.webots.rays import nearest_hit
from tdac_envs.worlds.wbt.fields import number, text
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.tree import WbtNode

TYPES = {"generic": 0, "infra-red": 1, "sonar": 2, "laser": 3}
_USUAL = (0.0, 0.0, 0.0, 0.1, 1000.0, 0.0)
_TOF = (
    0.0, 19.8, 0.126, 0.05, 58.5, 0.032, 0.1, 111.0, 0.019, 0.2, 218.9, 0.009,
    0.5, 531.9, 0.007, 1.0, 1052.0, 0.010, 1.7, 1780.5, 0.013, 2.0, 2000.0, 0.0,
)  # fmt: skip
_TOF_PLACE, _TOF_APERTURE = (0.034, -0.0018, 0.033), 0.44
_GROUND = (0.0, 1000.0, 0.002, 0.016, 300.0, 0.004)
_GROUND_PLACES = ((0.03, 0.01, 0.003), (0.03, 0.0, 0.003), (0.03, -0.01, 0.003))
_AHEAD, _DOWN = (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
_LONGEST = 1e3
"""Length of a ray if the table has no larger distance, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Beam:
    """A distance sensor.

    Attributes:
        name: Device name.
        place: Position relative to the robot: forward, left, up, m, shape (3,).
        direction: Direction of its ray in these axes, of length 1, shape (3,).
        table: Shape (n, 3): distance, m; reading; relative noise.
        kind: Webots' type: `generic`, `infra-red`, `sonar` or `laser`.
        aperture: Aperture that the file gives, rad.
    """

    name: str
    place: Array
    direction: Array
    table: Array
    kind: str
    aperture: float

    @property
    def is_infrared(self) -> bool:
        """Whether it measures reflected light."""
        return self.kind == "infra-red"

    @property
    def looks_down(self) -> bool:
        """Whether it points down, at less than 60 degrees from the vertical."""
        return bool(self.direction[2] < -0.5)

    def plain(self) -> dict[str, object]:
        """The facts that are sent to the controller."""
        return {
            "table": [float(value) for value in self.table.ravel()],
            "aperture": self.aperture,
            "type": TYPES[self.kind],
        }


def time_of_flight() -> Beam:
    """The sensor `tof` of an e-puck 2."""
    return _beam("tof", _TOF_PLACE, _AHEAD, _TOF, "generic", _TOF_APERTURE)


def ground_sensors() -> tuple[Beam, ...]:
    """The sensors gs0 to gs2 of the PROTO E-puckGroundSensors."""
    return tuple(
        _beam(f"gs{k}", place, _DOWN, _GROUND, "infra-red", 0.1)
        for k, place in enumerate(_GROUND_PLACES)
    )


def read_beam(node: WbtNode, frame: NodeFrame) -> Beam:
    """Reads a DistanceSensor, or the PROTO E-puckDistanceSensor.

    Args:
        node: The node.
        frame: Its frame relative to the robot.

    Raises:
        WorldError: A field is invalid.
    """
    if node.kind == "E-puckDistanceSensor":
        name, kind, aperture = text(node, "name", "ds"), "infra-red", 0.1
        table = tuple(TABLE.ravel().tolist())
        frame = frame.inside(rotation=(0.0, 0.0, 1.0, ELEVATION))
    else:
        name = text(node, "name", "distance sensor")
        kind = text(node, "type", "generic")
        kind = kind if kind in TYPES else "generic"  # as in Webots
        aperture = number(node, "aperture", 1.5708)
        table = lookup_table(node, _USUAL)
    ahead = frame.matrix[:, 0]
    length = float(np.linalg.norm(ahead))
    direction = tuple((ahead / length).tolist()) if length > 0.0 else _AHEAD
    place = tuple(frame.origin.tolist())
    return _beam(name, place, direction, table, kind, aperture)


def _beam(
    name: str,
    place: tuple[float, ...],
    direction: tuple[float, ...],
    table: tuple[float, ...],
    kind: str,
    aperture: float,
) -> Beam:
    at, way = np.array(place), np.array(direction)
    return Beam(name, at, way, sorted_rows(table), kind, aperture)


def reading(
    beam: Beam,
    pose: tuple[float, float, float],
    base: float,
    floor: float,
    seen: Prisms,
    floors: Floors,
) -> float:
    """The reading of a sensor, without noise.

    Args:
        beam: The sensor.
        pose: x, y (m) and heading (rad) of the robot.
        base: Height of the robot's origin, m.
        floor: Height of the ground, m.
        seen: Visible parts of the world.
        floors: Textured floors; their images determine the reflectance.
    """
    at, way = in_world(pose, base, beam.place, beam.direction)
    longest = float(beam.table[-1, 0]) or _LONGEST
    ray = (*at.tolist(), *way.tolist(), longest)
    distance, part = nearest_hit(*seen.arrays(), *ray)
    factor, height = 1.0, at[2] - floor
    if part >= 0:
        factor = float(seen.extent[part, FACTOR])
    elif way[2] < 0.0 and height >= 0.0 and -height / way[2] <= longest:
        distance = float(-height / way[2])
    else:
        return float(beam.table[-1, 1])
    if beam.is_infrared and way[2] < 0.0:
        painted = floors.reflectance(*(at + distance * way).tolist())
        factor = factor if painted is None else painted
    measured = distance / factor if beam.is_infrared else distance
    return float(np.interp(measured, beam.table[:, 0], beam.table[:, 1]))
