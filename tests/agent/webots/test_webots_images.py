"""Controllers get camera images as from Webots."""

import pytest
from worlds_for_controllers import BLOCKED, OPEN

BEGIN = """
import math
from controller import Camera, Robot
robot = Robot()
camera = robot.getDevice("camera")
left, right = (robot.getDevice(f"{s} wheel motor") for s in ("left", "right"))
for motor in (left, right):
    motor.setPosition(math.inf)
    motor.setVelocity(0.0)
"""


@pytest.fixture
def printed(drive):
    """Runs lines after a usual beginning; gives what they print, line by line."""

    def run(lines, world=BLOCKED, **more):
        report = drive(BEGIN + lines, world, **{"steps": 50, **more}).report
        assert report.error is None, (report.error, report.traceback, report.output)
        return report.output.splitlines()

    return run


def test_formats_and_accessors_agree(printed):
    """Bytes, nested lists, and the static functions and methods: the same pixels."""
    out = printed(
        "camera.enable(32); robot.step(32)\n"
        "image, array = camera.getImage(), camera.getImageArray()\n"
        "w, h = camera.getWidth(), camera.getHeight()\n"
        "print(type(image).__name__, len(image) == 4 * w * h, camera.image == image)\n"
        "print(len(array), {len(column) for column in array}, "
        "{len(pixel) for column in array for pixel in column})\n"
        "same = all(\n"
        "    [owner.imageGetRed(image, w, x, y), owner.imageGetGreen(image, w, x, y),\n"
        "     owner.imageGetBlue(image, w, x, y)] == array[x][y]\n"
        "    and owner.imageGetGray(image, w, x, y) == sum(array[x][y]) // 3\n"
        "    for owner in (Camera, camera) for x in range(w) for y in range(h))\n"
        "print(same, {image[k] for k in range(3, len(image), 4)})\n"
        "print(len({tuple(p) for column in array for p in column}) > 3)\n"
        "print(w, h, camera.getFov(), camera.getNear(), camera.getSamplingPeriod(),\n"
        "      camera.hasRecognition())\n"
    )
    assert out == [
        "bytes True True",
        "52 {39} {3}",
        "True {255}",
        "True",
        "52 39 0.84 0.0055 32 False",
    ]


def test_disabled(printed):
    """The error, and None; the same after disable."""
    error = (
        "Error: wb_camera_get_image() called for a disabled device! Please use: "
        "wb_camera_enable()."
    )
    out = printed(
        "robot.step(32); print(camera.getImage())\n"
        "camera.enable(32); robot.step(32); print(camera.getImage() is None)\n"
        "camera.disable(); robot.step(32); print(camera.getImageArray())\n"
        "camera.enable(32); print(camera.getImage())\n"
    )
    assert out == [error, "None", "False", error, "None", "None"]


def test_sampling_period(printed):
    """Black before the first sample; then held for the period, as at its sample."""
    out = printed(
        "camera.enable(96); left.setVelocity(-1.0); right.setVelocity(1.0)\n"
        "images = []\n"
        "for _ in range(9):\n"
        "    robot.step(32); images.append(camera.getImage())\n"
        "print([any(image) for image in images[:3]])\n"
        "print(*(a == b for a, b in zip(images[2:], images[3:])))\n"
    )
    assert out == ["[False, False, True]", "True True False True True False"]


def test_the_image_of_a_sample_that_is_asked_for_late(printed):
    """Asked for two steps later it is the one of its sample."""
    out = printed(
        "camera.enable(96); left.setVelocity(-1.0); right.setVelocity(1.0)\n"
        "other = Camera('camera'); other.enable(96)\n"
        "for _ in range(3): robot.step(32)\n"
        "image = camera.getImage()\n"
        "for _ in range(2): robot.step(32)\n"
        "print(other.getImage() == image)\n"
        "robot.step(32); print(other.getImage() == image)\n"
    )
    assert out == ["True", "False"]


def test_asking_has_no_effect_on_the_run(drive):
    """The same steps with and without it, and no request after the end."""
    loop = (
        "camera.enable(32); left.setVelocity(1.0); right.setVelocity(1.5)\n"
        "for _ in range(60):\n    robot.step(32); {}\n"
        "print(camera.getImage() is None)\n"
    )
    runs = [drive(BEGIN + loop.format(line), OPEN, steps=40)
            for line in ("camera.getImage()", "pass")]  # fmt: skip
    assert runs[0].log.poses == runs[1].log.poses
    assert [run.report.outcome for run in runs] == ["out of time"] * 2


def test_save_image(printed):
    """A PNG file; nothing without an image, and a message for other names."""
    out = printed(
        "camera.enable(32); print(camera.saveImage('early.png', 100))\n"
        "robot.step(32)\n"
        "print(camera.saveImage('one.png', 100), camera.saveImage('two.jpg', 80),\n"
        "      camera.saveImage('no/folder.png', 100))\n"
        "one, two = open('one.png', 'rb').read(), open('two.jpg', 'rb').read()\n"
        "size = [int.from_bytes(one[at : at + 4], 'big') for at in (16, 20)]\n"
        "print(one == two, one[1:4], size)\n"
    )
    assert out[0] == "-1"
    assert out[1].startswith("tdac: Camera.saveImage() writes a PNG file")
    assert out[2].startswith("Error: wb_camera_save_image() failed")
    assert out[3:] == ["0 0 -1", "True b'PNG' [52, 39]"]


def test_what_is_not_supported_is_said_once(printed):
    """Zoom, focus and recognition return a neutral value."""
    out = printed(
        "camera.setFov(0.5); camera.fov = 0.6; print(camera.getFov())\n"
        "print(camera.getRecognitionObjects(), camera.getFocalLength())\n"
    )
    assert out == [
        "tdac: Camera.setFov() is not supported; it has no effect",
        "0.84",
        "tdac: Camera.getRecognitionObjects() is not supported; it has no effect",
        "tdac: Camera.getFocalLength() is not supported; it has no effect",
        "() 0.0",
    ]


def test_large_images_pass_the_channel(printed):
    """640 x 480, as worlds for vision have them."""
    fields = "supervisor TRUE camera_width 640 camera_height 480"
    out = printed(
        "camera.enable(32)\n"
        "for _ in range(3): robot.step(32); print(len(camera.getImage()))\n",
        OPEN.replace("supervisor TRUE", fields),
    )
    assert out == [str(640 * 480 * 4)] * 3


def test_a_controller_that_steers_by_its_camera(drive):
    """It turns towards the brown box, drives up to it, and stops before it."""
    code = (
        "camera.enable(32); w, h = camera.getWidth(), camera.getHeight()\n"
        "while robot.step(32) != -1:\n"
        "    array = camera.getImageArray()\n"
        "    dark = [x for x in range(w) if array[x][h // 2 - 3][0] < 120\n"
        "            and array[x][h // 2 - 3][2] < 60]\n"
        "    if len(dark) == w: break\n"
        "    turn = 0.05 * (sum(dark) / len(dark) - w / 2) if dark else -0.8\n"
        "    ahead = 2.0 if dark else 0.0\n"
        "    left.setVelocity(ahead + turn); right.setVelocity(ahead - turn)\n"
        "print('there')\n"
    )
    world = BLOCKED.replace("rotation 0 0 1 0.0", "rotation 0 0 1 -1.0")
    run = drive(BEGIN + code, world, steps=600)
    assert run.report.output == "there\n", run.report
    assert run.report.collisions == 0
    x, y, heading = run.report.end
    assert -0.35 < x < -0.15
    assert abs(y) < 0.1
    assert abs(heading) < 0.5
