"""Promises of footprints: shapes anywhere in space, against sampled 3D points."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from world_texts import text

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle, frame, ring, wrap_angle
from tdac_envs.worlds.wbt.frames import axis_angle
from tdac_envs.worlds.wbt.reader import read_world
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, World

WAYS = np.linspace(0, 2 * np.pi, 72, endpoint=False)
DIRECTIONS = np.column_stack([np.cos(WAYS), np.sin(WAYS)])
COARSE = 0.004
"""How far the polygon around an ellipse may leave it, by its size."""

angles = st.floats(-7, 7, allow_nan=False)
axes = st.tuples(*[st.floats(-1, 1, allow_nan=False)] * 3).filter(
    lambda axis: np.linalg.norm(axis) > 0.05
)
lengths = st.floats(0.01, 2, allow_nan=False)
places = st.tuples(*[st.floats(-3, 3, allow_nan=False)] * 3)
upright = st.sampled_from([(0, 0, 1), (0, 0, -1), (0, 0, 2)])
turns = st.one_of(
    st.tuples(axes, angles),
    st.tuples(upright, angles),
    st.tuples(
        st.sampled_from([(1, 0, 0), (0, -1, 0), (1, 1, 1)]), st.just(math.pi / 2)
    ),
    st.tuples(st.just((1, 1, 1)), st.just(2.0944)),
)


def reach(parts):
    """Support function of the union of footprints in all directions."""
    values = []
    for part in parts:
        shape = part.shape
        if isinstance(shape, Disc):
            values.append(DIRECTIONS @ (shape.x, shape.y) + shape.radius)
        else:
            values.append((DIRECTIONS @ shape.vertices.T).max(axis=1))
    return np.max(values, axis=0)


def solid(body, *, scale="1 1 1", translation=(0, 0, 0), turn=((0, 0, 1), 0)):
    """The pieces of a Solid with a boundingObject."""
    (x, y, z), (axis, angle) = translation, turn
    content = text(
        f"Transform {{ scale {scale} children Solid {{ translation {x!r} {y!r} {z!r} "
        f"rotation {' '.join(map(repr, (*axis, angle)))} boundingObject {body} }} }}"
    )
    (obstacle,) = read_world(content).obstacles
    return obstacle.solid


def in_world(points, translation, turn):
    """What SciPy makes of a translation and an axis with an angle."""
    axis, angle = np.array(turn[0], float), turn[1]
    spin = Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle)
    return spin.apply(points) + translation


def agrees(parts, points, tolerance):
    """Same reach in all directions, and same heights, as a cloud of points."""
    wanted = (DIRECTIONS @ points[:, :2].T).max(axis=1)
    np.testing.assert_allclose(reach(parts), wanted, rtol=0, atol=tolerance)
    near = max(tolerance, 2e-3)
    assert min(p.bottom for p in parts) == pytest.approx(points[:, 2].min(), abs=near)
    assert max(p.top for p in parts) == pytest.approx(points[:, 2].max(), abs=near)


def ball(count=4000):
    """Points on the unit sphere."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def rims(radius, heights):
    """Points on circles across z."""
    around = np.linspace(0, 2 * np.pi, 2000)
    circle = np.column_stack([np.cos(around), np.sin(around)]) * radius
    return np.vstack([np.column_stack([circle, np.full(2000, z)]) for z in heights])


@given(axis=axes, angle=angles)
def test_rotations_are_those_of_scipy(axis, angle):
    """Axes of any length, angles of any size, right-handed."""
    unit = np.array(axis) / np.linalg.norm(axis)
    wanted = Rotation.from_rotvec(unit * angle).as_matrix()
    np.testing.assert_allclose(axis_angle(*axis, angle), wanted, atol=1e-12)


def test_no_axis_is_no_rotation():
    """Webots files hold `0 0 0 0`."""
    np.testing.assert_array_equal(axis_angle(0, 0, 0, 1.0), np.eye(3))


@settings(deadline=None)
@given(size=st.tuples(lengths, lengths, lengths), place=places, turn=turns)
def test_boxes(size, place, turn):
    """The footprint is the hull of the eight projected corners."""
    corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T * size
    parts = solid(f"Box {{ size {' '.join(map(repr, size))} }}",
                  translation=place, turn=turn)  # fmt: skip
    agrees(parts, in_world(corners, place, turn), 3e-5)


@settings(deadline=None)
@given(radius=lengths, place=places, turn=turns)
def test_spheres(radius, place, turn):
    """A disc, however the sphere is turned."""
    (part,) = solid(f"Sphere {{ radius {radius!r} }}", translation=place, turn=turn)
    assert isinstance(part.shape, Disc)
    assert (part.shape.x, part.shape.y) == pytest.approx(place[:2], abs=1e-8)
    assert part.shape.radius == pytest.approx(radius, abs=1e-8)
    assert (part.bottom, part.top) == pytest.approx(
        (place[2] - radius, place[2] + radius), abs=1e-8
    )


@settings(deadline=None)
@given(radius=lengths, height=lengths, place=places, turn=turns)
def test_cylinders(radius, height, place, turn):
    """Upright a disc, lying a rectangle, else the hull of both rims."""
    body = f"Cylinder {{ radius {radius!r} height {height!r} }}"
    parts = solid(body, translation=place, turn=turn)
    points = in_world(rims(radius, (-height / 2, height / 2)), place, turn)
    agrees(parts, points, COARSE * radius + 3e-5)


@pytest.mark.slow
@settings(deadline=None)
@given(radius=lengths, height=lengths, place=places, turn=turns)
def test_capsules(radius, height, place, turn):
    """Upright a disc, else two discs and what lies between them."""
    body = f"Capsule {{ radius {radius!r} height {height!r} }}"
    parts = solid(body, translation=place, turn=turn)
    ends = [ball() * radius + (0, 0, side * height / 2) for side in (-1, 1)]
    agrees(parts, in_world(np.vstack(ends), place, turn), 3e-3 * radius + 3e-5)


@settings(deadline=None)
@given(radius=lengths, height=lengths, turn=turns)
def test_cones_are_seen(radius, height, turn):
    """A Cone has no place in a boundingObject, but sensors see it."""
    spin = " ".join(map(repr, (*turn[0], turn[1])))
    content = text(
        f"Pose {{ rotation {spin} children Shape {{ geometry Cone "
        f"{{ bottomRadius {radius!r} height {height!r} }} }} }}"
    )
    (obstacle,) = read_world(content).obstacles
    assert obstacle.solid == ()
    points = np.vstack([rims(radius, [-height / 2]), [[0, 0, height / 2]]])
    agrees(obstacle.visible, in_world(points, (0, 0, 0), turn), COARSE * radius + 3e-5)


@pytest.mark.slow
@settings(deadline=None)
@given(scale=st.tuples(lengths, lengths, lengths), turn=turns)
def test_scaled_spheres_are_ellipsoids(scale, turn):
    """A Transform may scale unevenly, around what is turned."""
    parts = solid("Sphere { radius 1 }", scale=" ".join(map(repr, scale)), turn=turn)
    agrees(parts, ball() * scale, 3e-3 * max(scale) + COARSE * max(scale) + 3e-5)


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 2**32 - 1), turn=turns)
def test_convex_meshes(seed, turn):
    """One prism over the hull of their points."""
    points = np.round(np.random.default_rng(seed).normal(size=(12, 3)), 3)
    hull = ConvexHull(points)
    index = " ".join(f"{a} {b} {c} -1" for a, b, c in hull.simplices)
    listed = ", ".join(" ".join(map(repr, p)) for p in points.tolist())
    body = (
        f"IndexedFaceSet {{ coord Coordinate {{ point [ {listed} ] }} "
        f"coordIndex [ {index} ] }}"
    )
    parts = solid(body, turn=turn)
    assert len(parts) == 1
    agrees(parts, in_world(points[hull.vertices], (0, 0, 0), turn), 1e-6)


def painted(shapes, scale=400, half=1.5):
    """A picture of footprints, True = covered."""
    size = round(2 * half * scale)
    layer = np.zeros((size, size), np.uint8)
    for shape in shapes:
        corners = np.asarray(shape)
        fixed = np.rint((corners + half) * scale * 16).astype(np.int32)
        cv2.fillPoly(layer, [fixed], 1, shift=4)
    return layer > 0


ELL = [(0, 0), (1, 0), (1, 0.2), (0.2, 0.2), (0.2, 0.9), (0, 0.9)]
SPIRAL = [
    (-1, -1), (1, -1), (1, 1), (-0.6, 1), (-0.6, -0.5), (0.5, -0.5), (0.5, 0.5),
    (0, 0.5), (0, 0.3), (0.3, 0.3), (0.3, -0.3), (-0.4, -0.3), (-0.4, 0.8), (0.8, 0.8),
    (0.8, -0.8), (-1, -0.8),
]  # fmt: skip


@pytest.mark.parametrize(
    "outline", [ELL, ELL[::-1], SPIRAL], ids=["ell", "back", "spiral"]
)
@pytest.mark.parametrize("flat", [True, False], ids=["flat", "tall"])
def test_meshes_that_are_not_convex_keep_their_notches(outline, flat):
    """Faces are cut to convex pieces that cover the outline, and nothing else."""
    n = len(outline)
    floor = [f"{x} {y} 0" for x, y in outline]
    top = [] if flat else [f"{x} {y} 0.5" for x, y in outline]
    faces = [list(range(n))]
    if not flat:
        faces += [list(range(n, 2 * n))]
        faces += [[k, (k + 1) % n, (k + 1) % n + n, k + n] for k in range(n)]
    index = " -1 ".join(" ".join(map(str, face)) for face in faces)
    parts = solid(
        f"IndexedFaceSet {{ coord Coordinate {{ point [ {', '.join(floor + top)} ] }} "
        f"coordIndex [ {index} ] }}"
    )
    ours, wanted = painted([part.shape.vertices for part in parts]), painted([outline])
    assert (ours & wanted).sum() / (ours | wanted).sum() > 0.985
    heights = {(part.bottom, part.top) for part in parts}
    assert heights == ({(-0.0001, 0.0)} if flat else {(0.0, 0.5)})


def test_a_mesh_beyond_all_bounds_is_not_modelled():
    """It is listed with the number of its faces, and may be solid."""
    rng = np.random.default_rng(1)
    points = ", ".join(
        " ".join(map(str, p)) for p in rng.normal(size=(600, 3)).round(3)
    )
    index = " -1 ".join(
        " ".join(map(str, rng.integers(600, size=3))) for _ in range(1100)
    )
    mesh = f"IndexedFaceSet {{ coord Coordinate {{ point [ {points} ] }} "
    world = read_world(
        text(f"Solid {{ boundingObject {mesh} coordIndex [ {index} ] }} }}")
    )
    (node,) = world.unmodelled
    assert node.may_be_solid
    assert node.why.startswith(
        "its boundingObject is a non-convex mesh with 1100 faces"
    )


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(3, 40))
def test_hulls_are_those_of_qhull(seed, count):
    """Same area and the same corners as SciPy finds."""
    points = np.random.default_rng(seed).normal(size=(count, 2)).round(6)
    polygon, hull = Polygon.around(points), ConvexHull(points)
    assert polygon.area == pytest.approx(hull.volume, rel=1e-9)
    wanted = {tuple(p) for p in points[hull.vertices].tolist()}
    assert set(polygon.points) == wanted
    assert Polygon(polygon.points) == Polygon.around(polygon.vertices) == polygon


def test_polygons_are_convex_and_in_order():
    """Anything else is refused."""
    with pytest.raises(WorldError, match="convex polygon, counter-clockwise"):
        Polygon(((0, 0), (0, 1), (1, 0)))
    with pytest.raises(WorldError, match="convex polygon, counter-clockwise"):
        Polygon(((0, 0), (2, 0), (1, 0.1), (0, 2)))
    with pytest.raises(WorldError, match="convex polygon"):
        Polygon.around([(0, 0), (1, 1), (2, 2)])
    with pytest.raises(WorldError, match="finite"):
        Polygon.around([(0, 0), (1, math.nan), (2, 2)])


@given(x=places, yaw=angles, length=lengths, width=lengths)
def test_a_rectangle_has_one_form(x, yaw, length, width):
    """Turned by half a turn, or with its sides in the other order, it is equal."""
    one = Rectangle(x[0], x[1], yaw, length, width)
    assert one == Rectangle(one.x, one.y, one.yaw, one.length, one.width)
    assert one == Rectangle(one.x, one.y, one.yaw + math.pi / 2, one.width, one.length)
    turned = math.atan2(math.sin(one.yaw), math.cos(one.yaw))
    assert one == Rectangle(one.x, one.y, turned, one.length, one.width)
    assert one.length >= one.width
    assert one.area == pytest.approx(abs(signed_area(one.vertices)), abs=1e-9)
    assert signed_area(one.vertices) > 0


def signed_area(corners):
    (x, y), (u, v) = corners.T, np.roll(corners, -1, axis=0).T
    return (x * v - u * y).sum() / 2


@given(angle=angles)
def test_headings_are_wrapped_once_and_for_all(angle):
    """Into (-pi, pi]; doing it again changes nothing."""
    heading = wrap_angle(angle)
    assert -math.pi < heading <= math.pi
    assert math.cos(heading - angle) == pytest.approx(1.0)
    assert wrap_angle(heading) == heading
    assert wrap_angle(math.atan2(math.sin(heading), math.cos(heading))) == heading


def test_half_a_turn_is_pi():
    assert (
        wrap_angle(math.pi)
        == wrap_angle(-math.pi)
        == wrap_angle(3 * math.pi)
        == math.pi
    )


@given(
    shape=st.one_of(
        st.builds(Disc, *[st.floats(-1, 1)] * 2, lengths),
        st.builds(Rectangle, *[st.floats(-1, 1)] * 2, angles, lengths, lengths),
    ),
    seed=st.integers(0, 1000),
)
def test_what_a_footprint_contains(shape, seed):
    """Points of its inside are in it, points beyond its bounds are not."""
    rng = np.random.default_rng(seed)
    left, low, right, high = shape.bounds
    if isinstance(shape, Disc):
        turn, far = rng.uniform(0, 7), shape.radius * rng.uniform(0, 0.99)
        inner = (shape.x + far * math.cos(turn), shape.y + far * math.sin(turn))
    else:
        share = rng.dirichlet(np.ones(4))
        inner = tuple(share @ shape.vertices)
        hull = Polygon.around(shape.vertices)
        assert hull.contains(*inner)
        assert hull.bounds == pytest.approx(shape.bounds, abs=2e-9)
    assert shape.contains(*inner)
    assert left <= inner[0] <= right
    assert low <= inner[1] <= high
    assert not shape.contains(right + 0.01, inner[1])
    assert not shape.contains(inner[0], low - 0.01)


@pytest.mark.parametrize("facets", [8, 24, 48])
@pytest.mark.parametrize("thickness", [0.001, 0.01, 0.3])
def test_a_round_wall_touches_its_disc(facets, thickness):
    """No piece reaches into the disc, each touches it, and no gap is between two."""
    pieces = ring(0.3, -0.2, 1.0, 1.0 + thickness, facets)
    for piece in pieces:
        corners = piece.vertices - (0.3, -0.2)
        edge = np.roll(corners, -1, axis=0) - corners
        along = np.linspace(0, 1, 51)[:, None, None]
        far = np.hypot(*np.moveaxis(corners + along * edge, 2, 0))
        assert far.min() == pytest.approx(1.0, abs=1e-8)
    for one, other in zip(pieces, pieces[1:] + pieces[:1], strict=True):
        assert len(set(one.points) & set(other.points)) == 2


def test_walls_of_a_rectangle_stand_outside_the_floor():
    """They cover a frame with its corners, and nothing of the floor."""
    floor = Rectangle(0.1, -0.1, 0.4, 1.2, 0.8)
    outer = Rectangle(0.1, -0.1, 0.4, 1.4, 1.0)
    walls = frame(floor, 0.1)
    for x, y in np.random.default_rng(0).uniform(-1, 1, (2000, 2)):
        wanted = outer.contains(x, y) and not floor.contains(x, y)
        assert any(wall.contains(x, y) for wall in walls) == wanted


def test_values_are_checked():
    """Each error says what was expected."""
    part = Part(Disc(0, 0, 1), 0.0, 1.0)
    with pytest.raises(WorldError, match="expected radius above 0, got -1 m"):
        Disc(0, 0, -1)
    with pytest.raises(WorldError, match="expected x to be a finite number, got nan"):
        Disc(math.nan, 0, 1)
    with pytest.raises(WorldError, match="expected a bottom below the top"):
        Part(Disc(0, 0, 1), 1.0, 0.0)
    with pytest.raises(WorldError, match="expected a mass above 0"):
        Obstacle("", "Solid", 0, 0, (part,), mass=0.0)
    with pytest.raises(WorldError, match=r"reflectance 0\.1 is not in \[0\.2, 1\]"):
        Obstacle("", "Solid", 0, 0, (part,), reflectance=0.1)
    with pytest.raises(WorldError, match='expected version "1" or "2"'):
        EPuck("", 0, 0, 0, version="3")
    with pytest.raises(WorldError, match="a wall needs thickness and height"):
        Arena(Rectangle(0, 0, 0, 1, 1), 0.1, 0.0)
    with pytest.raises(WorldError, match="a round arena with a wall"):
        Arena(Disc(0, 0, 1))
    with pytest.raises(WorldError, match="expected a time step above 0"):
        World(time_step=0)
    with pytest.raises(WorldError, match="an obstacle marks the goal, but"):
        World(obstacles=(Obstacle("", "Solid", 0, 0, is_goal=True),))
    with pytest.raises(WorldError, match="no e-puck in it"):
        World().robot  # noqa: B018


def test_flat_parts_get_a_thickness():
    """A plane is 0.1 mm thick, below where it lies."""
    part = Part(Disc(0, 0, 1), 0.2, 0.2)
    assert (part.bottom, part.top) == (0.1999, 0.2)
