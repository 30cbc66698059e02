"""A part of planners: the distance sensors."""

import numpy as np

RANGE, RAYS = ROBOT["range_max"], ROBOT["n_rays"]
FAN = np.array(ROBOT["ray_angles"])  # rad from the heading, an even fan
FAN = np.where(np.abs(FAN) > math.pi, FAN - np.copysign(2.0 * math.pi, FAN), FAN)
ORDER = np.argsort(FAN)  # of the rays, from the left to the right
FAN = FAN[ORDER]
VIEW = max(float(FAN[-1] - FAN[0]), 1e-9)
SPIN = 2.0 * SPEED * DT / AXLE  # rad that the robot can turn in a step
