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
    ON_MAPS_OF_SETS: "b2bc6130054d7ffe85eaadba016f16241a321cce27965d2a4cbe16dce77c93f6",
    ON_PLATES: "decf6518a16335669927ffe4474ef63db0997f86d6450813edf4d9787bd3ffd1",
}
"""Hashes of the code of this ladder."""
FROZEN: dict[str, Frozen] = {
    "known": Frozen(
        "7cd7606b6276646f57999a90d81eee4a83f7b195386c467dd69cb76388ac218f",
        "4732de39f792ee1ffc76a18b7bffaeba38a6d45c17bc159dba049bd5d80a8187",
    ),
    "unknown": Frozen(
        "a95bc6cc55cd46d86b71535da6009fd7a23510ec82cd2fd90f1c0484bce42cb4",
        "0dded3cad566bf59670253f6a4512b05f2571664f54d2fdff795c37d7665b9ce",
    ),
    "lost": Frozen(
        "6ecbed8a359e0683cd64b6dbf341b629a93828854c724bc5e1ba6f60b95e29a4",
        "539f4626d2e9aaf45b35c081569332c2cb75cc7bb6e37fbe1053aae88f359327",
    ),
    "moving": Frozen(
        "fcabb48d5d2ee33aaeb9397e1028dfa123b43fea2e14abbf3468bc5c42e65835",
        "148fd28b674c7339a9f709ba174d4a22de04eac733ff62252a05f5281da884b8",
    ),
    "crowd": Frozen(
        "535b797efa54b4a55dc7986a4be163783927317b75ec2c1a4facf4b5f737974c",
        "40014cf37bfb6b0328fdd9f808d0ca81061c3f01ef78e25e182213ce1899393f",
    ),
    "epuck": Frozen(
        "f14e67b3a6302229283054585b4c435c02fca0fdc70ece5733dc87fcf89eeb52",
        "50d9f37e0a2b1ad16dae4c71063100d3cbaf785147a94b9d002c668c3cd75b6d",
    ),
    "floor": Frozen(
        "cbfaeb76d11da8e106a9d4f20815b3358a85ddab57945a180bd96494e35ba580",
        "3725b42d6762d7c2a26ad8efd229f60dfee4907e80fa47d3f6573c552a031241",
    ),
    "barn": Frozen(
        "57468e2ffea454090dc0a56c2f71ff84396bf818ab061c281dcb0fe5d956700c",
        "a375c1b11e3a0752f21d241b5a7a0d2ae4fcebfc1de3adeda0367c66f14be05d",
    ),
    "barn-slow": Frozen(
        "8595432ce3f749f02d9bfd9eceabd32eb4e5e7e40579e80110597e64b73e3894",
        "28b4a50613594924e75b45f72fe5d06d881ce6f27cdd9cfcffd965caa8c72833",
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
