"""Places and lengths of a map as a user types and reads them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tdac_envs.core.errors import MapError
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits

FREE = np.zeros((40, 80), np.bool_)
resolutions = st.sampled_from([0.01, 0.02, 0.05, 0.1, 0.25, 1.0, 3.0])
yaws = st.floats(-3.2, 3.2)


def metres(resolution=0.05, origin=(-1.0, 2.0, 0.0)):
    return MapUnits.metres(OccupancyGrid(FREE, resolution, origin))


def test_pixels_are_written_as_they_are():
    assert PIXELS.point(12, 40.5) == "(12, 40.5)"
    assert (PIXELS.length(12.5), PIXELS.length(12.5, 0)) == ("12.5 px", "12 px")
    assert PIXELS.at_most(7.39) == "7.3 px"


def test_metres_are_those_of_the_frame():
    """The corner of the lower-left pixel lies at the origin, (-1, 2) m."""
    units = metres()
    assert units.point(-0.5, 39.5) == "(-1, 2)"
    assert units.point(0, 39) == "(-0.975, 2.025)"
    assert (units.length(4), units.length(100.2, 0)) == ("0.2 m", "5.01 m")
    assert units.at_most(1.39) == "0.069 m"


def test_a_map_without_a_scale_has_no_metres():
    with pytest.raises(MapError, match="no resolution"):
        MapUnits.metres(OccupancyGrid(FREE))


@given(resolutions, yaws, st.integers(0, 79), st.integers(0, 39))
def test_what_is_written_names_the_same_pixel(resolution, yaw, x, y):
    """A place that a message advises can be typed again."""
    units = metres(resolution, (-7.14, 12.83, yaw))
    typed = tuple(map(float, units.point(x, y).strip("()").split(",")))
    assert units.pixels(typed) == pytest.approx((x, y), abs=0.2)


@given(resolutions, yaws, st.floats(-3, 3))
def test_headings_follow_the_axes_of_the_frame(resolution, yaw, heading):
    """A step along the heading in metres is a step along it in the picture."""
    units = metres(resolution, (3.0, -4.0, yaw))
    x, y = units.coordinates(10.0, 20.0)
    ahead = x + resolution * math.cos(heading), y + resolution * math.sin(heading)
    turned = units.heading_in_pixels(heading)
    there = 10.0 + math.cos(turned), 20.0 + math.sin(turned)
    assert units.pixels(ahead) == pytest.approx(there, abs=1e-6)


@given(resolutions, st.floats(0.1, 50))
def test_advised_lengths_are_never_too_large(resolution, length):
    units = metres(resolution)
    advised = float(units.at_most(length).removesuffix(" m"))
    assert units.length_in_pixels(advised) <= length + 1e-6
    assert units.length_in_pixels(advised) >= length - 0.11
