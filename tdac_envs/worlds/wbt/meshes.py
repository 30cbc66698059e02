"""Converts IndexedFaceSets to prisms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tdac_envs.worlds.footprint import THINNEST
from tdac_envs.worlds.wbt.fields import child, number_list
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.prisms import hull
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import Part

MOST_FACES = 1000
"""Maximum number of faces of a non-convex mesh."""
MOST_CORNERS = 100
"""Maximum corners of a non-convex face; ten times as many for all of them together."""

Points = NDArray[np.float64]
Face = NDArray[np.int64]


def mesh(node: WbtNode, frame: NodeFrame) -> tuple[Part, ...] | str:
    """The prisms of an IndexedFaceSet.

    A convex mesh becomes one prism. Any other mesh becomes one prism per face, each as
    high as the whole mesh: the space below an overhang counts as filled.

    Args:
        node: The IndexedFaceSet.
        frame: Frame of the node, in the file's object axes (FLU or RUB).

    Returns:
        The parts, or a description of the mesh if it cannot be converted.

    Raises:
        WorldError: The points or indices are invalid.
    """
    points = frame.at(_points(node))
    faces = _faces(node, len(points))
    if not faces:
        return ()
    used = points[np.unique(np.concatenate(faces))]
    if len(faces) * len(used) > MOST_FACES**2:
        return f"a mesh with {len(faces)} faces"
    if not _is_flat(used) and _is_convex(points, faces, used):
        return hull(used)
    return _over_faces(points, faces, used)


def _over_faces(
    points: Points, faces: list[Face], used: Points
) -> tuple[Part, ...] | str:
    """One prism per face, each as high as the mesh."""
    bent = [len(face) for face in faces if not _is_flat_convex(points[face])]
    if max(bent, default=0) > MOST_CORNERS or sum(bent) > 10 * MOST_CORNERS:
        return "a mesh with too many non-convex faces"
    if len(faces) > MOST_FACES:
        return f"a non-convex mesh with {len(faces)} faces"
    low, high = float(used[:, 2].min()), float(used[:, 2].max())
    pieces = [piece for face in faces for piece in _convex_pieces(points[face])]
    shapes = [hull(piece)[0].shape for piece in pieces if _has_area(piece)]
    parts = tuple(Part(shape, low, high) for shape in dict.fromkeys(shapes))
    return parts or hull(used)


def _points(node: WbtNode) -> Points:
    coordinate = child(node, "coord")
    flat = () if coordinate is None else number_list(coordinate, "point")
    if coordinate is not None and len(flat) % 3:
        raise coordinate.error("expected x, y and z of each point", "point")
    return np.array(flat, np.float64).reshape(-1, 3)


def _faces(node: WbtNode, count: int) -> list[Face]:
    """Point indices of each face; faces of fewer than three points are dropped."""
    flat = np.array(number_list(node, "coordIndex"), np.float64)
    index = flat.astype(np.int64)
    if (index != flat).any() or (index < -1).any() or (index >= count).any():
        raise node.error(
            f"expected whole numbers below {count}, or -1, in coordIndex", "coordIndex"
        )
    pieces = np.split(index, np.flatnonzero(index == -1))
    faces = [piece[piece >= 0] for piece in pieces]
    return [face for face in faces if len(face) >= 3]


def _is_flat(points: Points) -> bool:
    """Whether all points lie in a plane."""
    return bool(np.linalg.svd(points - points.mean(axis=0))[1][-1] < THINNEST)


def _is_convex(points: Points, faces: list[Face], used: Points) -> bool:
    """Whether no face has points of the mesh on both sides of its plane."""
    for face in faces:
        normal = _normal(points[face])
        length = float(np.linalg.norm(normal))
        if length > 0.0:
            height = (used - points[face[0]]) @ (normal / length)
            if height.max() > THINNEST and height.min() < -THINNEST:
                return False
    return True


def _normal(corners: Points) -> Points:
    """Newell's normal; its length is twice the area."""
    at = corners - corners[0]
    return np.asarray(np.cross(at, np.roll(at, -1, axis=0)).sum(axis=0))


def _is_flat_convex(corners: Points) -> bool:
    """Whether a flat face turns in the same direction at every corner."""
    normal = _normal(corners)
    edge = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(edge, np.roll(edge, -1, axis=0)) @ normal
    return bool((turns >= -1e-9 * float(normal @ normal)).all())


def _convex_pieces(corners: Points) -> list[Points]:
    """A flat face as one piece if it is convex, else as triangles."""
    if len(corners) == 3 or _is_flat_convex(corners):
        return [corners]
    flat = np.delete(corners, int(np.abs(_normal(corners)).argmax()), axis=1)
    return [corners[list(triangle)] for triangle in _ears(flat)]


def _ears(outline: Points) -> list[tuple[int, int, int]]:
    """Triangulates a polygon, shape (n, 2), by ear clipping."""
    (x, y), (u, v) = outline.T, np.roll(outline, -1, axis=0).T
    left = list(range(len(outline)))
    if (x * v - u * y).sum() < 0.0:
        left.reverse()
    triangles = []
    while len(left) >= 3:
        ear = next((k for k in range(len(left)) if _is_ear(outline, left, k)), 0)
        before, after = left[ear - 1], left[(ear + 1) % len(left)]
        triangles.append((before, left.pop(ear), after))
    return triangles


def _is_ear(outline: Points, left: list[int], k: int) -> bool:
    """Whether corner `k` turns left and its triangle contains no other corner."""
    a, b, c = outline[[left[k - 1], left[k], left[(k + 1) % len(left)]]]
    others = outline[left]
    sides = [
        (q[0] - p[0]) * (others[:, 1] - p[1]) - (q[1] - p[1]) * (others[:, 0] - p[0])
        for p, q in ((a, b), (b, c), (c, a))
    ]
    turn = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
    inside = (np.array(sides) > 0.0).all(axis=0)
    return bool(turn >= 0.0 and not inside.any())


def _has_area(corners: Points) -> bool:
    """Whether a face has an area when seen from above."""
    return bool(abs(_normal(corners)[2]) > 2.0 * THINNEST**2)
