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
    ON_MAPS_OF_SETS: "46a5299112cd13c1188f8899f0e1d9ef6aa22ac926b7f3b91c12e6dbe9ef96e7",
    ON_PLATES: "bafe5cc4e1227b0fe28e68475a0256d2f75bf8119d7486d5d3bb1cba1f990dab",
}
"""Hashes of the code of this ladder."""
FROZEN: dict[str, Frozen] = {
    "known": Frozen(
        "7cd7606b6276646f57999a90d81eee4a83f7b195386c467dd69cb76388ac218f",
        "11c716aa46f7f7bdd2a8b68b8fcea71a7d6486a7706e82b32dd80132f5fdccab",
    ),
    "unknown": Frozen(
        "a95bc6cc55cd46d86b71535da6009fd7a23510ec82cd2fd90f1c0484bce42cb4",
        "1321d15d414d244172796448b85e90a1239f95bd0d277f4ef4e44981fabe4188",
    ),
    "lost": Frozen(
        "6ecbed8a359e0683cd64b6dbf341b629a93828854c724bc5e1ba6f60b95e29a4",
        "dc6b2762f14d2ec644de05da583bd3fe3992e19513eaef7a3cf7ee217451de30",
    ),
    "moving": Frozen(
        "fcabb48d5d2ee33aaeb9397e1028dfa123b43fea2e14abbf3468bc5c42e65835",
        "59f13e0f96b6c2ee4415117d24d69667e62b4eb098145bec350daef69bb2785d",
    ),
    "crowd": Frozen(
        "535b797efa54b4a55dc7986a4be163783927317b75ec2c1a4facf4b5f737974c",
        "4e79c44256adbbc84db75098354b0f0c3ae93aa7805bd29c8774af524513545e",
    ),
    "epuck": Frozen(
        "f14e67b3a6302229283054585b4c435c02fca0fdc70ece5733dc87fcf89eeb52",
        "03a759c096c9ecb9f8ae3936707aad7b14c8483a827b5490a9f2b16b664881d8",
    ),
    "floor": Frozen(
        "cbfaeb76d11da8e106a9d4f20815b3358a85ddab57945a180bd96494e35ba580",
        "1819cfafeb8a77c24bc2dc54774313b6f0bb1bd214255194ebad4e5b461e0b68",
    ),
    "barn": Frozen(
        "57468e2ffea454090dc0a56c2f71ff84396bf818ab061c281dcb0fe5d956700c",
        "dc3cdaa85e26921e859a7cb95f0a6c408e434e8069fbfd93818d2d99385e25cd",
    ),
    "barn-slow": Frozen(
        "8595432ce3f749f02d9bfd9eceabd32eb4e5e7e40579e80110597e64b73e3894",
        "8f9669e3b16753a7cd38039e177b64d70dce08e09c543f6d30d7feda1919c8bd",
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
