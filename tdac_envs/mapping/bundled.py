"""The maps that ship with the package: an image and a task file each."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from tdac_envs.core.errors import MapError, hint

_FOLDER = Path(__file__).parent / "maps"


@dataclass(frozen=True, slots=True)
class BundledMap:
    """A map image with a start, a goal and a robot that make a task on it.

    Attributes:
        name: Name for the `map` argument of the environment.
        image: The PNG file.
        start: Start (x, y), px.
        heading: Heading at the start, rad, from +x towards +y (down).
        goal: Goal (x, y), px.
        robot_radius: Body radius, px.
        description: One line about the place and the difficulty.
    """

    name: str
    image: Path
    start: tuple[float, float]
    heading: float
    goal: tuple[float, float]
    robot_radius: float
    description: str


def bundled_maps() -> tuple[str, ...]:
    """Names of the bundled maps: the default one first, the others sorted."""
    names = {path.stem for path in _FOLDER.glob("*.json")}
    return ("maze", *sorted(names - {"maze"}))


def bundled_map(name: str) -> BundledMap:
    """The bundled map of this name.

    Raises:
        MapError: No map has this name; the message suggests the closest one.
    """
    names = bundled_maps()
    if name not in names:
        raise MapError(
            f"no bundled map is called {name!r}{hint(name, names)}; the maps are "
            f"{', '.join(names)}"
        )
    # raw read: shipped
    task = json.loads((_FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return BundledMap(
        name=name,
        image=_FOLDER / f"{name}.png",
        start=(task["start"][0], task["start"][1]),
        heading=task["heading"],
        goal=(task["goal"][0], task["goal"][1]),
        robot_radius=task["robot_radius"],
        description=task["description"],
    )
