"""Converts nodes to e-pucks, floors and obstacles, or lists them as unmodelled."""

from __future__ import annotations

from contextlib import suppress

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.looks import Look
from tdac_envs.worlds.wbt.appearance import reflectance
from tdac_envs.worlds.wbt.arenas import ARENAS, arena
from tdac_envs.worlds.wbt.colours import look, proto_look
from tdac_envs.worlds.wbt.content import WorldContent, is_goal, material_of, name_of
from tdac_envs.worlds.wbt.fields import StrayError, child, children
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.geometry import GROUPS, Pieces, bounds, geometry
from tdac_envs.worlds.wbt.physics import mass_of
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.protos import PROTOS
from tdac_envs.worlds.wbt.robots import ROBOTS, epuck, has_body, is_epuck
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import Obstacle

_NEVER_SOLID = {
    "Background", "Billboard", "DirectionalLight", "Fog", "PointLight", "SpotLight",
    "TexturedBackground", "TexturedBackgroundLight", "Viewpoint", "WorldInfo",
}  # fmt: skip
_JOINTS = {"BallJoint", "Hinge2Joint", "HingeJoint", "SliderJoint", "Slot"}
_DEVICES = {
    "Accelerometer", "Altimeter", "Camera", "Charger", "Compass", "Connector",
    "Display", "DistanceSensor", "Emitter", "GPS", "Gyro", "InertialUnit", "LED",
    "Lidar", "LightSensor", "Microphone", "Pen", "Radar", "Radio", "RangeFinder",
    "Receiver", "Servo", "Speaker", "TouchSensor", "VacuumGripper",
}  # fmt: skip

# A Shape's geometry, reflectance and look.
_Shown = tuple[Pieces, float, Look]


def walk(node: WbtNode, frame: NodeFrame, found: WorldContent) -> None:
    """Adds a node and its content to `found`.

    Args:
        node: Any node of the scene.
        frame: Frame of its parent.
        found: The content of the file so far.

    Raises:
        WorldError: A field is invalid; the message gives line and column.
    """
    if node.kind in _NEVER_SOLID:
        return
    try:
        _walk(node, frame, found)
    except StrayError as error:
        if is_epuck(node):
            raise
        found.left_out(node, frame, str(error))


def _walk(node: WbtNode, frame: NodeFrame, found: WorldContent) -> None:
    if is_epuck(node):
        found.robots.append(epuck(node, frame))
    elif node.kind in ROBOTS:
        _other_robot(node, frame, found)
    elif node.kind in ARENAS:
        _arena(node, frame, found)
    elif node.kind in PROTOS:
        _proto(node, frame, found)
    elif node.kind == "Solid" or node.kind in _DEVICES:
        _solid(node, placed(node, frame, scaled=True), found)
    elif node.kind in GROUPS:
        _group(node, frame, found)
    elif node.kind == "Shape":
        _shape(node, frame, found, node)
    elif node.kind in _JOINTS:
        _joint(node, frame, found)
    else:
        _unknown(node, frame, found)


def _other_robot(node: WbtNode, frame: NodeFrame, found: WorldContent) -> None:
    own = placed(node, frame, scaled=True)
    if is_goal(node):
        found.goal(own)
    body = has_body(node)
    why = "a robot that may move" if body else "a robot without a body"
    found.left_out(node, own, why, solid=body)


def _arena(node: WbtNode, frame: NodeFrame, found: WorldContent) -> None:
    made = arena(node, frame)
    if isinstance(made, str):
        found.left_out(node, placed(node, frame), made)
    else:
        found.arenas.append(made)


def _proto(node: WbtNode, frame: NodeFrame, found: WorldContent) -> None:
    body = PROTOS[node.kind](node, frame)
    if is_goal(node):
        found.goal(body.frame)
    x, y, _ = body.frame.origin.tolist()
    obstacle = Obstacle(
        name_of(node), node.kind, x, y, body.solid, body.visible, body.mass,
        body.reflectance, is_goal(node), (proto_look(node),) * len(body.visible),
        material_of(node),
    )  # fmt: skip
    found.obstacle(node, obstacle)


def _solid(node: WbtNode, own: NodeFrame, found: WorldContent) -> None:
    """Adds a Solid with its boundingObject and Shapes, then the Solids inside it."""
    if is_goal(node):
        found.goal(own)
    place, looks = len(found.obstacles), list[_Shown]()
    _collect_shapes(children(node), own, found, looks)
    bounding = child(node, "boundingObject")
    body = Pieces() if bounding is None else bounds(bounding, own)
    for missing in dict.fromkeys(body.missing):
        found.left_out(node, own, f"its boundingObject is {missing}")
    visible = sum((pieces for pieces, _, _ in looks), Pieces())
    colours = [own for pieces, _, own in looks for _ in pieces.parts]
    if visible.missing:
        seen = "its boundingObject" if body.parts else "nothing of it"
        _note_unseen(node, visible, seen, found)
        visible += Pieces(body.parts)
        colours += [looks[0][2]] * len(body.parts)
    if node.kind != "Solid" and not body.parts and not visible.parts:
        return
    x, y, _ = own.origin.tolist()
    obstacle = Obstacle(
        name_of(node), _kind(node), x, y, body.parts, visible.parts,
        mass_of(node, body.volume), looks[0][1] if looks else 1.0, is_goal(node),
        tuple(colours), material_of(node),
    )  # fmt: skip
    found.obstacle(node, obstacle, place)


def _kind(node: WbtNode) -> str:
    """The `model` field of a Solid if it has one, else the node type."""
    model = node.fields.get("model")
    if model is None or len(model.items) != 1 or not isinstance(model.items[0], str):
        return node.kind
    return model.items[0] or node.kind


def _note_unseen(
    node: WbtNode, looks: Pieces, instead: str, found: WorldContent
) -> None:
    what = ", ".join(dict.fromkeys(looks.missing))
    where = f"line {node.line}: {name_of(node) or node.kind}"
    found.notes.append(f"{where}: {what} is not modelled; sensors see {instead}")


def _collect_shapes(
    nodes: tuple[WbtNode, ...],
    frame: NodeFrame,
    found: WorldContent,
    looks: list[_Shown],
) -> None:
    """Collects the Shapes of a Solid, and walks everything else in it."""
    for node in nodes:
        if node.kind == "Shape":
            shape = child(node, "geometry")
            if shape is not None:
                looks.append((geometry(shape, frame), reflectance(node), look(node)))
        elif node.kind in GROUPS:
            _collect_shapes(children(node), _inside(node, frame), found, looks)
        else:
            walk(node, frame, found)


def _inside(node: WbtNode, frame: NodeFrame) -> NodeFrame:
    return frame if node.kind == "Group" else placed(node, frame, scaled=True)


def _group(node: WbtNode, frame: NodeFrame, found: WorldContent) -> None:
    own = _inside(node, frame)
    if is_goal(node):
        found.goal(own)
    for part in children(node):
        if part.kind == "Shape":
            _shape(part, own, found, node)
        else:
            walk(part, own, found)


def _shape(
    node: WbtNode, frame: NodeFrame, found: WorldContent, named: WbtNode
) -> None:
    """Adds a Shape outside of Solids: sensors see it, nothing hits it."""
    shape = child(node, "geometry")
    if shape is None:
        return
    looks = geometry(shape, frame)
    if looks.missing:
        _note_unseen(node, looks, "nothing of it", found)
    x, y, _ = frame.origin.tolist()
    name = name_of(node) or name_of(named)
    mark = is_goal(node) or is_goal(named)
    if mark and not is_goal(named):
        found.goal(frame)
    obstacle = Obstacle(
        name, "Shape", x, y, (), looks.parts, None, reflectance(node), mark,
        (look(node),) * len(looks.parts),
    )  # fmt: skip
    found.obstacle(node, obstacle)


def _joint(node: WbtNode, frame: NodeFrame, found: WorldContent) -> None:
    end = child(node, "endPoint")
    if end is not None:
        walk(end, frame, found)
        if node.kind != "Slot":
            name = name_of(end) or end.kind
            found.notes.append(f"{name}: modelled as fixed, although on a {node.kind}")


def _unknown(node: WbtNode, frame: NodeFrame, found: WorldContent) -> None:
    # These fields may have another meaning in an unknown node.
    with suppress(WorldError):
        frame = placed(node, frame)
    if is_goal(node):
        found.goal(frame)
    found.left_out(node, frame, "an unknown node or PROTO")
