"""Reads the colours of surfaces and of the sky.

Colours affect only camera images. An invalid colour is therefore not an error: the
default replaces it. Textures in other files are not read; they count as grey.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.looks import (
    ALUMINIUM,
    DARK_WOOD,
    GREY,
    LIGHT_WOOD,
    WHITE,
    Colour,
    Look,
    chequered,
    look_of_kind,
)
from tdac_envs.worlds.wbt.fields import child, number, numbers, text
from tdac_envs.worlds.wbt.tree import WbtNode

Sky = tuple[Colour, Colour, Colour]
"""Colours of the sky above, at the horizon, and below it."""

BLACK_SKY: Sky = ((0.0, 0.0, 0.0),) * 3
_OUTDOORS: Sky = ((0.36, 0.57, 0.86), (0.80, 0.87, 0.94), (0.45, 0.47, 0.43))

_CLEAR = 0.9
"""Transparency above which a surface is invisible; otherwise it is opaque."""
_TEXTURED = 0.65
"""Assumed mean brightness of a texture that is not available."""

# Approximate mean colours of Webots' appearance PROTOs.
_SURFACES: dict[str, Colour] = {
    "Asphalt": (0.30, 0.30, 0.31),
    "BrushedAluminium": ALUMINIUM.colour,
    "BrushedSteel": (0.70, 0.70, 0.70),
    "CarpetFibers": (0.55, 0.53, 0.50),
    "CementTiles": (0.63, 0.62, 0.60),
    "ChequeredParquetry": LIGHT_WOOD,
    "Copper": (0.72, 0.45, 0.30),
    "DarkParquetry": DARK_WOOD,
    "FormedConcrete": (0.62, 0.61, 0.59),
    "Grass": (0.32, 0.45, 0.19),
    "LightParquetry": LIGHT_WOOD,
    "OsbWood": (0.72, 0.58, 0.40),
    "Parquetry": (0.66, 0.51, 0.35),
    "Pavement": (0.56, 0.55, 0.53),
    "RedBricks": (0.58, 0.32, 0.24),
    "RoughConcrete": (0.58, 0.57, 0.55),
    "RoughOak": (0.55, 0.42, 0.28),
    "RoughPine": (0.74, 0.58, 0.39),
    "Roughcast": (0.85, 0.82, 0.76),
    "Rubber": (0.15, 0.15, 0.15),
    "SandyGround": (0.72, 0.63, 0.48),
    "Soil": (0.40, 0.31, 0.23),
    "ThreadMetalPlate": (0.60, 0.60, 0.60),
    "VarnishedPine": (0.72, 0.50, 0.28),
    **dict.fromkeys(
        ("GlossyPaint", "MattePaint", "PaintedWood", "Plaster", "Plastic"),
        (1.0, 1.0, 1.0),
    ),
}
_OWN_COLOURS = ("baseColor", "colorOverride", "color")


def look(node: WbtNode, field: str = "appearance") -> Look:
    """The look that the appearance in a field gives; white if there is none."""
    with suppress(WorldError):
        found = child(node, field)
        return WHITE if found is None else _look(found)
    return GREY


def proto_look(node: WbtNode) -> Look:
    """The look of a PROTO from its `appearance` or `color`, or the look of its type."""
    if "appearance" in node.fields:
        return look(node)
    usual = look_of_kind(node.kind)
    return Look(_colour(node, "color", usual.colour))


def floor_look(node: WbtNode) -> Look:
    """The look of the floor of an arena or Floor."""
    names = ("appearance", "tileSize")
    if node.kind != "Floor":
        names = ("floorAppearance", "floorTileSize")
    tile = (0.5, 0.5)
    with suppress(WorldError):
        length, width = numbers(node, names[1], tile)
        tile = (length, width) if min(length, width) > 1e-6 else tile
    with suppress(WorldError):
        floor = child(node, names[0]) if names[0] in node.fields else None
        if floor is None and names[0] not in node.fields:
            return chequered(*tile)
        if floor is not None and _is_chequered(floor):
            own, squares = _tint(floor), chequered(*tile)
            assert squares.other is not None
            return Look(
                _product(squares.colour, own),
                _product(squares.other, own),
                squares.square,
            )
    return look(node, names[0])


def wall_look(node: WbtNode) -> Look:
    """The look of the wall of an arena."""
    named = "wallAppearance" in node.fields
    return look(node, "wallAppearance") if named else ALUMINIUM


def sky_of(nodes: Iterable[WbtNode]) -> Sky:
    """The sky of a file; without a background it is black, as in Webots.

    Args:
        nodes: Top-level nodes.
    """
    for node in nodes:
        if node.kind == "TexturedBackground":
            return _OUTDOORS
        if node.kind == "Background":
            return (_colour(node, "skyColor", (0.0, 0.0, 0.0)),) * 3
    return BLACK_SKY


def _look(appearance: WbtNode) -> Look:
    """The look that an appearance node gives."""
    if appearance.kind == "PBRAppearance":
        own, textured = appearance, "baseColorMap" in appearance.fields
        base = _colour(own, "baseColor", (1.0, 1.0, 1.0))
    elif appearance.kind == "Appearance":
        material = child(appearance, "material")
        textured = "texture" in appearance.fields
        if material is None:
            return Look(_product(WHITE.colour, (_TEXTURED,) * 3)) if textured else WHITE
        own, base = material, _colour(material, "diffuseColor", (0.8, 0.8, 0.8))
    else:
        usual = _SURFACES.get(appearance.kind, GREY.colour)
        return Look(_product(usual, _tint(appearance)))
    if textured:
        base = _product(base, (_TEXTURED,) * 3)
    glow = _colour(own, "emissiveColor", (0.0, 0.0, 0.0))
    red, green, blue = (max(pair) for pair in zip(base, glow, strict=True))
    return Look((red, green, blue), is_clear=number(own, "transparency", 0.0) > _CLEAR)


def _is_chequered(appearance: WbtNode) -> bool:
    kind = appearance.kind
    return kind == "ChequeredParquetry" or (
        kind == "Parquetry" and text(appearance, "type") == "chequered"
    )


def _tint(appearance: WbtNode) -> Colour:
    """The colour by which an appearance PROTO multiplies its texture."""
    for name in _OWN_COLOURS:
        if name in appearance.fields:
            return _colour(appearance, name, (1.0, 1.0, 1.0))
    return 1.0, 1.0, 1.0


def _colour(node: WbtNode, name: str, default: Colour) -> Colour:
    with suppress(WorldError):
        red, green, blue = (min(max(x, 0.0), 1.0) for x in numbers(node, name, default))
        return red, green, blue
    return default


def _product(one: Colour, other: Colour) -> Colour:
    red, green, blue = (a * b for a, b in zip(one, other, strict=True))
    return red, green, blue
