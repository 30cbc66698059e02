"""Nodes of the world, as a supervisor sees them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .calls import getters, lacking
from .connection import connection
from .field import Field
from .messages import complain
from .pose import absolute, moved, product, transposed

_NAMES = (
    "NO_NODE", "APPEARANCE", "BACKGROUND", "BILLBOARD", "BOX", "CAD_SHAPE", "CAPSULE",
    "COLOR", "CONE", "COORDINATE", "CYLINDER", "DIRECTIONAL_LIGHT", "ELEVATION_GRID",
    "FOG", "GROUP", "IMAGE_TEXTURE", "INDEXED_FACE_SET", "INDEXED_LINE_SET",
    "MATERIAL", "MESH", "MUSCLE", "NORMAL", "PBR_APPEARANCE", "PLANE", "POINT_LIGHT",
    "POINT_SET", "POSE", "SHAPE", "SPHERE", "SPOT_LIGHT", "TEXTURE_COORDINATE",
    "TEXTURE_TRANSFORM", "TRANSFORM", "VIEWPOINT", "ROBOT", "ACCELEROMETER",
    "ALTIMETER", "BRAKE", "CAMERA", "COMPASS", "CONNECTOR", "DISPLAY",
    "DISTANCE_SENSOR", "EMITTER", "GPS", "GYRO", "INERTIAL_UNIT", "LED", "LIDAR",
    "LIGHT_SENSOR", "LINEAR_MOTOR", "PEN", "POSITION_SENSOR", "PROPELLER", "RADAR",
    "RANGE_FINDER", "RECEIVER", "ROTATIONAL_MOTOR", "SKIN", "SPEAKER", "TOUCH_SENSOR",
    "VACUUM_GRIPPER", "BALL_JOINT", "BALL_JOINT_PARAMETERS", "CHARGER",
    "CONTACT_PROPERTIES", "DAMPING", "FLUID", "FOCUS", "HINGE_JOINT",
    "HINGE_JOINT_PARAMETERS", "HINGE_2_JOINT", "IMMERSION_PROPERTIES",
    "JOINT_PARAMETERS", "LENS", "LENS_FLARE", "PHYSICS", "RECOGNITION",
    "SLIDER_JOINT", "SLOT", "SOLID", "SOLID_REFERENCE", "TRACK", "TRACK_WHEEL",
    "WORLD_INFO", "ZOOM", "MICROPHONE", "RADIO",
)  # fmt: skip

_NUMBERS = {name.replace("_", ""): number for number, name in enumerate(_NAMES)}


@getters("id", "type", "type_name", "base_type_name", "number_of_fields", getDef="DEF")
@lacking(
    saveState=None,
    restartController=None,
    moveViewpoint=None,
    setVisibility=None,
    getContactPoints=(),
    enableContactPointsTracking=None,
    disableContactPointsTracking=None,
    enablePoseTracking=None,
    disablePoseTracking=None,
    getCenterOfMass=None,
    getStaticBalance=True,
    exportString="",
    getFromProtoDef=None,
    getBaseNodeField=None,
    getProtoField=None,
)
class Node:
    """A node.

    Args:
        number: Number of the node in the scene.

    Attributes:
        id: Number of the node.
    """

    NO_NODE, GROUP, ROBOT, COMPASS, DISTANCE_SENSOR, GPS = 0, 14, 34, 39, 42, 44
    POSITION_SENSOR, ROTATIONAL_MOTOR, SOLID = 52, 57, 80

    def __init__(self, number: int) -> None:
        self.id = number
        self._data: dict[str, Any] = connection.facts["scene"][number]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Node) and other.id == self.id

    def __hash__(self) -> int:
        return hash(self.id)

    @property
    def DEF(self) -> str:
        """DEF name, or empty."""
        return str(self._data["def"])

    @property
    def type(self) -> int:
        """Base type, one of the constants."""
        return _NUMBERS.get(self.base_type_name.upper(), self.NO_NODE)

    @property
    def type_name(self) -> str:
        """Node type or name of the PROTO."""
        return str(self._data["type"])

    @property
    def base_type_name(self) -> str:
        """Node type; for a PROTO, its base type."""
        return str(self._data["base"])

    def isProto(self) -> bool:
        """Whether the node is a PROTO."""
        return self.type_name != self.base_type_name

    def getParentNode(self) -> Node | None:
        """The parent node; None for the root."""
        number = self._data["parent"]
        return node_of(number) if number >= 0 else None

    def getField(self, name: str) -> Field | None:
        """The field called `name`, or None."""
        for entry in self._data["fields"]:
            if entry[0] == name:
                return Field(self.id, entry)
        return None

    def getFieldByIndex(self, index: int) -> Field | None:
        """The field at an index, or None."""
        fields = self._data["fields"]
        return Field(self.id, fields[index]) if 0 <= index < len(fields) else None

    @property
    def number_of_fields(self) -> int:
        """Number of fields."""
        return len(self._data["fields"])

    def getPosition(self) -> list[float]:
        """Position in the world, m."""
        return self._place()[0]

    def getOrientation(self) -> list[float]:
        """Rotation matrix in the world, nine numbers, row by row."""
        return [value for row in self._place()[1] for value in row]

    def getPose(self, fromNode: Node | None = None) -> list[float]:
        """Pose matrix in the world or in `fromNode`, sixteen numbers, row by row."""
        position, turn = self._place()
        if fromNode is not None:
            origin, base = fromNode._place()
            back = transposed(base)
            off = [a - b for a, b in zip(position, origin, strict=True)]
            position, turn = moved(back, [0.0] * 3, off), product(back, turn)
        rows = [[*turn[k], position[k]] for k in range(3)]
        return [*rows[0], *rows[1], *rows[2], 0.0, 0.0, 0.0, 1.0]

    def getVelocity(self) -> list[float]:
        """Linear (m/s) and angular (rad/s) velocity of the robot; 0 for other nodes."""
        own = self.id == connection.facts["self"]
        return list(connection.velocity) if own else [0.0] * 6

    def _place(self) -> tuple[list[float], list[list[float]]]:
        return absolute(connection.facts["scene"], connection.places, self.id)


def _forbidden(call: str) -> Callable[..., None]:
    def change(node: Node, *_: Any, **__: Any) -> None:
        """Forbidden in a judged run: ends it as a failure."""
        connection.tell(call, node.id)

    return change


for _number, _name in enumerate(_NAMES):
    setattr(Node, _name, _number)
for _name in (
    "setVelocity", "resetPhysics", "remove", "loadState", "addForce",
    "addForceWithOffset", "addTorque", "setJointPosition",
):  # fmt: skip
    setattr(Node, _name, _forbidden(_name))


def node_of(number: int) -> Node:
    """The node with this number."""
    return Node(number)


def may_supervise(function: str) -> bool:
    """Whether the robot is a supervisor; prints an error if it is not."""
    if connection.facts["supervisor"]:
        return True
    complain(
        f"Error: ignoring illegal call to {function}() in a 'Robot' controller.\n"
        "Error: this function can only be used in a 'Supervisor' controller."
    )
    return False
