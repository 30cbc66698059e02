"""Whole runs with the vendors' packages: faults, interrupts, and where the key is."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from changed_run import journal
from fault_server import ANTHROPIC, MODEL, OPENAI, PATHS, answers, begins, fails
from script import STILL
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.errors import Fault
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.runs.run_record import load_run

AT_ONCE = RetryPolicy(first_wait=0.0)


def code(vendor, source):
    return answers(vendor, f"Here:\n```python\n{source}```\n")


@pytest.fixture
def task_file(tmp_path):
    return write_small_task(tmp_path / "task", profile="policy") / "task.yaml"


@pytest.mark.slow
def test_faults_cost_neither_k_nor_j(
    server, task_file, good_source, tmp_path, monkeypatch, warm
):
    """Learner and optimizer of different vendors, both with faults: k = 1, j = 1."""
    for vendor in (ANTHROPIC, OPENAI):
        monkeypatch.setenv(f"{vendor.upper()}_BASE_URL", server.url(vendor))
    server.script = [
        fails(ANTHROPIC, 529, "overloaded_error"),
        begins(ANTHROPIC, lambda line: line.reset()),
        begins(ANTHROPIC, lambda line: None),
        code(ANTHROPIC, STILL),
        fails(OPENAI, 429, "rate_limit_exceeded", retry_after="0"),
        code(OPENAI, good_source),
    ]
    out = tmp_path / "run"
    task = load_task(task_file)
    run = synthesize(
        task,
        "anthropic:m",
        "openai:n",
        out=out,
        iterations=1,
        retry=AT_ONCE,
        judge=warm,
    )
    assert [(a.k, a.j, a.passed) for a in run.attempts] == [(1, 0, False), (1, 1, True)]
    paths = [seen.path for seen in server.seen]
    assert paths == [PATHS[ANTHROPIC]] * 4 + [PATHS[OPENAI]] * 2
    bodies = [json.dumps(seen.body, sort_keys=True) for seen in server.seen]
    assert len(set(bodies)) == 2, "an equal question is asked again"
    events = journal(out)
    faults = [r["fault"] for r in events if r["event"] == "call.fault"]
    assert faults == ["transient"] * 3 + ["rate limit"]
    kept = load_run(out)
    assert (kept.learner, kept.optimizer) == ("anthropic:m", "openai:n")
    assert (kept.tokens_in, kept.tokens_out, kept.tokens_cached) == (60, 10, 40)
    assert kept.models == (MODEL,)
    replies = [r for r in events if r["event"] == "call.reply"]
    assert {r["request_id"] for r in replies} == {"req_7"}
    assert "Here:" in (out / "iterations/k01/j1/edit.reply.md").read_text()


@pytest.mark.slow
def test_a_fault_that_stays_ends_the_run(
    server, task_file, good_source, tmp_path, monkeypatch, warm
):
    """A wrong key in mid-run: the run ends as a fault, all before it is kept."""
    server.script = [
        code(ANTHROPIC, STILL),
        fails(ANTHROPIC, 401, "authentication_error", "no such key"),
    ]
    url = server.url(ANTHROPIC)
    expected = "anthropic:m: 401: authentication_error: no such key"
    with pytest.raises(Fault, match=expected):
        synthesize(
            load_task(task_file),
            "anthropic:m",
            out=tmp_path / "run",
            base_url=url,
            judge=warm,
        )
    run = load_run(tmp_path / "run")
    assert run.status == "fault"
    assert run.base_url == url
    assert [(a.k, a.j) for a in run.attempts] == [(1, 0)]
    assert len(server.seen) == 2


def start(words, **variables):
    """`tdac` in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, **variables},
        text=True,
    )


@pytest.mark.slow
@pytest.mark.parametrize("vendor", [ANTHROPIC, OPENAI])
def test_an_interrupt_in_a_call(server, task_file, tmp_path, no_traces, vendor):
    """Ctrl-C while a server is silent: exit 130, and the run can be read."""
    process = None

    def silent(line):
        process.send_signal(signal.SIGINT)
        line.stall()

    server.script = [silent]
    out, url = tmp_path / "run", server.url(vendor)
    words = ["synth", "--task", task_file, "--learner", f"{vendor}:m"]
    process = start([*words, "--base-url", url, "--out", out])
    stdout, stderr = process.communicate(timeout=120)
    assert process.returncode == 130
    assert stderr.splitlines()[-1] == "interrupted"
    assert "interrupted" not in stdout
    assert f"to continue: tdac synth --resume {out}" in stdout
    assert "Traceback" not in stderr
    assert load_run(out).status == "interrupted"
    assert len(server.seen) == 1


def descendants(pid):
    """Processes that one has started, and those that they have."""
    found = []
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in path.read_text().split():
            found += [int(child), *descendants(child)]
    return found


def shown_by(pid):
    """What others can see of a process: its command line, and its environment."""
    try:
        folder = Path(f"/proc/{pid}")
        return (folder / "cmdline").read_bytes(), (folder / "environ").read_bytes()
    except OSError:
        return b"", b""


@pytest.mark.slow
def test_the_key_is_in_no_place(server, canary, task_file, tmp_path, no_traces):
    """Not in a file, message, command line or child, even where a server repeats it."""
    process, secret, seen = None, canary.encode(), []

    def look(line):
        children = descendants(process.pid)
        seen.extend(shown_by(pid) for pid in children)
        seen.append((shown_by(process.pid)[0], b""))
        told = line.handler.headers["authorization"]
        assert canary in told
        if len(server.seen) == 1:
            return answers(OPENAI, f"{told}\n```python\n{STILL}# {told}\n```\n")(line)
        return fails(OPENAI, 401, "invalid_api_key", f"wrong key: {told}")(line)

    server.script = [look]
    words = ["synth", "--task", task_file, "--learner", "openai:m", "--json"]
    out = tmp_path / "run"
    # The packages' own logs are asked for, too: they go to stderr.
    process = start(
        [*words, "--base-url", server.url(OPENAI), "--out", out], OPENAI_LOG="debug"
    )
    stdout, stderr = process.communicate(timeout=120)
    assert process.returncode == 3, stderr
    assert "HTTP Request" in stderr
    assert len(server.seen) == 2
    assert canary not in stdout + stderr
    assert "401: invalid_api_key: wrong key: Bearer [" in stderr
    assert len([shown for shown in seen if shown[1]]) > 0, "no child was looked at"
    assert all(secret not in shown for pair in seen for shown in pair)
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert any(path.name == "generate.reply.md" for path in files)
    assert [path for path in files if secret in path.read_bytes()] == []


def test_the_key_is_in_no_trace(canary, server):
    """An error of the package or of ours shows it neither in words nor by its parts."""
    from tdac_agent.models.anthropic_api import AnthropicModel
    from tdac_agent.models.provider import ProviderFault, Request

    def tells(line):
        fails(ANTHROPIC, 500, "api_error", line.handler.headers["authorization"])(line)

    server.script = [tells]
    model = AnthropicModel("m", server.url(ANTHROPIC))
    with pytest.raises(ProviderFault) as caught:
        model.complete(Request("generate", "?"))
    assert caught.value.__cause__ is None
    assert caught.value.__suppress_context__
    assert canary not in str(caught.getrepr(style="long", chain=False))
    assert canary not in repr(vars(model))
