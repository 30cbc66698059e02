"""The generators by name, and their parameters as they stand in a `set.yaml`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import Field

from tdac_envs.ladder.generators import aisles, caves, clutter, mazes, rooms
from tdac_envs.ladder.generators.draft import GeneratorParameters, WorldDraft
from tdac_envs.ladder.random_stream import RandomStream

AnyParameters = Annotated[
    mazes.Mazes | rooms.Rooms | caves.Caves | clutter.Clutter | aisles.Aisles,
    Field(discriminator="name"),
]
"""Parameters of any generator; `name` decides which."""


@dataclass(frozen=True, slots=True)
class Generator:
    """A generator of worlds.

    Attributes:
        parameters: Model of its parameters.
        draw: Draws a draft from random numbers, parameters and the body diameter, px.
        min_detour: Least ratio of the shortest path to the straight line.
    """

    parameters: type[GeneratorParameters]
    draw: Callable[[RandomStream, Any, float], WorldDraft]
    min_detour: float


GENERATORS: Mapping[str, Generator] = MappingProxyType(
    {
        "mazes": Generator(mazes.Mazes, mazes.draw, 1.3),
        "rooms": Generator(rooms.Rooms, rooms.draw, 1.3),
        "caves": Generator(caves.Caves, caves.draw, 1.1),
        "clutter": Generator(clutter.Clutter, clutter.draw, 1.1),
        "aisles": Generator(aisles.Aisles, aisles.draw, 1.1),
    }
)


def draw(random: RandomStream, params: AnyParameters, body: float) -> WorldDraft:
    """Draws a draft, mirrored and turned by a random multiple of 90°.

    Args:
        random: Random numbers.
        params: Parameters of the generator.
        body: Diameter of the body, px.
    """
    quarters, mirrored = random.integer(0, 3), random.chance(0.5)
    if quarters % 2:
        sides = {"width": params.height, "height": params.width}
        params = params.model_copy(update=sides)
    drawn = GENERATORS[params.name].draw(random, params, body)
    return drawn.turned(quarters, mirrored)
