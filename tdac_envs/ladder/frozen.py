"""Ladder 1.0: the frozen dynamics of the bundled task sets."""

from __future__ import annotations

from typing import NamedTuple

from tdac_envs.core.dynamics import ON_MAPS, STEP

LADDER = "Ladder 1.0"
BEFORE = f"before {LADDER}"
"""What results without a hash of the dynamics are called."""
ON_MAPS_OF_SETS = (*ON_MAPS, "ladder")
ON_PLATES = (
    *(*STEP, "epuck", "ladder"),
    *("worlds/bodies.py", "worlds/footprint.py", "worlds/materials.py"),
    *("worlds/world.py", "map2d/contact.py", "map2d/rays.py", "map2d/straight.py"),
    "map2d/terrain.py",
)
"""Code of sets of an e-puck; their worlds are measured as maps."""


class Frozen(NamedTuple):
    """A bundled set.

    Attributes:
        sha256: Hash of its values; its worlds follow from it.
        dynamics: Hash of all that decides what happens in an episode.
    """

    sha256: str
    dynamics: str


FROZEN: dict[str, Frozen] = {
    "known": Frozen(
        "7cd7606b6276646f57999a90d81eee4a83f7b195386c467dd69cb76388ac218f",
        "fbc35b6278f2142d689bf7a00d0bc2b288539b03fad9d6da596cd9c6e743e9f4",
    ),
    "unknown": Frozen(
        "a95bc6cc55cd46d86b71535da6009fd7a23510ec82cd2fd90f1c0484bce42cb4",
        "bbbeee8ca6b5b9516f97e8195f5f94ac4ddb02105f15d9872cefc260a29b2b5d",
    ),
    "lost": Frozen(
        "6ecbed8a359e0683cd64b6dbf341b629a93828854c724bc5e1ba6f60b95e29a4",
        "9d2d49da15e0e4adfd7bec9d690b9c3bb156da7b46b09813edbd12b795359d62",
    ),
    "moving": Frozen(
        "fcabb48d5d2ee33aaeb9397e1028dfa123b43fea2e14abbf3468bc5c42e65835",
        "b45867c58dcf3b969ad894b5f80d427643c5b600e7482a262c06ac40eb208101",
    ),
    "crowd": Frozen(
        "535b797efa54b4a55dc7986a4be163783927317b75ec2c1a4facf4b5f737974c",
        "31bfca23fc54ad454130bae7bd4bbc49c22d45a5fcc454651bceec89c59da999",
    ),
    "epuck": Frozen(
        "f14e67b3a6302229283054585b4c435c02fca0fdc70ece5733dc87fcf89eeb52",
        "7b79d36223e140ee1d3e44aeba5e4da18a08bd253691e60fc01a2f15a3451279",
    ),
    "barn": Frozen(
        "57468e2ffea454090dc0a56c2f71ff84396bf818ab061c281dcb0fe5d956700c",
        "7fce53fa96d9efaf6cf3dce42d06480c46c9dcdafcc4c025d595fce1fe1293bc",
    ),
    "barn-slow": Frozen(
        "8595432ce3f749f02d9bfd9eceabd32eb4e5e7e40579e80110597e64b73e3894",
        "f7785cb79696009ab074d42f84b804982e5bb9eac98893abc6ca524548a4e726",
    ),
}
"""The sets of this ladder by name; `python -m tools.frozen` prints what they are now."""
UNCHANGED = ("known", "unknown", "lost", "moving", "crowd", "barn", "barn-slow")
"""Sets with the same dynamics as before; the e-puck of `epuck` had another axle."""


def ladder_of(name: str, sha256: str, dynamics: str) -> str:
    """To which ladder results belong, in words; empty for sets of one's own.

    Args:
        name: Name of the set.
        sha256: Hash of its values.
        dynamics: Hash of its dynamics; empty in results of before.
    """
    frozen = FROZEN.get(name)
    own = frozen is not None and frozen.sha256 == sha256
    if not dynamics:
        same = own and name in UNCHANGED
        return f"{BEFORE}, whose dynamics are the same" if same else BEFORE
    if frozen is None or not own:
        return ""
    return LADDER if dynamics == frozen.dynamics else f"other dynamics than {LADDER}"
