"""Camera images: what is seen where, against projections and plain ray marching."""

import math
import runpy
from pathlib import Path

import cv2
import numpy as np
import pytest

from tdac_envs.core.errors import WorldError
from tdac_envs.webots.cameras import MOST_PIXELS
from tdac_envs.webots.controller.png import png
from tdac_envs.webots.rendering import brightness, look_through
from tdac_envs.webots.scenery import Scenery
from tdac_envs.webots.stage import open_stage
from tdac_envs.webots.views import Views
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle
from tdac_envs.worlds.looks import Look
from tdac_envs.worlds.wbt.colours import BLACK_SKY
from tdac_envs.worlds.wbt.reader import read_world
from tdac_envs.worlds.world import Arena, Obstacle, Part, World

HEAD = "#VRML_SIM R2025a utf8\nBackground { skyColor [ 0 0 1 ] }\n"
GREEN_FLOOR = (
    "Floor { size 4 4 appearance PBRAppearance { baseColor 0 1 0 metalness 0 } }\n"
)
EYE = (0.03, 0.0, 0.028)
PIXEL = 2.0 * math.tan(0.42) / 52
"""Width of a pixel of the e-puck's camera at a distance of 1."""


def solid(colour, geometry, place, more="", turn=0.0):
    """A Solid of one Shape."""
    return (
        f'Solid {{ translation {place} rotation 0 0 1 {turn} name "{colour}{place}"\n'
        f"  children [ Shape {{ appearance PBRAppearance {{ baseColor {colour} }}\n"
        f"    geometry DEF G {geometry} }} ]\n  boundingObject USE G\n{more}}}\n"
    )


@pytest.fixture
def camera(tmp_path):
    """A function of a world's text: stage, environment and its cameras."""

    def make(content, **options):
        file = tmp_path / "world.wbt"
        file.write_text(content)
        stage = open_stage(file, **options)
        env = stage.make_env()
        env.reset(seed=0)
        cameras = Views(stage.cameras, stage.world, stage.sky, stage.robot, env)
        return stage, env, cameras

    return make


@pytest.fixture
def picture(camera):
    """A function of a world's text: the first image, shape (height, width, 4)."""

    def take(content, **options):
        stage, _, cameras = camera(content, **options)
        facts = stage.cameras[0]
        cameras.expose(facts.name)
        data = np.frombuffer(cameras.image(facts.name), np.uint8)
        return data.reshape(facts.height, facts.width, 4)

    return take


def rays():
    """Slopes to the left and upwards of the 39 x 52 pixels, by plain projection."""
    left = -(np.arange(52) - 25.5) * PIXEL
    up = -(np.arange(39) - 19.0) * PIXEL
    return np.meshgrid(left, up)


class TestProjection:
    def test_a_red_wall_where_it_has_to_be(self, picture):
        """Its pixels, those of the floor before it and of the sky are as projected."""
        wall = solid("1 0 0", "Box { size 0.02 0.16 0.1 }", "0.31 0.02 0.05")
        image = picture(HEAD + GREEN_FLOOR + "E-puck { }\n" + wall)
        left, up = rays()
        y, z = EYE[1] + 0.27 * left, EYE[2] + 0.27 * up
        on_wall = (np.abs(y - 0.02) < 0.08) & (z > 0.0) & (z < 0.1)
        assert 200 < on_wall.sum() < 1500
        blue, green, red, opaque = np.moveaxis(image, 2, 0)
        assert ((red > 0) == on_wall).all()
        assert (opaque == 255).all()
        reach = np.full_like(up, np.inf)
        np.divide(EYE[2], -up, out=reach, where=up < 0)
        on_floor = ~on_wall & (EYE[0] + reach < 2.0) & (np.abs(reach * left) < 2.0)
        assert ((green > 0) == on_floor).all()
        assert ((blue == 255) == ~(on_wall | on_floor)).all()

    def test_brightness(self, picture):
        """A face has its colour times the brightness of its direction, rounded."""
        wall = solid("1 0.5 0.2", "Box { size 0.02 1 1 }", "0.2 0 0")
        image = picture(HEAD + "E-puck { }\n" + wall)
        light = 0.6 + 0.4 * (0.5 - 0.5 * 0.5 / math.hypot(0.5, 0.2, 0.84))
        assert brightness(-1.0, 0.0, 0.0) == pytest.approx(light)
        wanted = [round(255 * light * share) for share in (0.2, 0.5, 1.0)]
        assert (image == [*wanted, 255]).all()

    def test_squares_of_the_floor(self, picture):
        """Two by two in each tile, beginning at a corner of the floor."""
        arena = "RectangleArena { floorSize 3 3 floorTileSize 0.2 0.3 }\n"
        image = picture(HEAD + arena + "E-puck { }\n")
        left, up = rays()
        near = EYE[2] / np.maximum(-up, 0.1)
        x, y = EYE[0] + near, near * left
        even = (np.floor((x + 1.5) / 0.1) + np.floor((y + 1.5) / 0.15)) % 2 == 0
        seen, red = up < -0.1, image[..., 2]
        assert len(np.unique(red[seen & even])) == 1
        assert len(np.unique(red[seen & ~even])) == 1
        assert abs(int(red[seen & even][0]) - int(red[seen & ~even][0])) > 50

    @pytest.mark.slow
    @pytest.mark.parametrize("seed", range(4))
    def test_any_scene_as_marched_along_its_rays(self, seed):
        """Every tenth pixel shows what a point moving along its ray meets first."""
        rng = np.random.default_rng(seed)
        things = [self._thing(rng) for _ in range(8)]
        arena = Arena(Rectangle(0, 0, 0, 3, 3), floor_look=Look((0.5, 0.5, 0.5)))
        world = World(arenas=(arena,), obstacles=tuple(things))
        place = np.array([0.0, 0.0, 0.12])
        turn = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        pitch = 0.1 * seed
        turn[:, 0] = math.cos(pitch), 0.0, -math.sin(pitch)
        turn[:, 2] = math.sin(pitch), 0.0, math.cos(pitch)
        view = look_through(place, turn, 1.2, 40, 30)
        scenery = Scenery.of(world, BLACK_SKY)
        image = scenery.image(view, 0.01, 40, 30, np.empty((0, 3)))
        wrong = 0
        for row, column in np.ndindex(30, 40):
            if (row + column) % 10:
                continue
            way = view[1] + column * view[2] + row * view[3]
            marched = self._marched(things, place, way)
            seen = image[row, column, 2::-1].argmax()
            is_grey = len(set(image[row, column, :3].tolist())) == 1
            wrong += marched != (None if is_grey else int(seen))
        assert wrong <= 2  # a step of 1 mm may miss a corner

    @staticmethod
    def _thing(rng):
        x, y = rng.uniform(0.2, 0.9), rng.uniform(-0.5, 0.5)
        size = rng.uniform(0.03, 0.15)
        shape = [
            Disc(x, y, size),
            Rectangle(x, y, rng.uniform(-1.5, 1.5), 2 * size, size),
            Polygon.around(np.add(rng.uniform(-size, size, (7, 2)), (x, y))),
        ][rng.integers(3)]
        bottom = rng.uniform(0.0, 0.15)
        part = Part(shape, bottom, bottom + rng.uniform(0.02, 0.15))
        colour = np.zeros(3)
        colour[rng.integers(3)] = 1.0
        look = Look(tuple(colour.tolist()))
        return Obstacle("", "Solid", x, y, (part,), (part,), looks=(look,))

    @staticmethod
    def _marched(things, place, way):
        """Channel of the colour of the first thing on a ray; None if there is none."""
        for t in np.arange(0.01, 1.3, 0.001):
            x, y, z = (place + t * way).tolist()
            if z < 0.0:
                return None
            for thing in things:
                part = thing.visible[0]
                if part.bottom <= z <= part.top and part.shape.contains(x, y):
                    return thing.looks[0].colour.index(1.0)
        return None

    def test_a_symmetric_scene_gives_a_symmetric_image(self, picture):
        """Mirrored at the plane of the light, in which the robot looks."""
        turn = math.atan2(0.2, 0.5)
        ahead, left = np.array([[math.cos(turn), math.sin(turn)]] * 2)
        left = np.array([-ahead[1], ahead[0]])
        scene = f"E-puck {{ rotation 0 0 1 {turn} }}\n"
        for colour, far, aside in (("1 0 0", 0.3, 0.06), ("0.2 0.2 1", 0.5, 0.2)):
            for side in (1, -1):
                x, y = far * ahead + side * aside * left
                shape = "Cylinder { radius 0.031 height 0.1 }"
                scene += solid(colour, shape, f"{x} {y} 0.05")
        x, y = 0.4 * ahead
        scene += solid("1 1 0", "Box { size 0.1 0.1 0.03 }", f"{x} {y} 0.015", "", turn)
        image = picture(HEAD + GREEN_FLOOR + scene).astype(int)
        assert np.abs(image - image[:, ::-1]).max() <= 1
        assert len(np.unique(image.reshape(-1, 4), axis=0)) > 10

    def test_left_is_left(self, picture):
        """What stands to the left of the robot is in the left half of the image."""
        ball = solid("1 0 0", "Sphere { radius 0.03 }", "0.3 0.06 0.03")
        image = picture(HEAD + GREEN_FLOOR + "E-puck { }\n" + ball)
        columns = np.flatnonzero((image[..., 2] > 0).any(axis=0))
        assert 0 < columns.min() <= columns.max() < 26

    def test_axes_of_old_files(self, picture):
        """A file of R2021b with y up shows the same scene."""
        box = solid("1 0 0", "Box { size 0.02 0.1 0.06 }", "0.3 0.05 0.03")
        new = HEAD + "E-puck { }\n" + box
        old_box = solid("1 0 0", "Box { size 0.1 0.06 0.02 }", "-0.05 0.03 -0.3")
        old = (
            "#VRML_SIM R2021b utf8\nWorldInfo { coordinateSystem \"NUE\" }\n"
            "Background { skyColor [ 0 0 1 ] }\nE-puck { }\n" + old_box
        )  # fmt: skip
        image = picture(new)
        assert (image[..., 2] > 0).any()
        assert (picture(old) == image).all()


class TestCameras:
    def test_facts_of_the_file(self, camera):
        """Size and field of view of the e-puck's own fields; else of the PROTO."""
        stage, _, _ = camera(HEAD + "E-puck { }\n")
        (facts,) = stage.cameras
        assert (facts.name, facts.width, facts.height) == ("camera", 52, 39)
        assert facts.plain() == {"width": 52, "height": 39, "fov": 0.84, "near": 0.0055}
        assert facts.place == pytest.approx(EYE)
        fields = "camera_width 640 camera_height 480 camera_fieldOfView 0.7"
        (facts,) = camera(f"{HEAD}E-puck {{ {fields} }}\n")[0].cameras
        assert (facts.width, facts.height, facts.field_of_view) == (640, 480, 0.7)

    def test_the_linear_camera(self, picture):
        """Turned down by 0.47 rad, as the PROTO proposes, it sees the floor only."""
        field = "E-puck { camera_rotation 0 1 0 0.47 }\n"
        assert (picture(HEAD + GREEN_FLOOR + field)[..., 1] > 0).all()

    def test_a_robot_saved_with_a_tilt(self, picture):
        """It drives upright, so its camera looks ahead."""
        upright = picture(HEAD + GREEN_FLOOR + "E-puck { }\n")
        tilted = "E-puck { rotation 0 1 0 0.03 }\n"
        assert (picture(HEAD + GREEN_FLOOR + tilted) == upright).all()

    def test_further_cameras(self, camera):
        """In the turret, and in a Robot node, with their own fields and places."""
        turret = 'Pose { translation 0 0 0.1 children [ Camera { name "top" } ] }'
        stage, _, _ = camera(f"{HEAD}E-puck {{ turretSlot [ {turret} ] }}\n")
        assert [facts.name for facts in stage.cameras] == ["camera", "top"]
        assert stage.cameras[1].place == pytest.approx((-0.0095, 0.0, 0.1486))
        assert {"camera", "top"} <= {device.name for device in stage.devices}
        sensors = " ".join(
            f'DistanceSensor {{ name "ps{k}" translation 0.03 {y} 0.03 }}'
            for k, y in enumerate((-0.01, 0, 0, 0, 0, 0, 0, 0.01))
        )
        eye = 'Camera { name "eye" translation 0.04 0.01 0.02 width 8 height 6 }'
        robot = (
            f"Robot {{ translation 1 2 0 rotation 0 0 1 1 name \"mine\" model \"epuck\""
            f" children [ {sensors} {eye} ] }}\n"
        )  # fmt: skip
        (facts,) = camera(HEAD + robot)[0].cameras
        assert (facts.name, facts.width, facts.height) == ("eye", 8, 6)
        assert facts.place == pytest.approx((0.04, 0.01, 0.02))
        assert facts.axes == pytest.approx(np.eye(3))

    def test_a_camera_that_is_too_large(self, camera):
        """It is missing, as other devices that are not modelled."""
        side = math.isqrt(MOST_PIXELS) + 1
        fields = f"camera_width {side} camera_height {side}"
        stage, _, _ = camera(f"{HEAD}E-puck {{ {fields} }}\n")
        assert stage.cameras == ()
        assert "camera" in stage.absent
        assert "camera" not in {device.name for device in stage.devices}

    def test_a_camera_without_a_direction(self, camera):
        """A Robot that is scaled to a point is refused, with the place in the file."""
        eye = 'Camera { name "eye" }'
        robot = f'Robot {{ model "epuck" children [ {eye} ] }}'
        world = f"{HEAD}Transform {{ scale 1e-9 1e-9 1e-9 children [ {robot} ] }}\n"
        with pytest.raises(WorldError, match="the camera 'eye' has the scale 0"):
            camera(world)

    def test_odd_fields(self, camera):
        """Those that no camera can have are replaced by the PROTO's."""
        fields = "camera_width 0 camera_height -3 camera_fieldOfView 4"
        (facts,) = camera(f"{HEAD}E-puck {{ {fields} }}\n")[0].cameras
        assert (facts.width, facts.height, facts.field_of_view) == (52, 39, 0.84)

    def test_nothing_before_the_first_sample(self, camera):
        """Then the image of the sample, however far the robot has moved since."""
        world = (
            HEAD
            + GREEN_FLOOR
            + "E-puck { }\n"
            + solid("1 0 0", "Box { size 0.1 0.1 0.1 }", "0.3 0.05 0.05")
        )
        _, env, cameras = camera(world)
        assert cameras.image("camera") is None
        assert cameras.expose("camera") == 1
        for _ in range(5):
            env.step(np.array([-1.0, 1.0], np.float32))
        before = cameras.image("camera")
        assert cameras.image("camera") is before
        assert cameras.expose("camera") == 2
        assert cameras.image("camera") != before


def test_movable_objects_are_seen_where_they_are():
    """An image after a push equals that of a world with the object at its new place."""
    box = "WoodenBox {{ translation {} 0.05 rotation 0 0 1 {} size 0.1 0.06 0.1 {}}}\n"
    mass, wall = "mass 0.1 ", "WoodenBox { translation 1 0 0.3 }\n"
    place = (0.4, 0.02, 0.7)
    before = read_world(HEAD + box.format("0.3 -0.1", 0.2, mass) + wall)
    after = read_world(HEAD + box.format("0.4 0.02", 0.7, "") + wall)
    view = look_through(np.array(EYE), np.eye(3), 0.84, 52, 39)
    args = view, 0.0055, 52, 39
    start = np.array([(0.3, -0.1, 0.0)])
    moved = np.array([(place[0], place[1], place[2] - 0.2)])
    scenery = Scenery.of(before, BLACK_SKY)
    wanted = Scenery.of(after, BLACK_SKY).image(*args, np.empty((0, 3)))
    assert (scenery.image(*args, moved) == wanted).all()
    assert (scenery.image(*args, start) != wanted).any()


def test_a_pushed_crate_moves_in_the_image(camera):
    """In an environment in which the robot drives against it."""
    text = world_file("crates").read_text()
    stage, env, cameras = camera(text)
    cameras.expose("camera")
    before = cameras.image("camera")
    things = env.things()
    for _ in range(150):
        env.step(np.array([0.8, 0.8], np.float32))
    pose, moved = env.pose(), env.things()
    assert not np.allclose(things, moved)
    cameras.expose("camera")
    assert cameras.image("camera") != before
    scenery = Scenery.of(stage.world, stage.sky)
    x, y, heading = pose.tolist()
    cos, sin = math.cos(heading), math.sin(heading)
    axes = np.array([(cos, -sin, 0.0), (sin, cos, 0.0), (0.0, 0.0, 1.0)])
    view = look_through(axes @ EYE + (x, y, 0.0), axes, 0.84, 52, 39)
    image = scenery.image(view, 0.0055, 52, 39, moved)
    assert cameras.image("camera") == image.tobytes()


def test_clear_surfaces_are_not_seen():
    """Nor is their solid part; of two surfaces in one plane the object is seen."""
    part = Part(Rectangle(0.3, 0, 0, 0.1, 0.1), 0.0, 0.1)
    clear = Obstacle("", "Solid", 0.3, 0, (part,), (part,),
                     looks=(Look((1.0, 0.0, 0.0), is_clear=True),))  # fmt: skip
    decal = Part(Rectangle(0.2, 0, 0, 0.2, 0.2), -0.0001, 0.0)
    mark = Obstacle("", "Shape", 0.2, 0, (), (decal,), looks=(Look((0.0, 0.0, 1.0)),))
    arena = Arena(Rectangle(0, 0, 0, 3, 3), floor_look=Look((0.0, 1.0, 0.0)))
    scenery = Scenery.of(World(arenas=(arena,), obstacles=(clear, mark)), BLACK_SKY)
    view = look_through(np.array(EYE), np.eye(3), 0.84, 52, 39)
    image = scenery.image(view, 0.0055, 52, 39, np.empty((0, 3)))
    assert (image[..., 2] == 0).all()
    assert (image[30, 26, :2] > 0).tolist() == [True, False]
    assert len(scenery.prisms.extent) == 2


def test_png_files_can_be_read():
    """By another library, pixel by pixel."""
    image = np.random.default_rng(0).integers(0, 256, (7, 5, 4), np.uint8)
    data = np.frombuffer(png(image.tobytes(), 5, 7), np.uint8)
    assert (cv2.imdecode(data, cv2.IMREAD_UNCHANGED) == image[..., :3]).all()


def test_the_picture_of_the_docs():
    """It is the one that its script draws."""
    root = Path(__file__).parents[3]
    script, file = root / "tools" / "camera_picture.py", root / "docs" / "camera.png"
    if not (script.exists() and file.exists()):
        pytest.skip("only in a clone of the repository")
    drawn = runpy.run_path(str(script))["picture"]()[..., :3]
    assert np.abs(cv2.imread(str(file)).astype(int) - drawn).max() <= 1
