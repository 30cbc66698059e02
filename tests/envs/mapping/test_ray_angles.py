"""`RobotParams.ray_angles` and `tdac_envs.mapping.ray_angles`: where rays point."""

import json
import math

import numpy as np
import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.mapping.params import MapParams, RobotParams
from tdac_envs.mapping.ray_angles import faces, fan, is_round

OPEN = np.zeros((81, 81), bool)
SCAN = (0.0, 1.5, 3.0, -1.5)
"""Angles of a scanner that begins ahead of the robot."""


def params(**more):
    """Parameters of a map with a robot."""
    return MapParams(
        source="map.png",
        source_sha256="0",
        width=81,
        height=81,
        polarity="given",
        method="given",
        **more,
    )


@pytest.mark.parametrize("n_rays", [1, 2, 3, 18, 72])
@pytest.mark.parametrize("view", [1.0, 110.0, 180.0, 355.0, 359.9])
def test_a_fan_below_a_full_circle_has_a_ray_on_each_edge(view, n_rays):
    """Bit for bit as before full circles were different."""
    wide = math.radians(view)
    step = wide / (n_rays - 1) if n_rays > 1 else 0.0
    first = -0.5 * wide if n_rays > 1 else 0.0
    assert (fan(view, n_rays) == first + step * np.arange(n_rays)).all()


@pytest.mark.parametrize("n_rays", [2, 3, 36, 360])
def test_rays_of_a_full_circle_are_one_nth_apart(n_rays):
    """All gaps, also that from the last ray to the first, are 360°/n."""
    angles = fan(360.0, n_rays)
    gaps = np.diff(angles, append=angles[0] + math.tau)
    assert gaps == pytest.approx(math.tau / n_rays)
    assert is_round(angles)


def test_a_direction_is_faced_between_the_outermost_rays():
    """A fan of 110° faces 55° to each side; a full circle faces everything."""
    for bearing in (-54.9, 0.0, 54.9, 360.0):
        assert faces(fan(110.0, 18), math.radians(bearing))
    for bearing in (-56.0, 56.0, 180.0):
        assert not faces(fan(110.0, 18), math.radians(bearing))
        assert faces(fan(360.0, 36), math.radians(bearing))
        assert faces(fan(355.0, 72), math.radians(bearing))
    assert not is_round(fan(110.0, 1))


@pytest.mark.parametrize("frame", ["pixels", "metres"])
@pytest.mark.parametrize("angles", [None, SCAN])
def test_params_json_lists_the_angles_and_gives_them_back(frame, angles):
    """In metres they are counter-clockwise, as headings are."""
    robot = RobotParams(n_rays=4, ray_angles=angles)
    own = params(robot=robot, frame=frame, resolution=0.05)
    written = json.loads(json.dumps(own.written()))
    sign = 1 if frame == "pixels" else -1
    assert written["robot"]["ray_angles"] == pytest.approx(sign * robot.angles())
    assert MapParams.read(written).robot == robot


def test_params_without_angles_have_an_even_fan():
    """Files of earlier versions list none."""
    written = params(robot=RobotParams(n_rays=5, field_of_view_deg=90)).written()
    del written["robot"]["ray_angles"]
    angles = np.radians([-45, -22.5, 0, 22.5, 45])
    assert MapParams.read(written).robot.angles() == pytest.approx(angles)


@pytest.mark.parametrize("sensor", ["rays", "sonar"])
def test_the_env_looks_where_the_angles_say(sensor):
    """A block ahead, to the right, behind or to the left is seen by its ray alone."""
    for k, (x, y) in enumerate([(60, 40), (41, 60), (20, 43), (41, 20)]):
        cells = OPEN.copy()
        cells[y - 6 : y + 7, x - 6 : x + 7] = True
        env = Map2DEnv(
            cells, (40, 40, 0), (66, 66), robot_radius=4, range_max=30.0,
            ray_angles=SCAN, sensor=sensor, range_noise=0.0,
        )  # fmt: skip
        assert np.flatnonzero(env.reset()[0]["ranges"] < 29).tolist() == [k]


def test_the_env_gives_as_many_ranges_as_angles():
    """And says so if another number of rays is wanted."""
    ends = {"map": OPEN, "start": (40, 40), "goal": (66, 66), "robot_radius": 4}
    assert Map2DEnv(ray_angles=SCAN, **ends).reset()[0]["ranges"].shape == (4,)
    with pytest.raises(TaskError, match="expected n_rays = 3 numbers in ray_angles"):
        Map2DEnv(ray_angles=SCAN, n_rays=3, **ends)


def test_another_number_of_rays_or_view_stands_for_an_even_fan():
    """Angles of their own do not outlive the fan that they were for."""
    robot = RobotParams(n_rays=4, ray_angles=SCAN)
    assert robot.changed(radius=3.0, n_rays=4).ray_angles == SCAN
    assert robot.changed(n_rays=6).ray_angles is None
    assert robot.changed(field_of_view_deg=90.0).ray_angles is None
