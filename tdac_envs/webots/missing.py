"""Notes on devices that the robot has in the file and not, or not quite, here."""

from __future__ import annotations

from collections.abc import Iterable

from tdac_envs.core.intake import printable
from tdac_envs.webots.devices import NAMES_OF
from tdac_envs.webots.mounts import Mount
from tdac_envs.worlds.wbt.fields import text
from tdac_envs.worlds.wbt.known_fields import KNOWN
from tdac_envs.worlds.wbt.robots import ROBOTS
from tdac_envs.worlds.wbt.tree import WbtNode

MOST_NAMED = 20
_MODELLED = {
    "E-puckDistanceSensor", "E-puckGroundSensors", "RobotisLds01", "RpLidarA2",
    *ROBOTS,
}  # fmt: skip
# Further nodes of Webots, which are no devices themselves.
_NO_DEVICES = {
    "CadShape", "Charger", "ColladaShape", "Fluid", "Muscle", "Propeller", "Servo",
    "SolidReference", "Track", "TrackWheel",
}  # fmt: skip


def missing_devices(absent: Iterable[str], mounted: Iterable[Mount]) -> list[str]:
    """Notes on devices that give no data, and on those that are not found.

    Args:
        absent: Names of the devices that are not modelled.
        mounted: Nodes in the slots of the robot, or in a Robot node.
    """
    nodes = [node for node, _ in mounted]
    kinds = {
        text(node, "name", NAMES_OF.get(node.kind, "")): node.kind for node in nodes
    }
    named = [f"{kinds.get(name, '')} {printable(name)!r}".strip() for name in absent]
    notes = []
    if named:
        notes.append(
            f"not modelled: {_listed(named)}; getDevice finds what is named here, but "
            "it gives no data and has no effect"
        )
    unknown = dict.fromkeys(printable(n.kind) for n in nodes if _is_unknown(n))
    if unknown:
        notes.append(
            f"not modelled on the robot: {_listed(list(unknown))}; getDevice finds no "
            "device in them"
        )
    return notes


def _is_unknown(node: WbtNode) -> bool:
    return node.kind not in KNOWN.keys() | NAMES_OF.keys() | _MODELLED | _NO_DEVICES


def _listed(names: list[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
