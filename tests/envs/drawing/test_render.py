"""Pictures: everything is where it belongs, at every size of map."""

import math
import re
import sys

import cv2
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled

from tdac_envs.controller_kit.sensors import Ultrasonic
from tdac_envs.core.extras import install_command
from tdac_envs.drawing.canvas import FREE, GREEN, RED, TRAIL, WALL, Canvas, frame_scale
from tdac_envs.drawing.marks import LEFT_RAYS, OUTCOMES, RIGHT_RAYS
from tdac_envs.drawing.runs import Status, run_colour, run_widths
from tdac_envs.drawing.window import Window
from tdac_envs.map2d.picture import MapScene
from tdac_envs.map2d.run_picture import trajectory_picture
from tdac_envs.mapping.params import RobotParams

MAP = np.zeros((400, 500), bool)
MAP[:8] = MAP[-8:] = True
MAP[:, :8] = MAP[:, -8:] = True
MAP[200:208, 100:400] = True
START, GOAL = (60.0, 100.0, 0.0), (420.0, 300.0)


def make_scene(cells=MAP, radius=15.0, **options):
    settings = {"goal_tolerance": 20.0, "robot": RobotParams.disc(radius)}
    return MapScene(cells, START, GOAL, **(settings | options))


def near(image, colour, tolerance=12):
    """(x, y) of the pixels of about this colour."""
    close = np.abs(image.astype(int) - colour).max(axis=2) <= tolerance
    return np.column_stack(np.nonzero(close)[::-1])


def tint(image, base, colour):
    """Mask of the pixels that are `base` shifted towards `colour`."""
    towards = np.array(colour, float) - FREE
    shift = image.astype(float) - base.astype(float)
    along = shift @ towards / (np.linalg.norm(towards) ** 2)
    off = np.abs(shift - along[..., None] * towards).max(axis=2)
    return (along > 0.05) & (off < 6)


@pytest.mark.parametrize(
    ("shape", "scale"),
    [
        ((650, 850), 1.0),
        ((100, 120), 7.0),
        ((1, 1), 900.0),
        ((2600, 3400), 1200 / 3400),
        ((301, 30), 2.0),
        ((5000, 40), 0.24),
        ((299, 1199), 1.0),
    ],
)
def test_frames_are_even_and_of_a_handy_size(shape, scale):
    """Small maps grow by a whole factor, huge ones shrink, video codecs are happy."""
    canvas = Canvas(np.zeros(shape, bool))
    rows, columns, channels = canvas.image.shape
    assert frame_scale(shape[1], shape[0]) == pytest.approx(scale)
    assert channels == 3
    assert rows % 2 == 0
    assert columns % 2 == 0
    assert 320 <= columns <= 1200
    assert canvas.image.dtype == np.uint8


def test_walls_and_floor_have_their_colours_and_the_map_is_not_mirrored():
    cells = np.zeros((400, 500), bool)
    cells[50:60, 300:400] = True
    image = Canvas(cells).image
    assert image[55, 350].tolist() == list(WALL)
    assert image[300, 100].tolist() == list(FREE)
    assert image[350, 55].tolist() == list(FREE)


def test_map_points_meet_the_squares_they_stand_for():
    """Pixel (i, j) of a map enlarged s times covers frame pixels s*i .. s*i + s-1."""
    cells = np.zeros((100, 120), bool)
    cells[30, 40] = True
    canvas = Canvas(cells)
    assert near(canvas.image[: canvas.strip_top], WALL, 0).min(axis=0).tolist() == [
        280,
        210,
    ]
    assert canvas.to_frame((39.5, 29.5))[0].tolist() == [279.5, 209.5]
    assert canvas.to_frame((40, 30))[0].tolist() == [283.0, 213.0]


def test_one_pixel_walls_stay_visible_on_huge_maps():
    cells = np.zeros((2000, 3000), bool)
    cells[1000, 500:2500] = True
    image = Canvas(cells).image
    assert (image[350:450, 600].min(axis=0) < 170).all()


@pytest.mark.parametrize("heading", [0.0, math.pi / 2, math.pi, -2.0])
def test_left_rays_are_blue_and_on_the_robots_left(heading):
    """At heading 0 (looking right) the blue half lies above the robot."""
    cells, pose = np.zeros((600, 600), bool), (300.0, 300.0, heading)
    scene = MapScene(
        cells, START, GOAL, goal_tolerance=20.0, robot=RobotParams.disc(15.0)
    )
    ranges = Ultrasonic(cells).ranges(*pose)
    base, image = scene.frame(pose)[:600], scene.frame(pose, ranges)[:600]
    ahead = np.array([math.cos(heading), math.sin(heading)])
    left = np.array([ahead[1], -ahead[0]])
    for colour, side in ((LEFT_RAYS, left), (RIGHT_RAYS, -left)):
        rows, columns = np.nonzero(tint(image, base, colour))
        offsets = np.column_stack([columns, rows]) - 300.0
        assert len(offsets) > 5000
        assert (offsets @ side > -2).all()
        assert (offsets @ ahead > 0).all()


def test_the_robot_picture_turns_with_the_heading(tmp_path):
    """The picture looks right; at heading pi/2 its nose points down."""
    picture = np.zeros((64, 64, 4), np.uint8)
    picture[..., 3] = 255
    picture[:, 48:] = (0, 0, 255, 255)
    cv2.imwrite(str(tmp_path / "robot.png"), picture)
    scene = make_scene(robot_image=tmp_path / "robot.png")
    for heading in (0.0, math.pi / 2, 2.5):
        image = scene.frame((250.0, 100.0, heading))
        middle = near(image, (255, 0, 0), 40).mean(axis=0) - (250.0, 100.0)
        direction = np.array([math.cos(heading), math.sin(heading)])
        np.testing.assert_allclose(middle, 11.25 * direction, atol=1.0)


@pytest.mark.parametrize("kind", ["missing", "grey", "broken"])
def test_any_robot_picture_will_do(tmp_path, kind):
    """Grey pictures are shown; unreadable ones give way to a disc."""
    file = tmp_path / "robot.png"
    if kind == "grey":
        cv2.imwrite(str(file), np.full((40, 20), 90, np.uint8))
    elif kind == "broken":
        file.write_bytes(b"no picture")
    image = make_scene(robot_image=file).frame((250.0, 100.0, 0.3))
    assert len(near(image, (90, 90, 90) if kind == "grey" else TRAIL, 2)) > 150


@pytest.mark.parametrize("radius", [0.4, 3.0, 5.9])
def test_a_tiny_robot_is_visible_and_ringed(tmp_path, radius):
    scene = make_scene(radius=radius)
    pose = (250.0, 100.0, 0.0)
    changed = np.abs(scene.frame(pose).astype(int) - Canvas(MAP).image).max(axis=2)
    rows, columns = np.nonzero(changed[90:111, 235:266] > 40)
    assert len(rows) > 40
    assert columns.max() - columns.min() >= 16


def test_goal_start_path_and_trail_are_drawn():
    path = [(60, 100), (60, 300), (420, 300)]
    image = make_scene(path=path).frame(
        (200.0, 100.0, 0.0), trail=[START[:2], (200, 100)]
    )
    plain = Canvas(MAP).image
    changed = np.abs(image.astype(int) - plain).max(axis=2) > 25
    assert changed[300, 440]  # goal ring
    assert changed[300, 420]  # goal
    assert changed[100, 120]  # trail
    along = changed[300, 100:380]
    assert 0.3 < along.mean() < 0.75  # dashes and gaps
    assert not changed[250:280, 100:380].any()


@pytest.mark.parametrize("outcome", list(OUTCOMES))
def test_the_outcome_is_marked_on_the_robot_and_in_the_strip(outcome):
    scene, pose = make_scene(), (250.0, 100.0, 0.0)
    running = scene.frame(pose, status=Status(7, 2500, 260.0))
    ended = scene.frame(pose, status=Status(7, 2500, 260.0, outcome))
    places = near(ended, OUTCOMES[outcome], 30)
    strip = Canvas(MAP).strip_top
    assert (places[:, 1] >= strip).sum() > 20
    around = np.hypot(*(places - (250, 100)).T) < 22
    assert around.sum() > 40
    assert len(near(running, OUTCOMES[outcome], 30)) < len(places)


def test_the_strip_leaves_the_map_alone():
    scene, pose = make_scene(), (250.0, 100.0, 0.0)
    strip = Canvas(MAP).strip_top
    bare, full = scene.frame(pose), scene.frame(pose, status=Status(7, 2500, 260.0))
    assert strip == 400
    assert (bare[:strip] == full[:strip]).all()
    assert (bare[strip:] != full[strip:]).any()


def test_frames_do_not_touch_one_another():
    scene = make_scene()
    first = scene.frame((100.0, 100.0, 0.0), status=Status(0, 9, 1.0))
    kept = first.copy()
    scene.frame((300.0, 300.0, 1.0), status=Status(1, 9, 1.0, "collision"))
    again = scene.frame((100.0, 100.0, 0.0), status=Status(0, 9, 1.0))
    assert (first == kept).all()
    assert (first == again).all()


@pytest.mark.parametrize(
    "pose",
    [(0.0, 0.0, 0.0), (499.4, 399.4, 3.0), (-300.0, 50.0, 1.0), (250.0, 900.0, 0.0)],
)
def test_places_at_and_past_the_border_are_clipped(pose):
    ranges = np.full(18, 220.0)
    status = Status(1, 2, 3.0, "collision")
    image = make_scene().frame(pose, ranges, [START[:2], pose[:2]], status)
    assert image.shape == (430, 500, 3)


@pytest.mark.parametrize("n_rays", [0, 1, 2, 3, 64])
def test_any_number_of_rays_can_be_drawn(n_rays):
    robot = RobotParams(n_rays=max(n_rays, 1), field_of_view_deg=360.0)
    scene, pose = make_scene(robot=robot), (250.0, 100.0, 0.0)
    rays = (scene.frame(pose, np.full(n_rays, 50.0)) != scene.frame(pose)).any()
    assert rays == (n_rays > 0)


def spiral(turns, x, y):
    angles = np.linspace(0, 2 * np.pi * turns, 200)
    points = np.column_stack([np.cos(angles), np.sin(angles)]) * 3 * angles[:, None]
    return np.column_stack([np.add(points, (x, y)), angles])


def test_trajectories_have_a_line_a_body_an_end_and_a_legend():
    runs = [spiral(2, 250, 100), spiral(1, 150, 300), spiral(1, 350, 300)]
    image = trajectory_picture(
        MAP,
        runs,
        START,
        GOAL,
        goal_tolerance=20.0,
        radius=12.0,
        path=[(60, 100), (60, 300), (420, 300)],
        outcomes=["reached", "collision", "out of time"],
        labels=["nominal", "jitter 1", "jitter 2"],
    )
    assert image.shape[1] == 500
    for run, colour in zip(runs, (GREEN, RED, OUTCOMES["out of time"]), strict=True):
        gaps = np.hypot(*(near(image, colour, 30) - run[-1, :2]).T)
        assert (gaps < 17).sum() > 50
    strip = image[400:]
    for number, width in enumerate((4, 1, 1)):
        assert len(near(strip, run_colour(number), 0)) == 18 * width


def test_the_nominal_trajectory_stands_out():
    """It is strong and alone shows its room; trajectories without one are alike."""
    assert run_widths(3, ["jitter 1", "nominal", "jitter 2"]) == [1, 4, 1]
    assert run_widths(2, ["one", "two"]) == [2, 2]
    assert run_widths(1, ["nominal"]) == [2]
    assert run_widths(3, ["jitter 1"]) == [2, 2, 2]
    options = {"goal_tolerance": 20.0, "radius": 12.0}
    runs = [spiral(1, 250, 100), spiral(1, 250, 100)]
    images = [
        trajectory_picture(MAP, runs, START, GOAL, labels=labels, **options)[:400]
        for labels in (["nominal", "jitter 1"], ["jitter 1", "nominal"])
    ]
    for number, image in enumerate(images):
        assert len(near(image, run_colour(number), 40)) > 400
        assert len(near(image, run_colour(1 - number), 40)) < 200


def test_the_legend_wraps_on_narrow_maps():
    cells = np.zeros((100, 300), bool)
    options = {"goal_tolerance": 5.0, "radius": 3.0}
    one = trajectory_picture(cells, [spiral(1, 50, 50)], (9, 9), (90, 90), **options)
    runs = [spiral(1, 20 + 20 * k, 50) for k in range(12)]
    many = trajectory_picture(cells, runs, (9, 9), (90, 90), **options)
    assert many.shape[1] == one.shape[1] == 900
    assert many.shape[0] >= one.shape[0] + 20


def test_a_trajectory_of_one_pose_is_drawn():
    image = trajectory_picture(
        MAP,
        [[START]],
        START,
        GOAL,
        goal_tolerance=20.0,
        radius=12.0,
        outcomes=["out of time"],
    )
    assert image.shape[:2] == (432, 500)


def test_no_trajectories_give_the_task_alone():
    image = trajectory_picture(MAP, [], START, GOAL, goal_tolerance=20.0, radius=9.0)
    assert len(near(image, GREEN)) > 50


def test_the_window_shows_the_frame(monkeypatch):
    """Colours and axes as in the frame; closing it by hand acts like Ctrl-C."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = pytest.importorskip("pygame")
    window = Window("test", fps=1000)
    frame = np.zeros((40, 60, 3), np.uint8)
    frame[10, 50] = (10, 20, 30)
    window.show(frame)
    shown = pygame.surfarray.array3d(pygame.display.get_surface())
    assert shown.shape == (60, 40, 3)
    assert shown[50, 10].tolist() == [10, 20, 30]
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    with pytest.raises(KeyboardInterrupt):
        window.show(frame)
    window.close()


def test_the_window_names_the_extra_when_pygame_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    expected = re.escape(install_command("human"))
    with pytest.raises(DependencyNotInstalled, match=expected):
        Window("test", fps=20)
