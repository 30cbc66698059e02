"""Servers, and what agents submit to them."""

import contextlib

import pytest

pytest.importorskip("mcp.server", reason="needs tdac[mcp]")

from few_worlds import write_set
from mcp_agent import Running, converse

from tdac_agent.mcp.opening import open_session
from tdac_agent.mcp.server import Counter
from tdac_envs import load_set


@pytest.fixture
def easy(tmp_path):
    """The same, with a low bar: few hidden worlds decide that it is met."""
    return load_set(write_set(tmp_path / "easy.yaml", bar=0.1))


@pytest.fixture
def serve(out):
    """Runs a conversation with a server in this process."""

    def run(about, conversation, episodes=128):
        with (
            open_session(about, out, episodes, "unconfined") as session,
            contextlib.closing(Counter(session)) as counter,
        ):
            return converse(counter.server(), conversation)

    return run


@pytest.fixture
def running(tmp_path):
    """Starts servers over HTTP, which end with the test."""
    started = []

    def start(*arguments, **options):
        started.append(Running(tmp_path, arguments, **options).start())
        return started[-1]

    yield start
    for server in started:
        server.process.kill()
        server.process.communicate()
