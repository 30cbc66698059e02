"""Drives a package's core and controller on recorded data, in any Python, without tdac.

    python replayed_drive.py PACKAGE NAME DRIVE.json

Prints the commands as JSON.
"""

import importlib
import json
import sys


def commands_of(core, layout, steps):
    """The commands of a core to data that were recorded.

    Args:
        core: The core.
        layout: Header of the scans.
        steps: Time, pose and ranges of each step; None for no return.
    """
    found = []
    for now, pose, ranges in steps:
        core.pose(now, *pose)
        core.scan(now, layout, [float("inf") if r is None else r for r in ranges])
        command = core.tick(now, 60.0)
        found.append([command.v, command.omega, command.state])
    return found


def main(package, name, file):
    """Prints the commands of a package to a recorded drive."""
    sys.path.insert(0, package)
    core, scans, worker = (
        importlib.import_module(f"{name}.{part}")
        for part in ("core", "scans", "worker")
    )
    with open(f"{package}/controller/settings.json", encoding="utf-8") as text:
        own = json.load(text)
    with open(file, encoding="utf-8") as text:
        drive = json.load(text)
    settings = core.Settings(
        dt=own["dt"], horizon=own["horizon"], start=tuple(own["start"]),
        goal=tuple(own["goal"]), goal_tolerance=own["goal_tolerance"],
        robot=own["robot"], dead_man=drive["dead_man"],
    )  # fmt: skip
    folder = worker.Path(package) / "controller"
    policy = worker.Worker(folder, own["controller_sha256"])
    layout = scans.Layout(*drive["layout"])
    print(json.dumps(commands_of(core.Core(settings, policy), layout, drive["steps"])))


if __name__ == "__main__":
    main(*sys.argv[1:])
