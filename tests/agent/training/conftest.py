"""Trainings in this process."""

import pytest


@pytest.fixture(autouse=True)
def threads():
    """Training sets the number of threads of the whole process.

    What it needs is loaded here, not when the tests are collected.
    """
    pytest.importorskip("stable_baselines3")
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)
