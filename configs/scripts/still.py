"""Stands still."""


def policy(obs):
    """The action for an observation: none."""
    del obs
    return 0.0, 0.0
