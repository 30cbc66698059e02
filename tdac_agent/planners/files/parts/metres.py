"""A part of planners on sets in metres: what they read and observe, in pixels.

Planners use px, with y down and turns to the right positive. Sets in metres have y up
and turns to the left positive. The wheels' shares of full speed are the same in both.
"""

import json

import numpy as np

with open("params.json") as file:
    METRES = json.load(file)
PIXEL = METRES["resolution"]  # m
CORNER = 0.0, 0.0
"""The origin of the set's frame in that of a planner, px."""
if METRES["map"]:
    CORNER = -0.5, np.load("occupancy.npy").shape[0] - 0.5
NEAREST = METRES["robot"].get("range_min", 0.0)  # m; what is nearer may read 0
LENGTHS = (
    *("radius", "axle_length", "max_wheel_speed", "range_max", "range_min"),
    *("max_speed", "max_acceleration", "stopping_distance", "pose_noise"),
)
"""Keys of the robot and of the disturbances whose values are lengths."""


def with_lengths(part):
    """A section of `params.json` with its lengths in px."""
    own = {key: part[key] / PIXEL for key in LENGTHS if key in part}
    return {**part, **own}


def in_pixels(params):
    """What `params.json` tells, in px and with angles to the right."""
    robot = with_lengths(params["robot"])
    robot["ray_angles"] = [0.0 - angle for angle in robot["ray_angles"]]
    ahead, aside = robot.get("scanner_offset") or (0.0, 0.0)
    robot["scanner_offset"] = ahead / PIXEL, 0.0 - aside / PIXEL
    return {
        **params,
        "robot": robot,
        "goal_tolerance": params["goal_tolerance"] / PIXEL,
        "disturbances": with_lengths(params["disturbances"]),
    }


def place(x, y):
    """A place in m, in px."""
    return CORNER[0] + float(x) / PIXEL, CORNER[1] - float(y) / PIXEL


def seen(obs):
    """An observation in px."""
    own = {**obs, "goal": place(*obs["goal"])}
    if "ranges" in obs:
        # A range of 0 means that something is too near.
        own["ranges"] = np.maximum(np.asarray(obs["ranges"], float), NEAREST) / PIXEL
    if "pose" in obs:
        own["pose"] = *place(*obs["pose"][:2]), 0.0 - float(obs["pose"][2])
    if "odometry" in obs:
        length, turn = (float(value) for value in obs["odometry"])
        own["odometry"] = length / PIXEL, 0.0 - turn
    return own


def by_pixels(drive):
    """`reset` or `policy`, which gets its observations in px."""
    return lambda obs: drive(seen(obs))
