"""The distance and light sensors of a robot, and their readings in a run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.prisms import Array, Prisms
from tdac_envs.webots.beams import (
    Beam,
    ground_sensors,
    read_beam,
    reading,
    time_of_flight,
)
from tdac_envs.webots.floors import Floors
from tdac_envs.webots.lights import Light, LightCell, read_cell, standard_cells
from tdac_envs.webots.mounts import Mount
from tdac_envs.worlds.bodies import floor_under
from tdac_envs.worlds.wbt.fields import text
from tdac_envs.worlds.wbt.robots import ROBOTS
from tdac_envs.worlds.wbt.tree import WbtNode

_EPUCK_TABLE_NAMES = {f"ps{k}" for k in range(8)} | {f"ls{k}" for k in range(8)}
_LARGEST = 4200.0


@dataclass(frozen=True, slots=True)
class Instruments:
    """The distance and light sensors of a robot, except ps0 to ps7.

    Attributes:
        beams: Distance sensors.
        cells: Light sensors.
        lights: The lights of the world.
        floors: The textured floors of the world.
        on_ground: Whether the robot's origin is on the ground, as in the PROTO.
    """

    beams: tuple[Beam, ...] = ()
    cells: tuple[LightCell, ...] = ()
    lights: tuple[Light, ...] = ()
    floors: Floors = field(default_factory=Floors)
    on_ground: bool = True

    def notes(self) -> tuple[str, ...]:
        """A note on missing floor images, if a sensor needs them."""
        looks_down = any(beam.is_infrared and beam.looks_down for beam in self.beams)
        if not looks_down or not self.floors.missing:
            return ()
        names = ", ".join(dict.fromkeys(self.floors.missing))
        return (
            f"the image of the floor is missing: {names}; tdac downloads nothing, so "
            "put the file beside the world file",
        )


def find_instruments(
    robot: WbtNode,
    mounted: tuple[Mount, ...],
    lights: tuple[Light, ...],
    floors: Floors,
) -> Instruments:
    """Finds the sensors of an e-puck.

    Args:
        robot: Node of the e-puck: the PROTO or a plain Robot.
        mounted: Nodes in its slots or in the Robot node.
        lights: The lights of the world.
        floors: The textured floors of the world.

    Raises:
        WorldError: A field is invalid.
    """
    beams: dict[str, Beam] = {}
    cells = {cell.name: cell for cell in standard_cells()}
    if text(robot, "version") == "2":
        beams["tof"] = time_of_flight()
    for node, frame in mounted:
        if node.kind == "E-puckGroundSensors":
            beams |= {beam.name: beam for beam in ground_sensors()}
        elif node.kind in ("DistanceSensor", "E-puckDistanceSensor"):
            beam = read_beam(node, frame)
            if beam.name not in _EPUCK_TABLE_NAMES:
                beams[beam.name] = beam
        elif node.kind == "LightSensor":
            cell = read_cell(node, frame)
            if cell.name not in cells:
                cells[cell.name] = cell
    return Instruments(
        tuple(beams.values()),
        tuple(cells.values()),
        lights,
        floors,
        robot.kind not in ROBOTS,
    )


class Readings:
    """Reads the instruments of a robot.

    Args:
        instruments: The sensors.
        env: The environment, which knows where movable objects are.
    """

    def __init__(self, instruments: Instruments, env: EPuckEnv) -> None:
        self._instruments, self._env = instruments, env
        world = env.nominal.ground.world
        self._ground, self._floor = Ground.of(world), floor_under(world)
        self._base = self._floor if instruments.on_ground else world.robot.z
        self._beams = {beam.name: beam for beam in instruments.beams}
        self._cells = {cell.name: cell for cell in instruments.cells}
        self._seen: dict[bool, tuple[Prisms, Prisms]] = {}
        # Noise, materials and the goal marker are enabled together; see `make_env`.
        self._webots = env.sensor_noise > 0.0
        self._random = np.random.default_rng(0)

    def distance(self, name: str, pose: tuple[float, float, float]) -> float:
        """Reading of a distance sensor at a pose of the robot, m and rad."""
        beam = self._beams[name]
        # Markings on the ground have their own reflectance in any case.
        webots = self._webots or beam.looks_down
        value = reading(
            beam,
            pose,
            self._base,
            self._floor,
            self._parts(webots),
            self._instruments.floors,
        )
        if self._env.sensor_noise:
            spread = np.interp(value, *_by_reading(beam)) * self._env.sensor_noise
            value *= 1.0 + float(spread * self._random.standard_normal())
        return min(max(value, 0.0), max(_LARGEST, float(beam.table[:, 1].max())))

    def light(self, name: str, pose: tuple[float, float, float]) -> float:
        """Reading of a light sensor at a pose of the robot, m and rad."""
        return self._cells[name].reading(pose, self._base, self._instruments.lights)

    def _parts(self, webots: bool) -> Prisms:
        """The visible parts at their current positions."""
        if webots not in self._seen:
            origin = self._ground.visible(webots, self._webots)
            self._seen[webots] = origin, origin.copy()
        origin, current = self._seen[webots]
        if len(self._ground.masses):
            current.carry(origin, self._ground.centres, self._env.things())
        return current


def _by_reading(beam: Beam) -> tuple[Array, Array]:
    order = np.argsort(beam.table[:, 1], kind="stable")
    return beam.table[order, 1], beam.table[order, 2]
