"""Over HTTP: the token, the host and the origin are checked; nothing else is told."""

import http.client
import json
import re
from urllib.parse import urlsplit

import pytest
from few_worlds import write_set
from mcp_agent import TOKEN, Running, converse, over_http, record
from script import STILL


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """One for all tests of this file."""
    place = tmp_path_factory.mktemp("http")
    write_set(place / "few.yaml")
    arguments = "--set", "few.yaml", "--out", "run"
    started = Running(place, arguments).start()
    yield started
    started.process.kill()
    started.process.communicate()


@pytest.fixture
def ask(server):
    """Sends a request; gives status and text."""

    def asked(path="/mcp", method="POST", body=None, **headers):
        place = urlsplit(server.address)
        connection = http.client.HTTPConnection(place.hostname, place.port, timeout=60)
        given = {
            "Content-Type": "application/json",
            "Accept": "application/json, text/event-stream",
            **{name.replace("_", "-"): value for name, value in headers.items()},
        }
        content = json.dumps(HELLO if body is None else body)
        connection.request(method, path, content, headers=given)
        answer = connection.getresponse()
        found = answer.status, answer.read().decode("utf-8", "replace")
        connection.close()
        return found

    return asked


HELLO = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {
        "protocolVersion": "2025-06-18",
        "capabilities": {},
        "clientInfo": {"name": "raw", "version": "1"},
    },
}
KEY = {"Authorization": f"Bearer {TOKEN}"}


@pytest.mark.parametrize("path", ["/mcp", "/", "/.well-known/oauth-protected-resource"])
@pytest.mark.parametrize(
    "headers",
    [{}, {"Authorization": "Bearer wrong"}, {"Authorization": TOKEN},
     {"Authorization": "Bearer "}, {"Cookie": f"token={TOKEN}"}],
)  # fmt: skip
def test_without_the_token_nobody_gets_in(ask, path, headers):
    for method in ("POST", "GET", "DELETE"):
        status, text = ask(path, method, **headers)
        assert status == 401
        assert TOKEN not in text


def test_pages_and_names_of_others(ask, server):
    """A page of another site, and a name of another site that leads here."""
    port = urlsplit(server.address).port
    for foreign in ("http://evil.example", "null", f"http://evil.example:{port}"):
        assert ask(Origin=foreign, **KEY)[0] == 403
    for host in (f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}"):
        assert ask(Host=host, **KEY)[0] == 403
    own = f"http://127.0.0.1:{port}"
    assert ask(Origin=own, **KEY)[0] == 200
    assert ask(**KEY)[0] == 200


def test_a_request_that_is_too_large(ask):
    assert ask(body="x" * (5 << 20), **KEY)[0] == 413


def test_an_agent_over_http(server):
    """Told are answers alone: no path, salt or secret of the server."""

    async def conversation(agent):
        texts = [await agent.told("read_task")]
        await agent.submit(STILL)
        texts.append(await agent.told("failures", submission=1))
        texts.append(await agent.told("submissions"))
        return texts

    for mode in ("auto", "legacy"):
        for text in converse(over_http(server.address), conversation, mode=mode):
            assert str(server.place) not in text
            assert TOKEN not in text
    run = record(server.place / "run")
    assert (run["agent"], run["clients"]) == ("over HTTP", ["scripted 7"])


@pytest.mark.slow
def test_a_token_is_drawn(running, tmp_path):
    """Printed once, on stderr; the address has none."""
    write_set(tmp_path / "few.yaml")
    server = running("--set", "few.yaml", token=None)
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/mcp", server.address)
    line = server.process.stderr.readline()
    token = re.fullmatch(r"bearer token: (\S{32})\n", line)[1]

    async def conversation(agent):
        return await agent.told("submissions")

    transport = over_http(server.address, token)
    assert "nothing has been submitted" in converse(transport, conversation)
    code, error = server.end()
    assert (code, error) == (130, "interrupted\n")


def test_a_weak_token_is_refused(refused, monkeypatch):
    monkeypatch.setenv("TDAC_MCP_TOKEN", "short")
    error = refused("mcp", "--set", "known", "--http")
    assert "at least 16" in error


def test_a_port_that_is_taken(refused, server):
    port = urlsplit(server.address).port
    error = refused("mcp", "--set", "known", "--http", "--port", port)
    assert f"--port {port}: " in error
