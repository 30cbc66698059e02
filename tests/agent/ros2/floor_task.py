"""A small task in metres with a robot of its own, and a policy that answers at once."""

import numpy as np
import yaml

from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.mapping.ros_writer import write_ros_map

ROBOT = {
    "schema": 1,
    "radius": 0.1,
    "axle_length": 0.16,
    "limits": {
        "max_wheel_speed": 0.3,
        "max_speed": 0.3,
        "max_acceleration": 3.0,
        "max_turn_rate": 3.0,
    },
    "scanner": {
        "rays": 60,
        "first_angle": 0.0,
        "direction": "counter-clockwise",
        "range_min": 0.1,
        "range_max": 3.0,
        "below_min": "zero",
        "noise": 0.01,
        "offset": [-0.03, 0.0],
    },
    "pose": {"source": "test"},
    "control_rate": 10,
    "stopping_distance": 0.045,
}


def robot_file(**changes):
    """A robot file whose figures are all assumed."""
    own = {**ROBOT, **changes}
    about = {"schema", "name", "drives", "units"}
    keys = []
    for key, value in own.items():
        if key in about:
            continue
        parts = value if isinstance(value, dict) else {"": 0}
        keys += [f"{key}.{part}".rstrip(".") for part in parts]
    return {**own, "sources": dict.fromkeys(keys, "assumed")}


def write_task(folder, **changes):
    """A task in metres: around a wall from the left to the right."""
    cells = np.ones((40, 60), np.bool_)
    cells[2:-2, 2:-2] = False
    cells[14:, 28:31] = True
    write_ros_map(folder, OccupancyGrid(cells, 0.05), 0.05, (-1.0, -1.0, 0.0))
    (folder / "robot.yaml").write_text(yaml.safe_dump(robot_file()))
    spec = {
        "name": "floor",
        "map": "map.yaml",
        "frame": "metres",
        "profile": "policy",
        "robot": "robot.yaml",
        "start": [-0.5, -0.5, 1.5],
        "goal": [1.5, -0.4],
        **changes,
    }
    (folder / "task.yaml").write_text(yaml.safe_dump(spec))
    return folder / "task.yaml"


class Ready:
    """A policy that is asked and answers at once, unless it is told to wait.

    Attributes:
        observations: What it was asked.
        waits: Whether it does not answer yet.
    """

    def __init__(self, policy):
        self.policy, self.observations, self.waits = policy, [], False

    def ask(self, observation):
        self.observations.append(observation)

    def answer(self, wait):
        return None if self.waits else self.policy(self.observations[-1])


def forward(observation):
    """Full speed ahead."""
    return "action", (1.0, 1.0)


def see(core, robot, now, scan=True, pose=True):
    """Gives the core what the robot's sensors say."""
    reading = robot.read()
    if pose:
        core.pose(now, *reading.pose)
    if scan:
        core.scan(now, robot.layout, reading.ranges)


def drive(core, robot, seconds, see=see, wait=0.0):
    """Drives in control periods; returns the commands."""
    commands = []
    for _ in range(round(seconds / robot.dt)):
        now = robot.time
        see(core, robot, now)
        commands.append(core.tick(now, wait))
        robot.obey(commands[-1].v, commands[-1].omega)
        robot.step()
    return commands
