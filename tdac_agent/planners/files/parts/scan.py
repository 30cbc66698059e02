"""A part of planners: the distance sensors."""

import numpy as np

RANGE, RAYS = ROBOT["range_max"], ROBOT["n_rays"]
FAN = np.array(ROBOT["ray_angles"])  # rad from the heading, an even fan
FAN = np.where(np.abs(FAN) > math.pi, FAN - np.copysign(2.0 * math.pi, FAN), FAN)
ORDER = np.argsort(FAN)  # of the rays, from the left to the right
FAN = FAN[ORDER]
VIEW = max(float(FAN[-1] - FAN[0]), 1e-9)
OFFSET = ROBOT.get("scanner_offset") or (0.0, 0.0)
"""Where the rays start, from the robot's centre: ahead, and to positive angles, px."""
SPIN = 2.0 * SPEED * DT / AXLE  # rad that the robot can turn in a step


def scanner_at(pose):
    """The place where the rays start."""
    cosine, sine = math.cos(pose.heading), math.sin(pose.heading)
    ahead, aside = OFFSET
    x = pose.x + ahead * cosine - aside * sine
    return x, pose.y + ahead * sine + aside * cosine


def from_centre(ranges):
    """Distances and bearings of what the rays hit, from the robot's centre."""
    if not any(OFFSET):
        return ranges, FAN
    hit = ranges < RANGE - 1e-3
    x = OFFSET[0] + ranges * np.cos(FAN)
    y = OFFSET[1] + ranges * np.sin(FAN)
    far = np.minimum(np.hypot(x, y), RANGE - 2e-3)
    return np.where(hit, far, RANGE), np.where(hit, np.arctan2(y, x), FAN)
