"""A part of planners: the distance sensors."""

import numpy as np

RANGE, RAYS = ROBOT["range_max"], ROBOT["n_rays"]
VIEW = math.radians(ROBOT["field_of_view_deg"])
FAN = np.linspace(-VIEW / 2.0, VIEW / 2.0, RAYS)
SPIN = 2.0 * SPEED * DT / AXLE  # rad that the robot can turn in a step
