"""Lidars and range finders."""

from __future__ import annotations

import math
import struct
from array import array
from typing import Any

from .calls import getters, lacking
from .connection import c_double, connection
from .messages import complain
from .viewing import ViewingSensor

_POINT = struct.Struct("=fffif")


class LidarPoint:
    """A point of a lidar's point cloud.

    Args:
        data: Points in Webots' binary format.
        offset: Number of the point.

    Attributes:
        x: Coordinates in the lidar's axes, m; infinite if nothing was hit.
        y: See `x`.
        z: See `x`.
        layer: Number of the layer; also `layer_id`.
        time: Time of the sample, s.
    """

    def __init__(self, data: bytes | bytearray, offset: int) -> None:
        self.x, self.y, self.z, self.layer, self.time = _POINT.unpack_from(
            data, offset * _POINT.size
        )

    @property
    def layer_id(self) -> int:
        """Number of the layer."""
        return int(self.layer)


@getters("fov", "min_range", "max_range")
class _Ranging(ViewingSensor):
    @property
    def min_range(self) -> float:
        """Smallest range, m."""
        return float(self._facts.get("min_range", math.nan))

    @property
    def max_range(self) -> float:
        """Largest range, m."""
        return float(self._facts.get("max_range", math.nan))

    @property
    def range_image(self) -> list[float] | None:
        """See `getRangeImage`."""
        return self._ranges("get_range_image")

    def _ranges(self, getter: str) -> list[float] | None:
        data = self._last(getter)
        return None if data is None else array("f", data).tolist()

    def _rows(self) -> list[list[float]] | None:
        ranges, width = self._ranges("get_range_image"), self.width
        if ranges is None:
            return None
        return [ranges[k : k + width] for k in range(0, len(ranges), width)]


@getters(
    "horizontal_resolution",
    "number_of_layers",
    "number_of_points",
    "vertical_fov",
    "frequency",
    "min_frequency",
    "max_frequency",
    isPointCloudEnabled="_has_cloud",
)
class Lidar(_Ranging):
    """Measures distances along rays in one or more layers."""

    _c_name = "lidar"

    def __init__(self, name: str, sampling_period: int | None = None) -> None:
        super().__init__(name, sampling_period)
        self._has_cloud = False
        self._frequency, self._min_frequency, self._max_frequency = self._facts.get(
            "frequencies", [math.nan] * 3
        )

    def getRangeImage(self) -> list[float] | None:
        """Distances, m, from left to right, layer by layer from the top one.

        A distance beyond the smallest or the largest range is inf. All are 0 before the
        first sample. The result is None before the first step, and None with an error
        if the lidar is disabled.
        """
        return self.range_image

    def getRangeImageArray(self) -> list[list[float]] | None:
        """The distances as one list for each layer; None as in `getRangeImage`."""
        return self._rows()

    def getLayerRangeImage(self, layer: int) -> list[float] | None:
        """The distances of a layer, from 0; None with an error if there is none."""
        if not self._is_layer("get_layer_range_image", layer):
            return None
        ranges = self._ranges("get_layer_range_image")
        width = self.width
        return None if ranges is None else ranges[layer * width : (layer + 1) * width]

    def enablePointCloud(self) -> None:
        """Enables `getPointCloud`."""
        self._has_cloud = True

    def disablePointCloud(self) -> None:
        """Disables `getPointCloud`."""
        self._has_cloud = False

    def getPointCloud(self, data_type: str = "list") -> Any:
        """The points in the lidar's axes, in the order of the range image.

        Args:
            data_type: `list` for `LidarPoint`s, `buffer` for a bytearray of Webots'
                structure: x, y, z (float), layer (int), time (float), 20 bytes each.

        Returns:
            The points; none, with an error, if the point cloud is disabled.
        """
        return self._cloud("get_point_cloud", range(self.height), data_type)

    def getLayerPointCloud(self, layer: int, data_type: str = "list") -> Any:
        """The points of a layer, from 0; see `getPointCloud`."""
        getter = "get_layer_point_cloud"
        layers = range(layer, layer + 1) if self._is_layer(getter, layer) else range(0)
        return self._cloud(getter, layers, data_type)

    def setFrequency(self, frequency: float) -> None:
        """Stores the frequency; no effect: each sample is a full turn."""
        self.frequency = frequency

    @property
    def horizontal_resolution(self) -> int:
        """Number of rays in a layer."""
        return self.width

    @property
    def number_of_layers(self) -> int:
        """Number of layers."""
        return self.height

    @property
    def number_of_points(self) -> int:
        """Number of points; 0, with an error, if the point cloud is disabled."""
        if not self._gives_cloud("get_number_of_points"):
            return 0
        return self.width * self.height

    @property
    def vertical_fov(self) -> float:
        """Angle between the first and the last layer, rad."""
        return float(self._facts.get("vertical_fov", math.nan))

    @property
    def min_frequency(self) -> float:
        """Smallest frequency, Hz."""
        return float(self._min_frequency)

    @property
    def max_frequency(self) -> float:
        """Largest frequency, Hz."""
        return float(self._max_frequency)

    @property
    def frequency(self) -> float:
        """Frequency of a rotating head, Hz; see `setFrequency`."""
        return float(self._frequency)

    @frequency.setter
    def frequency(self, frequency: float) -> None:
        frequency = c_double(frequency)
        least, most = self.min_frequency, self.max_frequency
        if least <= frequency <= most:
            self._frequency = frequency
        else:
            complain(
                f"Error: wb_lidar_set_frequency() out of frequency range [{least:f}, "
                f"{most:f}]."
            )

    def _is_layer(self, getter: str, layer: int) -> bool:
        if 0 <= layer < self.height:
            return True
        why = "a negative 'layer' argument."
        if layer >= 0:
            why = (
                f"a 'layer' argument ({layer}) bigger or equal to the number of layers "
                f"of this lidar ({self.height})."
            )
        complain(f"Error: wb_lidar_{getter}() called with {why}")
        return False

    def _gives_cloud(self, getter: str) -> bool:
        if not self._has_cloud:
            complain(
                f"Error: wb_lidar_{getter}() called for a lidar with point cloud "
                "disabled. Please use: wb_lidar_enable_point_cloud()."
            )
        return self._has_cloud and self._sample(getter, True) is not None

    def _cloud(self, getter: str, layers: range, data_type: str) -> Any:
        ranges = self._ranges(getter) if self._gives_cloud(getter) else None
        data, y_up = bytearray(), self._facts.get("y_up", False)
        for layer in layers if ranges is not None else ():
            elevation = self._facts["elevations"][layer]
            for column, azimuth in enumerate(self._facts["azimuths"]):
                distance = ranges[layer * self.width + column] if ranges else 0.0
                flat = distance * math.cos(elevation)
                forward, left = flat * math.cos(azimuth), flat * math.sin(azimuth)
                up = distance * math.sin(elevation) if elevation else 0.0
                axes = (-left, up, -forward) if y_up else (forward, left, up)
                data += _POINT.pack(*axes, layer, connection.time)
        if data_type == "buffer":
            return data
        return [LidarPoint(data, k) for k in range(len(data) // _POINT.size)]


@getters("width", "height")
@lacking(saveImage=-1)
class RangeFinder(_Ranging):
    """A depth camera."""

    _c_name = "range_finder"

    def getRangeImage(self, data_type: str = "list") -> Any:
        """Depths along the forward axis, m, row by row from the upper left pixel.

        A depth beyond the smallest or the largest range is inf. All are 0 before the
        first sample. The result is None before the first step, and None with an error
        if the range finder is disabled.

        Args:
            data_type: `list`, or `buffer` for bytes of floats.
        """
        if data_type == "buffer":
            return self._last("get_range_image")
        return self.range_image

    def getRangeImageArray(self) -> list[list[float]] | None:
        """The depths as one list for each row; None as in `getRangeImage`."""
        return self._rows()

    @staticmethod
    def rangeImageGetDepth(image: list[float], width: int, x: int, y: int) -> float:
        """Depth of a pixel of a range image."""
        return image[y * width + x]
