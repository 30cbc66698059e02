"""What pictures of MuJoCo's model show beyond its bodies: light, ground, a robot."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from tdac_envs.physics.body import BodySpec
from tdac_envs.physics.mjcf import GROUND, HULL, LEFT, RIGHT, ROBOT, add, model_tree
from tdac_envs.physics.scene import Scene

DRAWN = 3
"""Group of geoms that only pictures show."""
_SQUARES = 6.0
"""Length of two squares of the ground, in body radii."""
_SHELL, _BOARD, _LIGHT = (0.93, 0.93, 0.90), (0.10, 0.34, 0.22), (0.95, 0.55, 0.12)
_DOWN = (0.35, 0.45, -0.82)
"""Direction of the light."""
_TYRE = (0.13, 0.13, 0.14)
_CLOUD = {"contype": 0, "conaffinity": 0, "mass": 0.0, "group": DRAWN}


def drawn_model(scene: Scene, body: BodySpec, width: int, height: int) -> str:
    """The model of a scene with a robot for pictures, as text in XML.

    Args:
        scene: The scene.
        body: The robot's body.
        width: Width of the largest picture, px.
        height: Height of the largest picture, px.
    """
    root = model_tree(scene, body)
    assets, world = root.find("asset"), root.find("worldbody")
    assert assets is not None
    assert world is not None
    _add_surroundings(root, assets, world, body, (width, height))
    robot = world.find(f"body[@name='{ROBOT}']")
    assert robot is not None
    for geom in robot.iter("geom"):  # the drawn robot takes their place
        geom.set("rgba", "0 0 0 0")
    _add_robot(robot, body)
    return ET.tostring(root, "unicode")


def _add_surroundings(
    root: ET.Element,
    assets: ET.Element,
    world: ET.Element,
    body: BodySpec,
    size: tuple[int, int],
) -> None:
    """Adds sky, ground and lights."""
    add(root, "statistic", extent=12.0 * body.radius, center=(0, 0, 0))
    visual = add(root, "visual")
    add(visual, "global", offwidth=size[0], offheight=size[1], fovy=38.0)
    add(visual, "quality", shadowsize=2048, offsamples=4)
    add(visual, "map", znear=0.05, zfar=150.0, shadowclip=2.0)
    add(
        visual, "headlight", ambient=(0.38, 0.38, 0.40), diffuse=(0.25, 0.25, 0.25),
        specular=(0, 0, 0),
    )  # fmt: skip
    add(
        assets, "texture", type="skybox", builtin="gradient", rgb1=(0.80, 0.86, 0.92),
        rgb2=(0.97, 0.98, 0.99), width=128, height=128,
    )  # fmt: skip
    add(
        assets, "texture", name=GROUND, type="2d", builtin="checker",
        rgb1=(0.86, 0.84, 0.80), rgb2=(0.80, 0.78, 0.74), width=256, height=256,
        mark="edge", markrgb=(0.74, 0.72, 0.68),
    )  # fmt: skip
    scale = 1.0 / (_SQUARES * body.radius)
    add(
        assets, "material", name=GROUND, texture=GROUND, texuniform="true",
        texrepeat=(scale, scale), specular=0.1, shininess=0.1,
    )  # fmt: skip
    ground = world.find(f"geom[@name='{GROUND}']")
    assert ground is not None
    ground.set("material", GROUND)
    ground.set("rgba", "1 1 1 1")
    add(
        world, "light", directional="true", castshadow="true", dir=_DOWN,
        pos=tuple(-20.0 * body.radius * part for part in _DOWN),
        diffuse=(0.62, 0.60, 0.56), specular=(0.2, 0.2, 0.2), ambient=(0, 0, 0),
    )  # fmt: skip


def _add_robot(robot: ET.Element, body: BodySpec) -> None:
    """Adds the drawn robot: shell, board, lamp at the nose, eyes and tyres."""
    radius, axis = body.radius, body.wheel_radius
    tall = body.top - body.bottom
    low, high = body.bottom - axis, body.top - axis

    def cylinder(name: str, wide: float, begin: float, end: float, rgb: object) -> None:
        add(
            robot, "geom", name=f"drawn {name}", type="cylinder",
            size=(wide, (end - begin) / 2), pos=(0, 0, (begin + end) / 2),
            rgba=(*rgb, 1.0), **_CLOUD,  # type: ignore[misc]
        )  # fmt: skip

    cylinder(HULL, 0.90 * radius, low, low + 0.62 * tall, _SHELL)
    cylinder("band", 0.96 * radius, low + 0.62 * tall, low + 0.72 * tall, _LIGHT)
    cylinder("neck", 0.86 * radius, low + 0.72 * tall, high - 0.10 * tall, _SHELL)
    cylinder("board", radius, high - 0.10 * tall, high, _BOARD)
    for side, y in ((LEFT, 1.0), (RIGHT, -1.0)):
        add(
            robot, "geom", name=f"drawn tyre {side}", type="cylinder",
            size=(axis, 0.05 * radius), pos=(0, 0.91 * y * radius, 0),
            euler=(1.5708, 0, 0), rgba=(*_TYRE, 1), **_CLOUD,
        )  # fmt: skip
        add(
            robot, "geom", name=f"drawn eye {side}", type="sphere", size=0.10 * radius,
            pos=(0.84 * radius, 0.30 * y * radius, low + 0.42 * tall),
            rgba=(*_TYRE, 1), **_CLOUD,
        )  # fmt: skip
    # A wedge on the board points ahead.
    add(
        robot, "geom", name="drawn nose", type="capsule", size=0.07 * radius,
        fromto=(0.15 * radius, 0, high, 0.80 * radius, 0, high), rgba=(*_LIGHT, 1),
        **_CLOUD,
    )  # fmt: skip
