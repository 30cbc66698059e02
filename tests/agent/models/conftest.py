"""Keys that are none, and a server that fails as it is told."""

import pytest
from fault_server import FaultServer

CANARY = "sk-canary-4f1d2c7be90a4d55"


@pytest.fixture
def canary(monkeypatch):
    """The only key there is; whatever shows it has leaked it."""
    for name in ("ANTHROPIC_BASE_URL", "OPENAI_BASE_URL", "ANTHROPIC_AUTH_TOKEN"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ANTHROPIC_API_KEY", CANARY)
    monkeypatch.setenv("OPENAI_API_KEY", CANARY)
    return CANARY


@pytest.fixture
def server(canary):
    with FaultServer() as server:
        yield server
