"""A robot that may query the whole world."""

from __future__ import annotations

from typing import Any

from .calls import getters, lacking
from .connection import c_int, connection
from .device import Device
from .node import Node, may_supervise, node_of
from .robot import Robot


@getters(simulationGetMode="simulation_mode")
@lacking(
    setLabel=None,
    worldSave=False,
    exportImage=None,
    movieStartRecording=None,
    movieStopRecording=None,
    movieIsReady=True,
    movieFailed=False,
    animationStartRecording=False,
    animationStopRecording=False,
    virtualRealityHeadsetIsUsed=False,
)
class Supervisor(Robot):
    """A robot with `supervisor TRUE`; without it, supervisor calls are refused.

    It may query everything, but not move anything, since the run is judged.
    """

    SIMULATION_MODE_PAUSE, SIMULATION_MODE_REAL_TIME, SIMULATION_MODE_FAST = 0, 1, 2
    _mode = SIMULATION_MODE_FAST

    def getRoot(self) -> Node | None:
        """The root node; its `children` are the top-level nodes of the file."""
        return node_of(0) if may_supervise("wb_supervisor_node_get_root") else None

    def getSelf(self) -> Node | None:
        """The robot's node."""
        if not may_supervise("wb_supervisor_node_get_self"):
            return None
        return node_of(connection.facts["self"])

    def getFromDef(self, name: str) -> Node | None:
        """The node with this DEF name, or None; `A.B` is B inside A."""
        if not may_supervise("wb_supervisor_node_get_from_def"):
            return None
        found, within = -1, -1
        for part in name.split("."):
            found = _defined(part, within)
            if found < 0:
                return None
            within = found
        return node_of(found)

    def getFromId(self, number: int) -> Node | None:
        """The node with this number, or None."""
        if not may_supervise("wb_supervisor_node_get_from_id"):
            return None
        return node_of(number) if 0 <= number < len(_scene()) else None

    def getFromDevice(self, device: Device) -> Node | None:
        """Always None, since an e-puck's devices are inside its PROTO."""
        del device
        may_supervise("wb_supervisor_node_get_from_device")
        return None

    def getSelected(self) -> None:
        """Always None: nothing is selected."""
        may_supervise("wb_supervisor_node_get_selected")

    def simulationSetMode(self, mode: int) -> None:
        """Stores the mode, without effect."""
        if may_supervise("wb_supervisor_simulation_set_mode"):
            self._mode = c_int(mode)

    @property
    def simulation_mode(self) -> int:
        """Mode given to `simulationSetMode`; initially SIMULATION_MODE_FAST."""
        return self._mode

    @simulation_mode.setter
    def simulation_mode(self, mode: int) -> None:
        self.simulationSetMode(mode)

    def simulationQuit(self, status: int) -> None:
        """Ends the run."""
        if may_supervise("wb_supervisor_simulation_quit"):
            c_int(status)
            connection.tell("simulationQuit")

    def simulationReset(self) -> None:
        """Forbidden in a judged run: ends it as a failure."""
        if may_supervise("wb_supervisor_simulation_reset"):
            connection.tell("simulationReset")

    def simulationResetPhysics(self) -> None:
        """Forbidden in a judged run: ends it as a failure."""
        if may_supervise("wb_supervisor_simulation_reset_physics"):
            connection.tell("simulationResetPhysics")

    def worldReload(self) -> None:
        """Forbidden in a judged run: ends it as a failure."""
        if may_supervise("wb_supervisor_world_reload"):
            connection.tell("worldReload")

    def worldLoad(self, filename: str) -> None:
        """Forbidden in a judged run: ends it as a failure."""
        del filename
        if may_supervise("wb_supervisor_world_load"):
            connection.tell("worldLoad")


def _scene() -> list[dict[str, Any]]:
    scene: list[dict[str, Any]] = connection.facts["scene"]
    return scene


def _defined(name: str, within: int) -> int:
    """Number of the first node with a DEF name (in `within` unless -1); -1 if none."""
    for number, node in enumerate(_scene()):
        if node["def"] == name and (within < 0 or _is_in(number, within)):
            return number
    return -1


def _is_in(number: int, outer: int) -> bool:
    while number > 0:
        number = _scene()[number]["parent"]
        if number == outer:
            return True
    return False
