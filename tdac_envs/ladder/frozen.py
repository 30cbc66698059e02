"""Ladder 1.0: the frozen dynamics of the bundled task sets."""

from __future__ import annotations

from typing import NamedTuple

from tdac_envs.core.dynamics import IN_WORLDS, ON_MAPS

LADDER = "Ladder 1.0"
BEFORE = "before Ladder 1.0"
"""What results without a hash of the dynamics are called."""
ON_MAPS_OF_SETS = (*ON_MAPS, "ladder")
ON_PLATES = (
    *(*IN_WORLDS, "ladder", "map2d/contact.py", "map2d/rays.py"),
    *("map2d/straight.py", "map2d/terrain.py"),
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


CODE = {
    ON_MAPS_OF_SETS: "4b0f032f9121c41410cd111be6664c2f345f2f53a85a019b96f0e08f4c542818",
    ON_PLATES: "643703d9d8b7ce73050a08c827d40f0edde49d85c4f05098f30be6d7628d63da",
}
"""Hashes of the code of this ladder."""
FROZEN: dict[str, Frozen] = {
    "known": Frozen(
        "7cd7606b6276646f57999a90d81eee4a83f7b195386c467dd69cb76388ac218f",
        "27039d0862284a44c158211495f9e07e54c0076e47582bbf44c2a597ada72451",
    ),
    "unknown": Frozen(
        "a95bc6cc55cd46d86b71535da6009fd7a23510ec82cd2fd90f1c0484bce42cb4",
        "ae15c7acfc3d8c6f28df23f76cb9f87391c30d6a3d8578d26736cd269dfa0a58",
    ),
    "lost": Frozen(
        "6ecbed8a359e0683cd64b6dbf341b629a93828854c724bc5e1ba6f60b95e29a4",
        "611bb9a95ddc80c8934ee1f7925ceacfe4256ca73c45231aad55bd2e93923e56",
    ),
    "moving": Frozen(
        "fcabb48d5d2ee33aaeb9397e1028dfa123b43fea2e14abbf3468bc5c42e65835",
        "a5409c184440c76cc81d39b937b81a77c3e66b8c5f3029043bdbeb0a6ff1ef77",
    ),
    "crowd": Frozen(
        "535b797efa54b4a55dc7986a4be163783927317b75ec2c1a4facf4b5f737974c",
        "2e1664da3a0f4637c416b82a41fc4f74acb6a1d30b5bc61e8b84e2379f43204f",
    ),
    "epuck": Frozen(
        "f14e67b3a6302229283054585b4c435c02fca0fdc70ece5733dc87fcf89eeb52",
        "82759f4b7a52c6fd098f10795bef4746ac21b365e57d9775f01e59fc18ce525d",
    ),
    "barn": Frozen(
        "57468e2ffea454090dc0a56c2f71ff84396bf818ab061c281dcb0fe5d956700c",
        "47e0e596334814fb423264213a4094abd3d99889b8d65d042bc27910b3210a4a",
    ),
    "barn-slow": Frozen(
        "8595432ce3f749f02d9bfd9eceabd32eb4e5e7e40579e80110597e64b73e3894",
        "cbb5cde160dea8ad2dc2bdea79a08adb4c30629456c7684c3d48154ef0574ba5",
    ),
}
"""The sets of this ladder by name; `python -m tools.frozen` prints the present ones."""
UNCHANGED = ("known", "unknown", "lost", "moving", "crowd", "barn", "barn-slow")
"""Sets with the same dynamics as before; the e-puck of `epuck` had another axle."""


def dynamics_of(name: str, sha256: str, recorded: str) -> str:
    """The dynamics of results; empty if they are of before and not known.

    Args:
        name: Name of the set.
        sha256: Hash of its values.
        recorded: Hash of its dynamics in the results; empty in those of before.
    """
    frozen = FROZEN.get(name)
    if recorded or frozen is None or frozen.sha256 != sha256 or name not in UNCHANGED:
        return recorded
    return frozen.dynamics


def ladder_of(name: str, sha256: str, recorded: str) -> str:
    """To which ladder results belong, in words; empty for sets of one's own.

    Args:
        name: Name of the set.
        sha256: Hash of its values.
        recorded: Hash of its dynamics in the results; empty in those of before.
    """
    if not recorded:
        same = dynamics_of(name, sha256, recorded)
        return f"{BEFORE}, with the same dynamics" if same else BEFORE
    frozen = FROZEN.get(name)
    if frozen is None or frozen.sha256 != sha256:
        return ""
    return LADDER if recorded == frozen.dynamics else f"other dynamics than {LADDER}"
