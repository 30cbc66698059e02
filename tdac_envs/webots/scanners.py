"""The lidars and range finders of a robot: their properties and their ranges."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tdac_envs.core.compiled import read_only
from tdac_envs.epuck.prisms import Array
from tdac_envs.webots.mounts import Mount, unit_axes
from tdac_envs.webots.rays import scan
from tdac_envs.webots.scenery import Scenery
from tdac_envs.worlds.wbt.fields import flag, number, text
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.tree import WbtNode

MOST_RANGES = 1 << 20
"""Most values of a range image; devices with more are not modelled."""
LIDAR_TYPE, RANGE_FINDER_TYPE = 48, 55
"""Webots' numbers of the node types."""
_LEAST = 0.01
_PI = math.pi
# Widest fields of view, rad: of a spherical and of a plane projection.
_ALL_AROUND, _FLATTEST = 2.0 * _PI + 1e-3, _PI - 0.01
_LIDAR = {
    "horizontalResolution": 512.0, "numberOfLayers": 4.0, "fieldOfView": _PI / 2.0,
    "verticalFieldOfView": 0.2, "near": _LEAST, "minRange": _LEAST, "maxRange": 1.0,
    "noise": 0.0, "resolution": -1.0, "defaultFrequency": 10.0, "minFrequency": 1.0,
    "maxFrequency": 25.0, "tiltAngle": 0.0,
}  # fmt: skip
_FINDER = {
    "width": 64.0, "height": 64.0, "fieldOfView": _PI / 4.0, "near": _LEAST,
    "minRange": _LEAST, "maxRange": 1.0, "noise": 0.0, "resolution": -1.0,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Proto:
    """A PROTO of Webots' library with a Lidar: what differs from the node's defaults.

    Attributes:
        name: Device name.
        fields: Fields.
        is_rotating: Whether its head rotates.
    """

    name: str
    fields: Mapping[str, float]
    is_rotating: bool = False


# Fields in a world file that a PROTO passes on to its Lidar: `noise`.
_PROTOS = {
    "RobotisLds01": _Proto(
        "LDS-01",
        {
            "horizontalResolution": 360.0, "fieldOfView": 6.28318,
            "numberOfLayers": 1.0, "near": 0.07, "minRange": 0.12, "maxRange": 3.5,
            "noise": 0.0043,
        },
    ),
    "RpLidarA2": _Proto(
        "RPlidar A2",
        {
            "horizontalResolution": 800.0, "fieldOfView": 1.57,
            "numberOfLayers": 1.0, "near": 0.02, "minRange": 0.2, "maxRange": 12.0,
            "noise": 0.000833, "resolution": 0.01,
        },
        is_rotating=True,
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ScannerFacts:
    """A lidar or a range finder.

    Attributes:
        name: Device name.
        is_lidar: Whether it is a Lidar; else a RangeFinder.
        columns: Ranges in a row.
        rows: Rows: the layers of a lidar.
        field_of_view: Horizontal field of view, rad.
        vertical_field_of_view: Angle between the first and the last layer, rad; that
            of the image for a range finder.
        near: Distance from which surfaces are seen, m.
        min_range: Smallest range, m; what is nearer is seen but reported as inf.
        max_range: Largest range, m.
        noise: Standard deviation of the noise as a fraction of `max_range`.
        resolution: Step between ranges, m; not positive if there is none.
        frequencies: Frequency of a rotating head, its minimum and its maximum, Hz.
        tilt: Angle by which the layers are tilted upwards, rad.
        is_rotating: Whether it scans all around.
        is_spherical: Whether a range is the distance; else that along the forward
            axis.
        y_up: Whether its axes are those of Webots before R2022a: y up, -z forward.
        place: Shape (3,): position relative to the robot (forward, left, up), m.
        axes: Shape (3, 3): its forward, left and up directions as columns, in the
            robot's axes.
    """

    name: str
    is_lidar: bool
    columns: int
    rows: int
    field_of_view: float
    vertical_field_of_view: float
    near: float
    min_range: float
    max_range: float
    noise: float
    resolution: float
    frequencies: tuple[float, float, float]
    tilt: float
    is_rotating: bool
    is_spherical: bool
    y_up: bool
    place: Array
    axes: Array

    def plain(self) -> dict[str, object]:
        """The properties that are sent to the controller."""
        return {
            "width": self.columns,
            "height": self.rows,
            "fov": self.field_of_view,
            "vertical_fov": self.vertical_field_of_view,
            "min_range": self.min_range,
            "max_range": self.max_range,
            "frequencies": list(self.frequencies),
            "azimuths": self.azimuths.tolist() if self.is_lidar else [],
            "elevations": self.elevations.tolist() if self.is_lidar else [],
            "y_up": self.y_up,
        }

    @cached_property
    def azimuths(self) -> Array:
        """Shape (columns,): directions of the columns, rad, to the left of forward.

        As in Webots, a column is at the middle of its part of the field of view; the
        first column of a rotating lidar points backwards.
        """
        column = np.arange(self.columns, dtype=np.float64)
        if self.is_rotating:
            return -_PI - column * (2.0 * _PI / self.columns)
        return self.field_of_view * (0.5 - (column + 0.5) / self.columns)

    @cached_property
    def elevations(self) -> Array:
        """Shape (rows,): directions of the rows, rad, upwards from forward."""
        row, span = np.arange(self.rows, dtype=np.float64), self.vertical_field_of_view
        if self.is_lidar:
            share = 0.5 - row / (self.rows - 1) if self.rows > 1 else np.zeros(1)
            return self.tilt + span * share
        return (0.5 - (row + 0.5) / self.rows) * span

    @cached_property
    def directions(self) -> Array:
        """Shape (rows * columns, 3): directions of the rays in its own axes.

        The range along a ray is measured in the length of its direction.
        """
        up, left = np.meshgrid(self.elevations, self.azimuths, indexing="ij")
        if self.is_spherical:
            parts = np.cos(up) * np.cos(left), np.cos(up) * np.sin(left), np.sin(up)
        else:
            column, row = np.arange(self.columns), np.arange(self.rows)
            pixel = 2.0 * math.tan(self.field_of_view / 2.0) / self.columns
            aside = ((self.columns - 1) / 2.0 - column) * pixel
            above = ((self.rows - 1) / 2.0 - row) * pixel
            if self.is_lidar:
                above = np.tan(self.elevations)
            parts = np.ones_like(up), *np.meshgrid(aside, above)
        return np.stack(parts, axis=-1).reshape(-1, 3)

    def view(
        self,
        scenery: Scenery,
        place: Array,
        axes: Array,
        things: Array,
        random: np.random.Generator | None,
    ) -> bytes:
        """The ranges, 4 bytes each, row by row; see `views.Viewer`."""
        ranges = self.ranges(scenery, place, axes, things)
        if random is not None and self.noise > 0.0:
            spread = self.noise * self.max_range
            ranges += spread * random.standard_normal(len(ranges))
        if self.resolution > 0.0:
            ranges = np.round(ranges / self.resolution) * self.resolution
        outside = (ranges < self.min_range) | (ranges > self.max_range)
        return np.where(outside, np.inf, ranges).astype("<f4").tobytes()

    def ranges(
        self, scenery: Scenery, place: Array, axes: Array, things: Array
    ) -> Array:
        """Shape (rows * columns,): exact ranges, m; inf where nothing is seen."""
        ranges = np.empty(self.rows * self.columns)
        directions = self.directions @ axes.T
        # Noise may lower a range that is slightly too large.
        longest = self.max_range * (1.0 + 4.0 * self.noise)
        scan(
            *scenery.at(things).arrays(),
            read_only(place),
            read_only(directions),
            self.near,
            longest,
            ranges,
        )
        return ranges


def find_scanners(mounted: Iterable[Mount]) -> tuple[ScannerFacts, ...]:
    """The lidars and range finders of an e-puck that are modelled.

    Args:
        mounted: Nodes in its slots, or in the Robot node.

    Raises:
        WorldError: A field is invalid.
    """
    found: dict[str, ScannerFacts] = {}
    for node, frame in mounted:
        scanner: ScannerFacts | None = None
        if node.kind == "RangeFinder":
            scanner = _finder(node, frame)
        elif node.kind == "Lidar" or node.kind in _PROTOS:
            scanner = _lidar(node, frame)
        if scanner is not None and scanner.rows * scanner.columns <= MOST_RANGES:
            found.setdefault(scanner.name, scanner)
    return tuple(found.values())


def _lidar(node: WbtNode, frame: NodeFrame) -> ScannerFacts:
    proto = _PROTOS.get(node.kind, _Proto("lidar", {}))
    usual = {**_LIDAR, **proto.fields}
    own = ("noise",) if node.kind in _PROTOS else tuple(_LIDAR)
    values = {
        name: number(node, name, value) if name in own else value
        for name, value in usual.items()
    }
    name = text(node, "name", proto.name)
    is_rotating = proto.is_rotating or text(node, "type").lower().startswith("r")
    is_spherical = is_rotating or flag(node, "spherical", True)
    return ScannerFacts(
        name=name,
        is_lidar=True,
        columns=_count(values, usual, "horizontalResolution"),
        rows=_count(values, usual, "numberOfLayers"),
        field_of_view=_angle(values, usual, is_spherical),
        vertical_field_of_view=min(
            _positive(values, usual, "verticalFieldOfView"), _PI
        ),
        **_ranging(values, usual),
        frequencies=(
            values["defaultFrequency"], values["minFrequency"], values["maxFrequency"],
        ),
        tilt=values["tiltAngle"],
        is_rotating=is_rotating,
        is_spherical=is_spherical,
        y_up=frame.y_up,
        place=frame.origin,
        axes=unit_axes(node, frame, f"the device {name!r}"),
    )  # fmt: skip


def _finder(node: WbtNode, frame: NodeFrame) -> ScannerFacts:
    values = {name: number(node, name, value) for name, value in _FINDER.items()}
    name = text(node, "name", "range-finder")
    columns = _count(values, _FINDER, "width")
    rows = _count(values, _FINDER, "height")
    is_spherical = flag(node, "spherical", False)
    angle = _angle(values, _FINDER, is_spherical)
    vertical = angle * rows / columns
    if not is_spherical:
        vertical = 2.0 * math.atan(math.tan(angle / 2.0) * rows / columns)
    return ScannerFacts(
        name=name,
        is_lidar=False,
        columns=columns,
        rows=rows,
        field_of_view=angle,
        vertical_field_of_view=vertical,
        **_ranging(values, _FINDER),
        frequencies=(0.0, 0.0, 0.0),
        tilt=0.0,
        is_rotating=False,
        is_spherical=is_spherical,
        y_up=frame.y_up,
        place=frame.origin,
        axes=unit_axes(node, frame, f"the device {name!r}"),
    )


# Invalid fields are replaced as in Webots.
def _ranging(
    values: Mapping[str, float], usual: Mapping[str, float]
) -> dict[str, float]:
    """Near plane, limits and errors of the ranges, by attribute."""
    least, most = _positive(values, usual, "minRange"), values["maxRange"]
    return {
        "near": min(_positive(values, usual, "near"), least),
        "min_range": least,
        "max_range": most if most > least else least + 1.0,
        "noise": max(values["noise"], 0.0),
        "resolution": values["resolution"],
    }


def _angle(
    values: Mapping[str, float], usual: Mapping[str, float], is_spherical: bool
) -> float:
    angle = values["fieldOfView"]
    widest = _ALL_AROUND if is_spherical else _FLATTEST
    return angle if 0.0 < angle <= widest else usual["fieldOfView"]


def _positive(
    values: Mapping[str, float], usual: Mapping[str, float], name: str
) -> float:
    return values[name] if values[name] > 0.0 else usual[name]


def _count(values: Mapping[str, float], usual: Mapping[str, float], name: str) -> int:
    return max(int(_positive(values, usual, name)), 1)
