"""Half of the test files, drawn by a seed: what CI runs with other versions."""

import random


def is_in_half(seed: str, nodeid: str) -> bool:
    """Whether the file of a test is in the half that a seed draws."""
    return random.Random(f"{seed} {nodeid.partition('::')[0]}").random() < 0.5
