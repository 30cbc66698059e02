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
    # As in trainings of the product: small networks are slower with more.
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
