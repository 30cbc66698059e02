"""Colours of surfaces and of the sky, as files give them."""

import pytest

from tdac_envs.worlds.looks import ALUMINIUM, GREY, WHITE, Look, chequered, look_of_kind
from tdac_envs.worlds.wbt.colours import BLACK_SKY, sky_of
from tdac_envs.worlds.wbt.reader import read_world
from tdac_envs.worlds.wbt.tree import parse

HEAD = "#VRML_SIM R2025a utf8\n"
SHAPE = "Solid {{ children [ Shape {{ {} geometry Box {{ }} }} ] }}\n"


def looks(text):
    """Looks of the first obstacle."""
    return read_world(HEAD + text).obstacles[0].looks


@pytest.mark.parametrize(
    ("appearance", "look"),
    [
        ("", WHITE),
        ("PBRAppearance { }", WHITE),
        ("PBRAppearance { baseColor 0.1 0.2 0.3 }", Look((0.1, 0.2, 0.3))),
        ("PBRAppearance { baseColor 2 -1 0.3 }", Look((1.0, 0.0, 0.3))),
        (
            "PBRAppearance { baseColor 0 0 0 emissiveColor 0 0.5 0 }",
            Look((0.0, 0.5, 0.0)),
        ),
        (
            "PBRAppearance { baseColor 1 0 0 transparency 1 }",
            Look((1.0, 0.0, 0.0), is_clear=True),
        ),
        ("PBRAppearance { baseColorMap ImageTexture { } }", Look((0.65, 0.65, 0.65))),
        ("Appearance { material Material { } }", Look((0.8, 0.8, 0.8))),
        (
            "Appearance { material Material { diffuseColor 0 0 1 } }",
            Look((0.0, 0.0, 1.0)),
        ),
        ("Appearance { texture ImageTexture { } }", Look((0.65, 0.65, 0.65))),
        ("Rubber { }", Look((0.15, 0.15, 0.15))),
        ("PaintedWood { colorOverride 0.4 0.5 0.6 }", Look((0.4, 0.5, 0.6))),
        ("Marvellous { }", GREY),
        ("Marvellous { baseColor 1 2 }", GREY),
        ('Marvellous { color "red" }', GREY),
    ],
)
def test_shapes(appearance, look):
    """The colour that the appearance states; a default for what it does not."""
    field = f"appearance {appearance}" if appearance else ""
    (found,) = looks(SHAPE.format(field))
    assert found.colour == pytest.approx(look.colour)
    assert found.is_clear == look.is_clear


def test_each_part_has_its_own_colour():
    """In the order of the visible parts, also in nested groups."""
    shape = "Shape {{ appearance PBRAppearance {{ baseColor {} }} geometry Box {{ }} }}"
    red, blue = shape.format("1 0 0"), shape.format("0 0 1")
    thing = read_world(
        f"{HEAD}Solid {{ children [ {red} Pose {{ children [ {blue} ] }} ] }}\n"
    ).obstacles[0]
    assert [look.colour for look in thing.looks] == [(1, 0, 0), (0, 0, 1)]
    assert len(thing.visible) == 2


@pytest.mark.parametrize(
    ("text", "colour"),
    [
        ("WoodenBox { }", look_of_kind("WoodenBox").colour),
        ("PlasticCrate { color 0 1 0 }", (0.0, 1.0, 0.0)),
        ("PlasticCrate { }", (0.9, 0.2, 0.2)),
        ("SolidBox { appearance PBRAppearance { baseColor 0 0 1 } }", (0.0, 0.0, 1.0)),
        ("Wall { }", look_of_kind("Wall").colour),
    ],
)
def test_protos(text, colour):
    """Their `appearance` or `color`, else the usual colour of their type."""
    assert {look.colour for look in looks(text)} == {colour}


def test_arenas():
    """Chequered by default, with two squares to a tile; else as the file says."""
    plain, painted, tinted = read_world(
        f"{HEAD}RectangleArena {{ floorTileSize 0.4 0.2 }}\n"
        "CircleArena { floorAppearance PBRAppearance { baseColor 1 0 0 }\n"
        "  wallAppearance PBRAppearance { baseColor 0 1 0 } }\n"
        'Floor { appearance Parquetry { type "chequered" colorOverride 0 0 1 }\n'
        "  tileSize 1 0 }\n"
    ).arenas
    assert plain.floor_look == chequered(0.4, 0.2)
    assert plain.floor_look.square == (0.2, 0.1)
    assert plain.wall_look == ALUMINIUM
    assert {look.colour for look in plain.wall().looks} == {ALUMINIUM.colour}
    assert painted.floor_look == Look((1.0, 0.0, 0.0))
    assert painted.wall_look == Look((0.0, 1.0, 0.0))
    assert tinted.floor_look.colour[:2] == (0.0, 0.0)
    assert tinted.floor_look.square == (0.25, 0.25)


def test_sky():
    """A colour, a usual sky for a texture, and black without a background."""
    assert sky_of(parse(HEAD, "w").nodes) == BLACK_SKY
    blue = parse(f"{HEAD}Background {{ skyColor [ 0 0.5 1 ] }}\n", "w")
    assert sky_of(blue.nodes) == ((0.0, 0.5, 1.0),) * 3
    above, horizon, below = sky_of(
        parse(f"{HEAD}TexturedBackground {{ }}\n", "w").nodes
    )
    assert above[2] > above[0]
    assert len({above, horizon, below}) == 3


def test_colours_do_not_distinguish_worlds():
    """The flat file does not keep them, and is equal all the same."""
    red, green = (
        read_world(f"{HEAD}PlasticCrate {{ color {colour} }}\n")
        for colour in ("1 0 0", "0 1 0")
    )
    assert red == green
    assert red.obstacles[0].looks != green.obstacles[0].looks
