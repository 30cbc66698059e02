"""sensors.py: what a controller is given to see with."""

import ast
import math
import os
import shutil
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tdac_envs.controller_kit import sensors
from tdac_envs.map2d import rays
from tdac_envs.mapping.params import MapParams, RobotParams
from tdac_envs.mapping.ray_angles import fan

SOURCE = Path(sensors.__file__)


def squares(occ, reach):
    """Bounds (x0, y0, x1, y1) of every occupied square, the outside included."""
    rows, columns = np.nonzero(occ)
    inner = np.column_stack([columns - 0.5, rows - 0.5, columns + 0.5, rows + 0.5])
    h, w, far = occ.shape[0] - 0.5, occ.shape[1] - 0.5, 2 * reach + 99
    outer = [
        (-far, -far, -0.5, far + h),
        (w, -far, far + w, far + h),
        (-far, -far, far + w, -0.5),
        (-far, h, far + w, far + h),
    ]
    return np.vstack([inner, outer]).astype(float)


def slab_distance(boxes, x, y, angle, grow):
    """Distance to the nearest closed box along a ray, by the slab method."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        per_x, per_y = np.float64(1) / math.cos(angle), np.float64(1) / math.sin(angle)
        at_x = np.sort((boxes[:, 0::2] + [-grow, grow] - x) * per_x, axis=1)
        at_y = np.sort((boxes[:, 1::2] + [-grow, grow] - y) * per_y, axis=1)
    enter = np.maximum(np.maximum(at_x[:, 0], at_y[:, 0]), 0.0)
    leave = np.minimum(at_x[:, 1], at_y[:, 1])
    hits = enter[enter <= leave]
    return float(hits.min()) if hits.size else math.inf


def assert_exact(scene):
    """The ranges lie between those to slightly grown and slightly shrunk squares.

    A ray that runs along a border or through a corner meets the one and misses the
    other; for every other ray the two are the same number.
    """
    occ, x, y, heading, n_rays, fov_deg, range_max = scene
    sensor = sensors.Ultrasonic(occ, n_rays, fov_deg, range_max)
    ranges = sensor.ranges(x, y, heading)
    for i, value in enumerate(ranges):
        angle = heading + turns(n_rays, fov_deg)[i]
        low, high = bounds(occ, x, y, angle, range_max, 1e-7)
        assert low - 1e-4 <= value <= high + 1e-4, (i, value, low, high)


def turns(n_rays, fov_deg):
    """Angles of the rays of a fan from the heading."""
    if n_rays == 1:
        return [0.0]
    fov, gaps = math.radians(fov_deg), n_rays if fov_deg == 360.0 else n_rays - 1
    return [-fov / 2 + i * fov / gaps for i in range(n_rays)]


def bounds(occ, x, y, angle, range_max, grow):
    """The ranges of a ray to slightly grown and to slightly shrunk squares."""
    boxes = squares(occ, range_max)
    return [
        min(slab_distance(boxes, x, y, angle, by), range_max) for by in (grow, -grow)
    ]


@st.composite
def scenes(draw):
    """A grid, a place on it (often on or next to a border) and a fan."""
    height, width = draw(st.integers(1, 24)), draw(st.integers(1, 24))
    seed, density = draw(st.integers(0, 2**31)), draw(st.sampled_from([0, 0.1, 0.4]))
    occ = np.random.default_rng(seed).random((height, width)) < density
    kind = draw(st.sampled_from(["noise", "row", "column", "diagonal", "gap"]))
    if kind == "row":
        occ[draw(st.integers(0, height - 1))] = True
    elif kind == "column":
        occ[:, draw(st.integers(0, width - 1))] = True
    elif kind in ("diagonal", "gap"):
        occ |= np.eye(height, width, dtype=bool)
        if kind == "gap":
            occ[height // 2, :] = False
    halves, anywhere = st.integers(-1, 2 * 24), st.floats(-0.5, 24.0)
    near = st.tuples(halves, st.sampled_from([-1e-9, 1e-9, 1e-3])).map(
        lambda pair: pair[0] / 2 + pair[1]
    )
    place = st.one_of(halves.map(lambda k: k / 2), near, anywhere)
    eighths = st.integers(-8, 8).map(lambda k: k * math.pi / 8)
    heading = draw(st.one_of(eighths, st.floats(-7.0, 7.0, allow_subnormal=False)))
    n_rays = draw(st.integers(1, 19))
    fov = draw(st.sampled_from([55.0, 90.0, 110.0, 180.0, 360.0]))
    range_max = draw(st.sampled_from([3.0, 17.5, 220.0]))
    return occ, draw(place), draw(place), heading, n_rays, fov, range_max


@pytest.mark.slow
@settings(max_examples=400, deadline=None)
@given(scenes())
def test_ranges_equal_analytic_ray_and_square_intersections(scene):
    assert_exact(scene)


def is_through_a_corner(occ, x, y, angle, range_max, values):
    """Whether an oblique ray meets or misses a square by less than rounding.

    Then both values must lie between the range of a hit and that of a miss.
    """
    low, high = bounds(occ, x, y, angle, range_max, 1e-11)
    between = all(low - 1e-4 <= value <= high + 1e-4 for value in values)
    return between and min(abs(math.cos(angle)), abs(math.sin(angle))) > 1e-9


# A ray of this fan passes through corners of a diagonal wall.
DIAGONAL = np.eye(3, 4, dtype=bool)[::-1], 1.5, 1.5, -math.pi / 8, 9, 90.0, 17.5


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(scenes())
@example(DIAGONAL)
def test_ranges_equal_those_of_the_env(scene):
    """The controller's rays are the judge's rays, border cases included.

    The last digits may differ. So of an oblique ray exactly through a corner of a
    square, which rounding alone decides, one may end there and the other go on.
    """
    occ, x, y, heading, n_rays, fov_deg, range_max = scene
    leaps = rays.leaps_of(occ)
    out = np.empty(n_rays, np.float32)
    directions = rays.directions_of(fan(fov_deg, n_rays))
    rays.cast_rays(leaps, directions, x, y, heading, range_max, out)
    ours = sensors.Ultrasonic(occ, n_rays, fov_deg, range_max).ranges(x, y, heading)
    for i in np.nonzero(abs(ours - out) > 1e-4)[0]:
        angle, both = heading + turns(n_rays, fov_deg)[i], (ours[i], out[i])
        assert is_through_a_corner(occ, x, y, angle, range_max, both), (i, *both)


def test_ranges_in_open_space_equal_those_of_the_env():
    """Far from walls the env leaps; long rays along borders come out the same."""
    occ = np.zeros((300, 300), bool)
    occ[150:152, 40:260] = True
    leaps = rays.leaps_of(occ)
    out = np.empty(18, np.float32)
    sensor = sensors.Ultrasonic(occ)
    directions = rays.directions_of(fan(110.0, 18))
    for k in range(64):
        x, y, heading = 40.0 + 3.5 * k, 30.5 + k / 2, k * math.pi / 16
        rays.cast_rays(leaps, directions, x, y, heading, 220.0, out)
        np.testing.assert_allclose(sensor.ranges(x, y, heading), out, atol=1e-4)


def test_a_one_pixel_wall_stops_every_ray():
    occ = np.zeros((41, 41), bool)
    occ[:, 30] = True
    ranges = sensors.Ultrasonic(occ, 11, 60.0, 100.0).ranges(10.0, 20.0, 0.0)
    angles = np.radians(np.linspace(-30, 30, 11))
    np.testing.assert_allclose(ranges, 19.5 / np.cos(angles), rtol=1e-6)


def test_the_first_ray_is_the_robots_left():
    """Looking right on the screen, a wall above the robot is on its left."""
    occ = np.zeros((60, 60), bool)
    occ[10] = True
    ranges = sensors.Ultrasonic(occ, 3, 180.0, 40.0).ranges(30.0, 30.0, 0.0)
    np.testing.assert_allclose(ranges, [19.5, 29.5, 29.5])
    ranges = sensors.Ultrasonic(occ, 3, 180.0, 40.0).ranges(30.0, 30.0, math.pi)
    assert ranges[2] == 19.5


def test_a_single_ray_points_ahead():
    sensor = sensors.Ultrasonic(np.zeros((9, 9), bool), 1, 110.0, 50.0)
    assert sensor.angles.tolist() == [0.0]
    np.testing.assert_allclose(sensor.ranges(4.0, 4.0, math.pi / 2), [4.5])


@pytest.mark.parametrize("place", [(3, 3), (-5.0, 2.0), (2.0, 1e6), (-0.6, 0)])
def test_a_start_in_an_obstacle_or_outside_reads_zero(place):
    occ = np.zeros((6, 6), bool)
    occ[3, 3] = True
    assert not sensors.Ultrasonic(occ).ranges(*place, 0.3).any()


def test_ranges_are_float32_and_at_most_range_max():
    ranges = sensors.Ultrasonic(np.zeros((900, 900), bool)).ranges(450, 450, 1.0)
    assert ranges.dtype == np.float32
    assert ranges.shape == (18,)
    assert (ranges == 220.0).all()


def png(pixels, kinds):
    """A PNG whose row k has filter `kinds[k % len(kinds)]`."""
    height, width, channels = pixels.shape
    padded = np.zeros((height + 1, width + 1, channels), np.int64)
    padded[1:, 1:] = pixels
    here, left = padded[1:, 1:], padded[1:, :-1]
    up, corner = padded[:-1, 1:], padded[:-1, :-1]
    options = np.stack([left, up, corner])
    nearest = np.abs(left + up - corner - options).argmin(axis=0)
    paeth = np.take_along_axis(options, nearest[None], 0)[0]
    guesses = [np.zeros_like(here), left, up, (left + up) // 2, paeth]
    raw = b""
    for k in range(height):
        kind = kinds[k % len(kinds)]
        row = (here[k] - guesses[kind][k]) % 256
        raw += bytes([kind]) + row.astype(np.uint8).tobytes()
    head = struct.pack(">IIBBBBB", width, height, 8, {1: 0, 3: 2}[channels], 0, 0, 0)
    packed = zlib.compress(raw)
    half = len(packed) // 2
    parts = [(b"IHDR", head), (b"tEXt", b"k\0v"), (b"IDAT", packed[:half])]
    parts += [(b"IDAT", packed[half:]), (b"IEND", b"")]
    chunks = [
        struct.pack(">I", len(body))
        + name
        + body
        + struct.pack(">I", zlib.crc32(name + body))
        for name, body in parts
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("kinds", [[0], [1], [2], [3], [4], [0, 4, 3, 2, 1, 4]])
def test_every_png_filter_decodes_as_in_opencv(tmp_path, channels, kinds):
    rng = np.random.default_rng(7)
    pixels = rng.integers(0, 256, (13, 17, channels), np.uint8)
    file = tmp_path / "map.png"
    file.write_bytes(png(pixels, kinds))
    expected = cv2.imread(str(file), cv2.IMREAD_COLOR)[..., ::-1]
    assert (expected == pixels).all()
    occupied = sensors.load_occupancy(file)
    np.testing.assert_array_equal(occupied, expected.mean(axis=2) < 128)
    assert occupied.dtype == np.bool_


@pytest.mark.parametrize("channels", [1, 3])
def test_maps_written_by_opencv_come_back(tmp_path, channels):
    occ = np.random.default_rng(1).random((37, 53)) < 0.3
    image = np.where(occ, 0, 255).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "o.png"), np.dstack([image] * channels))
    np.save(tmp_path / "o.npy", occ)
    for name in ("o.png", "o.npy"):
        np.testing.assert_array_equal(sensors.load_occupancy(tmp_path / name), occ)


@pytest.mark.parametrize(
    "image",
    [np.zeros((4, 4), np.uint16), np.zeros((4, 4, 4), np.uint8)],
    ids=["16-bit", "alpha"],
)
def test_other_pngs_are_refused(tmp_path, image):
    cv2.imwrite(str(tmp_path / "o.png"), image)
    with pytest.raises(ValueError, match="expected 8-bit grey or RGB"):
        sensors.load_occupancy(tmp_path / "o.png")


def test_a_file_that_is_no_png_is_refused(tmp_path):
    (tmp_path / "o.png").write_bytes(b"BM not a png")
    with pytest.raises(ValueError, match="expected a PNG file"):
        sensors.load_occupancy(tmp_path / "o.png")


def test_imports_only_the_standard_library_and_numpy():
    """Others are imported inside Graphics and show alone."""
    tree = ast.parse(SOURCE.read_text())
    allowed = sys.stdlib_module_names | {"numpy"}
    for node in tree.body:
        if isinstance(node, ast.Import):
            assert {alias.name.split(".")[0] for alias in node.names} <= allowed
        if isinstance(node, ast.ImportFrom):
            assert node.module.split(".")[0] in allowed


def test_a_copy_runs_alone_with_numpy_beside_its_files(tmp_path):
    """No site packages but numpy; files are found beside the copy, not in the cwd."""
    packages = tmp_path / "packages"
    packages.mkdir()
    for folder in Path(np.__file__).parents[1].glob("numpy*"):
        (packages / folder.name).symlink_to(folder)
    work = tmp_path / "work"
    work.mkdir()
    shutil.copy(SOURCE, work)
    np.save(work / "occupancy.npy", np.eye(5, dtype=bool))
    (work / "params.json").write_text('{"goal": [1.5, 2.0]}')
    code = (
        f"import sys; sys.path[:0] = [{str(packages)!r}, {str(work)!r}]\n"
        "import sensors\n"
        "occ = sensors.load_occupancy()\n"
        "print(occ.sum(), sensors.load_params()['goal'])\n"
        "print(sensors.Ultrasonic(occ, 1).ranges(3, 0, 0.0)[0])\n"
    )
    command = [sys.executable, "-I", "-S", "-c", code]
    run = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.stdout.split() == ["5", "[1.5,", "2.0]", "1.5"], run.stderr


def test_graphics_shows_map_robot_and_left_ray(monkeypatch):
    """The window draws what it is given and goes on until it is closed."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = pytest.importorskip("pygame")
    occ = np.zeros((100, 200), bool)
    occ[:5] = True
    robot = {"radius": 10.0, "field_of_view_deg": 110.0}
    params = {"robot": robot, "start": [50, 50], "goal": [150, 50]}
    window = sensors.Graphics(occ, params, robot_image="missing.png")
    ranges = sensors.Ultrasonic(occ).ranges(50, 50, 0.0)
    assert window.draw((50.0, 50.0, 0.0), ranges)
    picture = pygame.surfarray.array3d(pygame.display.get_surface())
    assert picture.shape == (800, 400, 3)
    assert picture[400, 4].tolist() == [51, 60, 76]
    assert picture[700, 350].tolist() == [248, 247, 243]
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    assert not window.draw(np.array([60.0, 50.0, 0.1]), ranges)
    window.close()


def test_graphics_names_the_command_when_pygame_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match="pip install pygame-ce"):
        sensors.Graphics(np.zeros((5, 5), bool), {"robot": {}})


def test_show_names_the_command_when_the_simulator_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(SystemExit, match="use the Python that has tdac"):
        sensors.show(lambda obs: (0.0, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("action", "outcome"),
    [((1.0, 1.0), "reached"), ((-1.0, -1.0), "collided")],
)
def test_show_films_the_episode_and_says_how_it_ended(tmp_path, action, outcome):
    """Without a display, `python controller.py` leaves a film beside itself."""
    shutil.copy(SOURCE, tmp_path)
    np.save(tmp_path / "occupancy.npy", np.zeros((60, 160), bool))
    params = MapParams(
        source="none.png",
        source_sha256="0" * 64,
        width=160,
        height=60,
        start=(30, 30),
        goal=(120, 30),
        robot=RobotParams.disc(10.0),
        polarity="given",
        method="none",
    )
    params.save(tmp_path / "params.json")
    (tmp_path / "controller.py").write_text(
        "import sensors\n"
        f"sensors.show(lambda obs: {action}, reset=lambda obs: print('new'))\n"
    )
    root = SOURCE.parents[1]
    env = {k: v for k, v in os.environ.items() if "DISPLAY" not in k}
    run = subprocess.run(
        [sys.executable, str(tmp_path / "controller.py")],
        env=env | {"PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=False,
    )
    lines = run.stdout.splitlines()
    assert lines[0] == "new", run.stderr
    assert lines[1] == f"no display: wrote {tmp_path / 'controller.mp4'} (in real time)"
    assert lines[2].startswith(outcome)
    assert (tmp_path / "controller.mp4").stat().st_size > 1000
