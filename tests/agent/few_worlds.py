"""A set of small worlds, and controllers that do well and badly on it."""

import re
from pathlib import Path

import yaml

import tdac_agent
from tdac_envs import load_set

KNOWN = Path(tdac_agent.__file__).parent / "builtin" / "levels" / "known.py"
QUICK = Path(__file__).with_name("quick_driver.py")
STILL_ANSWER = "```python\ndef policy(obs):\n    return 0.0, 0.0\n```\n"


def quick(**values):
    """A controller for a set of `write_wide_set` that takes little time.

    Its constants have given values, for example `GAIN=0.5`.
    """
    source = QUICK.read_text()
    for name, value in values.items():
        source = re.sub(rf"(?m)^{name} = .*$", f"{name} = {value}", source)
    return source


def half_of(solver):
    """A controller that reaches some goals."""
    return f"""{solver}

drive = policy


def policy(obs):
    return drive(obs) if int(obs["goal"][0]) % 2 else (0.0, 0.0)
"""


def write_short_set(path, steps=40, **values):
    """Writes a set of small worlds with episodes of so many steps; returns its path."""
    short = {"factor": 1.0, "least": steps, "most": steps}
    size = {"width": 220, "height": 180}
    worlds = [{"name": name, **size} for name in ("aisles", "clutter")]
    path.write_text(yaml.safe_dump({"worlds": worlds, "horizon": short, **values}))
    return path


def write_set(path, **values):
    """Writes a set whose level is that of `known`, with small worlds; returns its path.

    An episode takes 300 steps at most.
    """
    level = {
        "worlds": [{"name": "aisles", "width": 130, "height": 110}],
        "robot": load_set("known").file.robot.model_dump(),
        "frame": "map",
        "map": True,
        "admission": {"steps": 30},
        "horizon": {"factor": 5, "least": 100, "most": 300},
    }
    path.write_text(yaml.safe_dump({**level, **values}))
    return path


def write_wide_set(path, **values):
    """Writes a set like `write_set`, with rooms in which `quick` reaches all goals."""
    rooms = {"name": "rooms", "width": 150, "height": 130, "sides": [3.0, 6.0]}
    rooms |= {"doors": [2.0, 2.4], "furniture": 0.0}
    return write_set(path, worlds=[rooms], **values)
