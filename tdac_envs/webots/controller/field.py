"""Fields of nodes, with type checks as strict as those of Webots."""

from __future__ import annotations

from typing import Any

from .calls import getters, lacking
from .connection import connection
from .messages import complain

_TYPES = (
    "SFBool", "SFInt32", "SFFloat", "SFVec2f", "SFVec3f", "SFRotation", "SFColor",
    "SFString", "SFNode",
)  # fmt: skip
_LENGTHS = {4: 2, 5: 3, 6: 4, 7: 3}
_KINDS: dict[int, type] = {1: bool, 2: int, 3: float, 8: str}
_MF = 16


@getters("name", "type", "type_name", "count")
@lacking(
    importMFNodeFromString=None,
    importMFNode=None,
    importSFNodeFromString=None,
    importSFNode=None,
    enableSFTracking=None,
    disableSFTracking=None,
)
class Field:
    """A field of a node.

    Args:
        node: Number of the node.
        entry: Name, type and value in the scene; changes are written to it.

    Attributes:
        type: Type of the field, one of the constants.
    """

    SF_BOOL, SF_INT32, SF_FLOAT, SF_VEC2F, SF_VEC3F = 1, 2, 3, 4, 5
    SF_ROTATION, SF_COLOR, SF_STRING, SF_NODE = 6, 7, 8, 9
    MF_BOOL, MF_INT32, MF_FLOAT, MF_VEC2F, MF_VEC3F = 17, 18, 19, 20, 21
    MF_ROTATION, MF_COLOR, MF_STRING, MF_NODE = 22, 23, 24, 25

    def __init__(self, node: int, entry: list[Any]) -> None:
        self._node = node
        self._entry = entry
        self.type = int(entry[1])

    def getActualField(self) -> Field:
        """The field itself."""
        return self

    @property
    def name(self) -> str:
        """Name of the field."""
        return str(self._entry[0])

    @property
    def type_name(self) -> str:
        """Type name, for instance `SFVec3f`."""
        name = _TYPES[(self.type & ~_MF) - 1]
        return name.replace("SF", "MF") if self.type & _MF else name

    @property
    def count(self) -> int:
        """Number of values of a list; -1 for a single field."""
        if not self.type & _MF:
            complain(
                "Error: wb_supervisor_field_get_count() can only be used with "
                "multiple fields."
            )
            return -1
        return len(self._entry[2])

    @property
    def value(self) -> Any:
        """The value of a single field; None for a list."""
        if self.type == self.SF_NODE:
            return self.getSFNode()
        if self.type & _MF:
            return None
        value = self._current_value()
        return list(value) if isinstance(value, list) else value

    @value.setter
    def value(self, value: Any) -> None:
        kind, length = _KINDS.get(self.type), _LENGTHS.get(self.type)
        fits = kind is not None and isinstance(value, kind)
        if length is not None:
            fits = isinstance(value, list) and len(value) == length
        if not fits:
            complain("Error: new field value has wrong type or length.")
            return
        if self._is_allowed("value"):
            self._entry[2] = list(value) if isinstance(value, list) else value

    def getSFBool(self) -> Any:
        """The value."""
        return self.value

    getSFInt32 = getSFFloat = getSFString = getSFBool
    getSFVec2f = getSFVec3f = getSFRotation = getSFColor = getSFBool

    def setSFBool(self, value: Any) -> None:
        """Sets the value; one of another type is refused, an int for a float, too."""
        self.value = value

    setSFInt32 = setSFFloat = setSFString = setSFBool

    def setSFVec2f(self, value: list[float]) -> None:
        """Sets the value; anything but a list is refused."""
        self._set("setSFVec2f", value, 2)

    def setSFVec3f(self, value: list[float]) -> None:
        """Sets the value; anything but a list is refused."""
        self._set("setSFVec3f", value, 3)

    def setSFRotation(self, value: list[float]) -> None:
        """Sets the value; anything but a list is refused."""
        self._set("setSFRotation", value, 4)

    def setSFColor(self, value: list[float]) -> None:
        """Sets the value; anything but a list is refused."""
        self._set("setSFColor", value, 3)

    def getSFNode(self) -> Any:
        """The node, or None."""
        from .node import node_of

        number = self._entry[2]
        return node_of(number) if self.type == self.SF_NODE and number >= 0 else None

    def getMFNode(self, index: int) -> Any:
        """A node of a list, or None."""
        from .node import node_of

        number = self._item(index)
        return None if self.type != self.MF_NODE or number is None else node_of(number)

    def getMFBool(self, index: int) -> Any:
        """A value of a list, or None."""
        value = self._item(index)
        return list(value) if isinstance(value, list) else value

    getMFInt32 = getMFFloat = getMFString = getMFBool
    getMFVec2f = getMFVec3f = getMFRotation = getMFColor = getMFBool

    def setMFBool(self, index: int, value: Any) -> None:
        """Sets a value of a list."""
        if self._item(index) is not None and self._is_allowed("setMF"):
            self._entry[2][index] = value

    setMFInt32 = setMFFloat = setMFString = setMFBool
    setMFVec2f = setMFVec3f = setMFRotation = setMFColor = setMFBool

    def removeMF(self, index: int) -> None:
        """Removes a value from a list."""
        if self._item(index) is not None and self._is_allowed("removeMF"):
            del self._entry[2][index]

    def removeSF(self) -> None:
        """Removes the node."""
        if self.type == self.SF_NODE and self._is_allowed("removeSF"):
            self._entry[2] = -1

    def _set(self, call: str, value: list[float], length: int) -> None:
        if len(value) != length:
            complain(f"Error: {call}(): length of 'value' argument should be {length}.")
        else:
            self.value = value

    def _is_allowed(self, call: str) -> bool:
        return connection.tell(call, self._node, self.name)

    def _current_value(self) -> Any:
        """The value; for the pose of a moved node, the current one."""
        place = connection.places.get(self._node)
        if place is not None and self.name in ("translation", "rotation"):
            return place[self.name == "rotation"]
        return self._entry[2]

    def _item(self, index: int) -> Any:
        values = self._entry[2]
        if not self.type & _MF or not -len(values) <= index < len(values):
            complain(
                f"Error: index {index} is out of bounds of the field '{self.name}'."
            )
            return None
        return values[index]
