"""Controllers get ranges of lidars and range finders as from Webots."""

import math

import pytest
from worlds_for_controllers import ARENA, HEAD, epuck

BEGIN = """
import math
from controller import Lidar, RangeFinder, Robot
robot = Robot()
lidar, finder = robot.getDevice("lidar"), robot.getDevice("range-finder")
"""
DEVICES = """Lidar { translation 0.0095 0 0 maxRange 3 %s }
RangeFinder { translation 0.0095 0 0 maxRange 3 width 6 height 4 }
"""


def world(more):
    """A world whose e-puck is in the middle and looks along x."""
    slots = epuck("0 0 0").replace("GPS { }", DEVICES % more)
    return HEAD + ARENA + slots


TWO = world("numberOfLayers 2 horizontalResolution 36 fieldOfView 3 tiltAngle 0.1")


@pytest.fixture
def printed(drive):
    """Runs lines after a usual beginning; gives what they print, line by line."""

    def run(lines, content=TWO, **more):
        report = drive(BEGIN + lines, content, **{"steps": 20, **more}).report
        assert report.error is None, (report.error, report.traceback, report.output)
        return report.output.splitlines()

    return run


def test_formats_of_ranges_agree(printed):
    """One list, one list for each layer or row, and single layers."""
    out = printed(
        "lidar.enable(32); finder.enable(32); robot.step(32)\n"
        "flat, layers = lidar.getRangeImage(), lidar.getRangeImageArray()\n"
        "print(type(flat).__name__, len(flat), [len(x) for x in layers])\n"
        "print(sum(layers, []) == flat == lidar.range_image)\n"
        "print([lidar.getLayerRangeImage(k) for k in (0, 1)] == layers)\n"
        "depths, rows = finder.getRangeImage(), finder.getRangeImageArray()\n"
        "print(len(depths), [len(x) for x in rows], sum(rows, []) == depths)\n"
        "print(finder.rangeImageGetDepth(depths, 6, 2, 1) == rows[1][2], "
        "len(finder.getRangeImage(data_type='buffer')))\n"
        "print(lidar.getNodeType(), finder.getNodeType())\n"
    )
    assert out == [
        "list 72 [36, 36]",
        "True",
        "True",
        "24 [6, 6, 6, 6] True",
        "True 96",
        "48 55",
    ]


def test_ranges_are_those_of_the_world(printed):
    """The wall at x = 0.7 for the range finder; the floor for what looks down."""
    out = printed(
        "finder.enable(32); robot.step(32)\n"
        "rows = finder.getRangeImageArray()\n"
        "print(rows[2][2:4]); print(rows[3])\n"
    )
    pixel = 2.0 * math.tan(math.pi / 8) / 6
    depth = min(0.7, 0.0486 / (0.5 * pixel))
    assert eval(out[0]) == pytest.approx([depth] * 2, rel=1e-5)
    assert eval(out[1]) == pytest.approx([0.0486 / (1.5 * pixel)] * 6, rel=1e-5)


def test_facts_of_the_file(printed):
    """Sizes, angles, ranges and frequencies; a frequency out of range is refused."""
    out = printed(
        "print(lidar.getHorizontalResolution(), lidar.getNumberOfLayers(),\n"
        "      lidar.getFov(), lidar.getVerticalFov(), lidar.getMinRange(),\n"
        "      lidar.getMaxRange())\n"
        "print(finder.getWidth(), finder.getHeight(), finder.getMaxRange())\n"
        "lidar.setFrequency(20); lidar.frequency = 30.0\n"
        "print(lidar.getFrequency(), lidar.getMinFrequency(),"
        " lidar.getMaxFrequency())\n"
    )
    assert out == [
        "36 2 3.0 0.2 0.01 3.0",
        "6 4 3.0",
        "Error: wb_lidar_set_frequency() out of frequency range [1.000000, 25.000000].",
        "20.0 1.0 25.0",
    ]


def test_before_the_first_sample_and_disabled(printed):
    """None before the first step, then zeros, then ranges; None when disabled."""
    out = printed(
        "lidar.enable(64)\n"
        "print(lidar.getRangeImage())\n"
        "robot.step(32); print(set(lidar.getRangeImage()))\n"
        "robot.step(32); print(min(lidar.getRangeImage()) > 0.0)\n"
        "lidar.disable(); print(lidar.getRangeImage())\n"
    )
    error = (
        "Error: wb_lidar_get_range_image() called for a disabled device! Please use: "
        "wb_lidar_enable()."
    )
    assert out == ["None", "{0.0}", "True", error, "None"]


def test_a_point_cloud_is_where_the_walls_are(printed):
    """Each point is its range away, in the direction of its ray, with its layer."""
    out = printed(
        "lidar.enable(32); lidar.enablePointCloud(); robot.step(32)\n"
        "points, ranges = lidar.getPointCloud(), lidar.getRangeImage()\n"
        "print(len(points), lidar.getNumberOfPoints(), lidar.isPointCloudEnabled())\n"
        "far = [abs(math.hypot(p.x, p.y, p.z) - r) for p, r in zip(points, ranges)\n"
        "       if r < 9]\n"
        "print(max(far) < 1e-6, [p.layer_id for p in points[35:37]],"
        " round(points[0].time, 3))\n"
        "walls = [min(abs(abs(p.x) - 0.7), abs(abs(p.y) - 0.5), abs(p.z + 0.0486))\n"
        "         for p in points if p.z < 0.05]\n"
        "print(len(walls) > 30, max(walls) < 1e-5, points[0].y > 0 > points[35].y)\n"
        "layer = lidar.getLayerPointCloud(1)\n"
        "print([p.x for p in layer] == [p.x for p in points[36:]],"
        " len(lidar.getPointCloud('buffer')))\n"
        "print(lidar.getLayerPointCloud(2), lidar.getLayerRangeImage(-1))\n"
    )
    assert out == [
        "72 72 True",
        "True [0, 1] 0.032",
        "True True True",
        "True 1440",
        "Error: wb_lidar_get_layer_point_cloud() called with a 'layer' argument (2) "
        "bigger or equal to the number of layers of this lidar (2).",
        "Error: wb_lidar_get_layer_range_image() called with a negative 'layer' "
        "argument.",
        "[] None",
    ]


def test_no_point_cloud_unless_enabled(printed):
    """An error, and no points."""
    out = printed(
        "lidar.enable(32); robot.step(32)\n"
        "print(lidar.getPointCloud(), lidar.getNumberOfPoints())\n"
        "lidar.enablePointCloud(); lidar.disablePointCloud()\n"
        "print(lidar.isPointCloudEnabled())\n"
    )
    error = (
        "Error: wb_lidar_{}() called for a lidar with point cloud disabled. Please "
        "use: wb_lidar_enable_point_cloud()."
    )
    calls = "get_point_cloud", "get_number_of_points"
    assert out == [*map(error.format, calls), "[] 0", "False"]


def test_made_by_its_class(printed):
    """The old way: by name, with its period."""
    out = printed(
        "made = Lidar('lidar', 32); robot.step(32)\n"
        "print(made.sampling_period, len(made.getRangeImage()))\n"
        "print(Lidar('nose').getFov())\n"
    )
    assert out == [
        "32 72",
        'Device "nose" was not found on robot "e-puck"',
        "nan",
    ]
