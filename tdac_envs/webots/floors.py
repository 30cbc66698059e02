"""Floors with images, as infra-red sensors see them from above.

Images are read from folders near the world file; none is downloaded. Level surfaces
with an image are RectangleArena, Floor, SolidBox, and Shapes with a Plane, a Box or a
flat IndexedFaceSet that has texture coordinates.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import MapError, WorldError
from tdac_envs.core.intake import IMAGE_BYTES, read_file
from tdac_envs.epuck.prisms import Array
from tdac_envs.mapping.image import decode
from tdac_envs.worlds.wbt.appearance import factor_of_red, share
from tdac_envs.worlds.wbt.fields import (
    child,
    children,
    flag,
    number,
    number_list,
    numbers,
)
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.geometry import GROUPS
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.tree import WbtNode

_LEVEL = 0.02
"""Largest tilt of a floor, rad."""
_NEAR = 0.002
"""Largest height of a point above or below the floor on which it lies, m."""
_MAPS = ("baseColorMap", "texture")


class Texture(NamedTuple):
    """An image on a surface.

    Attributes:
        red: Shape (height, width): red of the image times that of the base colour, in
            [0, 1]; the first row is the top row.
        dimmed: Share of the red light that the material returns.
        transform: Shape (2, 3): from the surface's (u, v, 1) to the image's (u, v).
        repeats: Whether the image is repeated along u and v.
    """

    red: NDArray[np.float32]
    dimmed: float
    transform: Array
    repeats: tuple[bool, bool]


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A level surface with an image.

    Attributes:
        corners: Shape (2, 2): least and greatest (x, y) of the surface in its own axes,
            m.
        inverse: Shape (2, 3): from (x, y, 1) in the world to the surface's axes.
        uv: Shape (2, 3): from the surface's (x, y, 1) to (u, v).
        z: Height, m.
        texture: Its image.
    """

    corners: Array
    inverse: Array
    uv: Array
    z: float
    texture: Texture

    def red(self, x: float, y: float, z: float) -> float | None:
        """Reflectance at a point of the world; None if it is not on the surface."""
        own = self.inverse @ (x, y, 1.0)
        if (
            abs(z - self.z) > _NEAR
            or not (
                (own >= self.corners[0] - 1e-9) & (own <= self.corners[1] + 1e-9)
            ).all()
        ):
            return None
        look = self.texture
        u, v = look.transform @ (*(self.uv @ (*own, 1.0)), 1.0)
        height, width = look.red.shape
        column = _pixel(float(u), width, look.repeats[0])
        row = _pixel(1.0 - float(v), height, look.repeats[1])
        return factor_of_red(float(look.red[row, column]) * look.dimmed)


def _pixel(share_: float, count: int, repeats: bool) -> int:
    share_ = share_ % 1.0 if repeats else min(max(share_, 0.0), 1.0)
    return min(int(share_ * count), count - 1)


@dataclass(slots=True)
class Floors:
    """The textured floors of a world.

    Attributes:
        patches: The surfaces; of two at the same place, the later one is visible.
        missing: URLs of the images that were not found or cannot be read.
    """

    patches: list[Patch] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    def reflectance(self, x: float, y: float, z: float) -> float | None:
        """Reflectance of the textured floor at a point; None if there is none."""
        for patch in reversed(self.patches):
            found = patch.red(x, y, z)
            if found is not None:
                return found
        return None


def find_floors(nodes: Iterable[WbtNode], top: NodeFrame, folder: Path) -> Floors:
    """Finds the textured floors of a file.

    Args:
        nodes: Top-level nodes.
        top: Their frame.
        folder: Folder of the world file.
    """
    floors = Floors()
    for node, frame in _surfaces(nodes, top):
        try:
            _add(floors, node, frame, folder)
        except WorldError:  # an invalid appearance affects nothing else
            continue
    return floors


def _surfaces(
    nodes: Iterable[WbtNode], frame: NodeFrame
) -> Iterator[tuple[WbtNode, NodeFrame]]:
    """Nodes that may be textured floors, and their frames."""
    for node in nodes:
        if node.kind in ("RectangleArena", "Floor", "SolidBox"):
            yield node, placed(node, frame)
        elif node.kind == "Shape":
            yield node, frame
        elif node.kind in GROUPS or node.kind == "Solid":
            inner = frame if node.kind == "Group" else placed(node, frame, scaled=True)
            yield from _surfaces(children(node), inner)


def _add(floors: Floors, node: WbtNode, frame: NodeFrame, folder: Path) -> None:
    name = {"Floor": "appearance", "RectangleArena": "floorAppearance"}
    look = child(node, name.get(node.kind, "appearance"))
    laid = _laid(node, frame)
    if look is None or laid is None or abs(laid[0].tilt) > _LEVEL:
        return
    local, corners, uv = laid
    texture = _texture(look, folder, floors.missing)
    if texture is None:
        return
    inverse = np.linalg.inv(local.matrix[:2, :2])
    shift = -inverse @ local.origin[:2]
    floors.patches.append(
        Patch(
            np.array(corners),
            np.column_stack([inverse, shift]),
            uv,
            float(local.origin[2]),
            texture,
        )
    )


_Laid = tuple[NodeFrame, list[list[float]], Array]


def _laid(node: WbtNode, frame: NodeFrame) -> _Laid | None:
    """Frame (FLU) of a surface's centre, its bounds, and its transform to (u, v)."""
    if node.kind in ("RectangleArena", "Floor"):
        arena = node.kind == "RectangleArena"
        usual = 1.0 if arena else 10.0
        size = numbers(node, "floorSize" if arena else "size", (usual, usual))
        tile = numbers(node, "floorTileSize" if arena else "tileSize", (0.5, 0.5))
        return _rectangle(frame, size, tile)
    if node.kind == "SolidBox":
        size = numbers(node, "size", (2.0, 2.0, 2.0))
        return _box(frame, size)
    shape = child(node, "geometry")
    return None if shape is None else _laid_shape(shape, frame)


def _laid_shape(shape: WbtNode, frame: NodeFrame) -> _Laid | None:
    if shape.kind == "Plane":
        size = numbers(shape, "size", (1.0, 1.0))
        return _rectangle(frame, size, size)
    if shape.kind == "Box":
        return _box(frame, numbers(shape, "size", (2.0, 2.0, 2.0)))
    if shape.kind == "IndexedFaceSet":
        return _faces(shape, frame)
    return None


def _box(frame: NodeFrame, size: tuple[float, ...]) -> _Laid | None:
    """The upper face of a box."""
    x, y, z = size
    height, face = (y, (x, z)) if frame.y_up else (z, (x, y))
    middle = (0.0, height / 2, 0.0) if frame.y_up else (0.0, 0.0, height / 2)
    return _rectangle(frame.inside(middle), face, face)


def _rectangle(
    frame: NodeFrame, size: tuple[float, ...], tile: tuple[float, ...]
) -> _Laid | None:
    """A rectangle; u and v are 0 at its corner and increase by 1 per tile.

    They increase along x and y, or along x and -z if y is up.
    """
    if min(*size, *tile) <= 0.0:
        return None
    half = np.array(size) / 2
    scale = 1.0 / np.array(tile)
    if not frame.y_up:
        uv = np.column_stack([np.diag(scale), half * scale])
        return frame, [(-half).tolist(), half.tolist()], uv
    # In the axes forward (-z) and left (-x).
    uv = np.array(
        [[0.0, -scale[0], half[0] * scale[0]], [scale[1], 0.0, half[1] * scale[1]]]
    )
    return frame.flu(), [(-half[::-1]).tolist(), half[::-1].tolist()], uv


def _faces(shape: WbtNode, frame: NodeFrame) -> _Laid | None:
    """A flat mesh whose texture coordinates are an affine function of its points."""
    coord, texture = child(shape, "coord"), child(shape, "texCoord")
    if coord is None or texture is None or not frame.flu().matrix[:2, :2].any():
        return None
    points = np.array(number_list(coord, "point")).reshape(-1, 3)
    given = np.array(number_list(texture, "point")).reshape(-1, 2)
    corners = _indices(shape, "coordIndex")
    at = _indices(shape, "texCoordIndex") if "texCoordIndex" in shape.fields else None
    at = corners if at is None else at
    if not corners or len(corners) != len(at) or max(at) >= len(given):
        return None
    if max(corners) >= len(points) or min(*corners, *at) < 0:
        return None
    flat = points[corners]
    if frame.y_up:
        flat = np.column_stack([-flat[:, 2], -flat[:, 0], flat[:, 1]])
    if np.ptp(flat[:, 2]) > _NEAR:
        return None
    local = frame.flu()
    local = NodeFrame(local.matrix, local.at((0.0, 0.0, float(flat[0, 2]))), False)
    system = np.column_stack([flat[:, :2], np.ones(len(flat))])
    uv, *_ = np.linalg.lstsq(system, given[at], rcond=None)
    if np.abs(system @ uv - given[at]).max() > 0.01:
        return None
    least, most = flat[:, :2].min(axis=0), flat[:, :2].max(axis=0)
    return local, [least.tolist(), most.tolist()], np.asarray(uv.T)


def _indices(shape: WbtNode, name: str) -> list[int]:
    return [int(n) for n in number_list(shape, name) if n >= 0]


def _texture(look: WbtNode, folder: Path, missing: list[str]) -> Texture | None:
    """The image of an appearance; None if it has none that can be read."""
    picture = next((child(look, name) for name in _MAPS if name in look.fields), None)
    if picture is None or picture.kind != "ImageTexture":
        return None
    urls = [url for url in _strings(picture, "url") if url]
    if not urls:
        return None
    file = _file_of(urls[0], folder)
    try:
        red = None if file is None else decode(read_file(file, IMAGE_BYTES), file.name)
    except (MapError, OSError):
        red = None
    if red is None:
        missing.append(urls[0])
        return None
    base, dimmed = 1.0, 1.0
    if look.kind == "PBRAppearance":
        base = numbers(look, "baseColor", (1.0, 1.0, 1.0))[0]
        dimmed = 1.0 - 0.5 * share(number(look, "roughness", 0.0))
    repeats = flag(picture, "repeatS", True), flag(picture, "repeatT", True)
    shown = red[..., 0].astype(np.float32) / np.float32(255.0) * np.float32(base)
    return Texture(shown, dimmed, _transform(look), repeats)


def _transform(look: WbtNode) -> Array:
    """The TextureTransform of an appearance, shape (2, 3)."""
    node = child(look, "textureTransform")
    if node is None:
        return np.eye(2, 3)
    middle = np.array(numbers(node, "center", (0.0, 0.0)))
    scale = np.diag(numbers(node, "scale", (1.0, 1.0)))
    angle = number(node, "rotation", 0.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shift = np.array(numbers(node, "translation", (0.0, 0.0)))
    matrix = scale @ turn
    return np.column_stack([matrix, matrix @ (middle + shift) - middle])


def _strings(node: WbtNode, name: str) -> list[str]:
    if name not in node.fields:
        return []
    return [item for item in node.fields[name].items if isinstance(item, str)]


def _file_of(url: str, folder: Path) -> Path | None:
    """The file of an image; None if there is none.

    It is the file at the URL if this is a relative path, otherwise a file of the same
    name in the folder of the world file, in `textures` there, or in the parent folder.
    """
    name = PurePosixPath(url.replace("\\", "/")).name
    places = [folder / name, folder / "textures" / name, folder.parent / name]
    if "://" not in url and ":" not in url:
        places.insert(0, folder / url)
    return next((place for place in places if place.is_file()), None)
