"""What a run needs of its models is checked before anything else is done."""

import json
import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from fault_server import FaultServer, fails

import tdac_envs
from tdac_agent.errors import Fault, ProviderError
from tdac_agent.models.ready import check_ready, check_servers, connect, needs_limit

ROOT = Path(tdac_envs.__file__).parents[1]
CAMPAIGN = """schema: 1
name: few
tasks: [maze]
learners: ["openai:m"]
runs: 1
max_tokens: 1000
"""
TRUSTED = f"{CAMPAIGN}base_url: http://127.0.0.1:1/v1\n"


@pytest.fixture
def free_port():
    """A port of this machine at which nobody listens."""
    connect.cache_clear()  # another server may have had the port
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        yield held.getsockname()[1]


class Served:
    """A model on a server."""

    def __init__(self, url):
        self.name, self.served_at, self.paid = "openai:m", url, True


def test_a_server_that_answers_is_asked_nothing(server):
    """There is a connection, and no request."""
    check_servers([Served(server.url("openai"))] * 2)
    assert server.seen == []


def test_a_server_is_tried_once():
    """By a command, however often its steps check their models."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        url = f"http://127.0.0.1:{listening.getsockname()[1]}/v1"
        check_servers([Served(url)])
        check_servers([Served(url)])
        listening.accept()[0].close()
        listening.setblocking(False)
        with pytest.raises(BlockingIOError):
            listening.accept()


@pytest.mark.parametrize(
    ("name", "base_url", "needed"),
    [
        ("builtin", None, False),
        ("command:llm", None, False),
        ("openai:gpt-6-sol", None, True),
        ("openai:qwen3", "http://localhost:11434/v1", False),
        ("anthropic:x", "http://[::1]:8000", False),
        ("openai:qwen3", "http://10.0.0.2:8000/v1", True),
    ],
)
def test_what_a_limit_must_bound(monkeypatch, name, base_url, needed):
    """A model that may cost money: none on a server of this machine."""
    monkeypatch.delenv("OPENAI_BASE_URL", raising=False)
    assert needs_limit(name, base_url) == needed
    monkeypatch.setenv("OPENAI_BASE_URL", "http://127.0.0.1:1/v1")
    assert needs_limit(name, base_url) == (needed and base_url is not None)


@pytest.mark.parametrize("url", ["http://127.0.0.1:{}/v1", "https://localhost:{}"])
def test_a_server_that_does_not_answer_is_named(free_port, url):
    """With its address, the reason, and what to do; all servers at once."""
    url = url.format(free_port)
    told = rf"^no server answers at {url} \(Connection refused\), which openai:m needs"
    with pytest.raises(Fault, match=f"{told}: start it, or correct the base URL$"):
        check_servers([Served(url)])
    with pytest.raises(Fault, match=r"[^;]*; no server answers at http://\[::1\]"):
        check_servers([Served(url), Served(f"http://[::1]:{free_port}")])


@pytest.mark.parametrize("url", ["http://127.0.0.1:99999/v1", "http://a b/v1"])
def test_an_address_that_is_none(url):
    """It is a line, too."""
    with pytest.raises(Fault, match="no server answers at"):
        check_servers([Served(url)])


@pytest.mark.parametrize("variable", ["http_proxy", "ALL_PROXY", "all_proxy"])
def test_a_server_behind_a_proxy_is_not_tried(monkeypatch, variable):
    """Only the proxy can say whether it answers."""
    for name in ("http", "all", "no"):
        monkeypatch.delenv(f"{name}_proxy", raising=False)
        monkeypatch.delenv(f"{name}_proxy".upper(), raising=False)
    monkeypatch.setenv(variable, "http://127.0.0.1:1")
    check_servers([Served("http://models.invalid/v1"), Served(None)])


def test_providers_that_look_at_the_task_wait_for_it():
    """Of them only the name is checked; the others are made."""
    check_ready(("builtin", "scripted:weak", None), {})
    check_ready(("manual:never-made",), {})
    assert not Path("never-made").exists()
    with pytest.raises(ProviderError, match="did you mean 'builtin'"):
        check_ready(("bultin",), {})
    with pytest.raises(ProviderError, match="no program 'no-such-program'"):
        check_ready(("builtin", "command:no-such-program"), {})
    with pytest.raises(ProviderError, match="no such model is used"):
        check_ready(("builtin",), {"base_url": "http://127.0.0.1:1"})


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    """A copy of both packages without compiled code, and an empty cache."""
    folder = tmp_path_factory.mktemp("fresh")
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("tdac_envs", "tdac_agent", "configs"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    return folder


@pytest.fixture
def command(fresh, tmp_path):
    """A `tdac` command of that copy; returns exit code and error output."""

    def run(*words, **variables):
        names = ("API_KEY", "BASE_URL")
        hidden = {f"{v}_{n}" for v in ("OPENAI", "ANTHROPIC") for n in names}
        kept = {k: v for k, v in os.environ.items() if k not in hidden}
        done = subprocess.run(
            [sys.executable, "-m", "tdac_agent", *map(str, words)],
            cwd=tmp_path,
            env={
                **kept,
                "PYTHONPATH": str(fresh),
                "XDG_CACHE_HOME": str(tmp_path / "cache"),
                **variables,
            },
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stderr

    return run


LEARNER = ("--learner", "openai:m", "--max-tokens", 1000)
SERVED = (*LEARNER, "--base-url", "http://127.0.0.1:1/v1")
COMMANDS = {
    "a key": (("synth", *LEARNER), 2, "no key for OpenAI"),
    "a price": (("synth", "--learner", "openai:m"), 2, "no price is known"),
    "a server": (("synth", *SERVED), 3, "no server answers at http://127.0.0.1:1/v1"),
    "a set": (("synth", "--set", "easy", *SERVED), 3, "no server answers"),
    "a campaign": (("campaign", "few.yaml"), 2, "no key for OpenAI"),
    "its server": (("campaign", "served.yaml", "--trust"), 3, "no server answers"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_it_is_told_before_anything_is_compiled(command, fresh, tmp_path, name):
    """One line, no folder, and no compiled code, although there was none before."""
    words, expected, told = COMMANDS[name]
    (tmp_path / "few.yaml").write_text(CAMPAIGN)
    (tmp_path / "served.yaml").write_text(TRUSTED)
    code, err = command(*words)
    assert code == expected
    assert told in err.splitlines()[-1]
    assert err.count("\n") == 1
    assert not (tmp_path / "runs").exists()
    assert not (tmp_path / "campaigns").exists()
    compiled = [*fresh.rglob("*.nbi"), *(tmp_path / "cache").rglob("*.nbi")]
    assert compiled == []


@pytest.mark.slow
def test_a_resumed_run_is_checked_as_well(tdac, canary, good):
    """A run of this installation, before its task is loaded; nothing is changed."""
    with FaultServer([fails("openai", 401)]) as server:
        url = server.url("openai")
        words = ("synth", "--task", good, *LEARNER[:2], "--base-url", url)
        assert tdac(*words, "--out", "run")[0] == 3
    before = Path("run/journal.jsonl").read_text()
    record = json.loads(Path("run/run.json").read_text())
    assert record["base_url"] == url
    connect.cache_clear()  # a new command would be a new process
    code, _, err = tdac("synth", "--resume", "run")
    assert (code, err.count("\n")) == (3, 1)
    assert f"no server answers at {url}" in err
    assert Path("run/journal.jsonl").read_text() == before
