"""Infra-red reflectance of Shapes, as Webots' distance sensors use it."""

from __future__ import annotations

from tdac_envs.worlds.wbt.fields import child, number, numbers
from tdac_envs.worlds.wbt.tree import WbtNode

DARKEST = 0.2
_MAPS = ("baseColorMap", "roughnessMap", "occlusionMap")


def reflectance(shape: WbtNode) -> float:
    """The factor `f` of a Shape: a sensor measures its distance divided by `f`.

    f = 0.2 + 0.8 red (1 - transparency) (1 - roughness / 2); only a PBRAppearance has
    a roughness. If f depends on textures or PROTOs, it is unknown and taken as 1.

    Args:
        shape: A Shape node.

    Raises:
        WorldError: A field of its appearance is invalid.
    """
    look = child(shape, "appearance")
    if look is None:
        return 1.0
    if look.kind == "PBRAppearance" and not any(name in look.fields for name in _MAPS):
        red = numbers(look, "baseColor", (1.0, 1.0, 1.0))[0]
        red *= 1.0 - share(number(look, "transparency", 0.0))
        return factor_of_red(red * (1.0 - 0.5 * share(number(look, "roughness", 0.0))))
    material = child(look, "material") if look.kind == "Appearance" else None
    if material is not None and "texture" not in look.fields:
        red = numbers(material, "diffuseColor", (0.8, 0.8, 0.8))[0]
        return factor_of_red(red * (1.0 - share(number(material, "transparency", 0.0))))
    return 1.0


def red_of(factor: float) -> float:
    """The red component of a Material with this factor."""
    return (factor - DARKEST) / (1.0 - DARKEST)


def factor_of_red(red: float) -> float:
    """The factor of a surface that returns this share of red light."""
    return DARKEST + (1.0 - DARKEST) * share(red)


def share(value: float) -> float:
    """The value, clipped to [0, 1]."""
    return min(max(value, 0.0), 1.0)
