"""What agents should not do: each is answered in one line, and harms nothing."""

import contextlib
import json
import os
import signal
import subprocess
from pathlib import Path

import anyio
import pytest
from mcp_agent import converse, record, words
from script import STILL

SECONDS = 90


@pytest.mark.slow
def test_requests_that_cannot_be_answered(serve, small_task, good_source):
    """Unknown tools, submissions and episodes, held-out starts, wrong arguments."""

    async def conversation(agent):
        error = agent.error
        assert "nothing has been submitted" in await error("failures", submission=1)
        assert "300000 bytes" in await error("submit", source="#" * 300_000)
        assert "is empty" in await error("submit", source=" \n")
        assert "did you mean 'picture'" in await error("pictures")
        assert "source: is missing" in await error("submit")
        assert "unknown key" in await error("submit", source=STILL, name="x")
        await agent.submit(good_source)
        assert "only submission 1" in await error("failures", submission=2)
        told = await error("failures", submission=1, envelope=5)
        assert "expected 0, or 16 and more" in told
        assert "there is no submission 0" in await error("choose", submission=0)
        assert "valid integer" in await error("failures", submission="first")
        told = await error("picture", submission=1, episode="jitter 4")
        assert "held-out" in told
        told = await error("picture", submission=1, episode="../../run")
        assert "expected one of nominal, jitter 1" in told
        bad = await agent.submit(STILL)
        assert "jitter 4" not in json.dumps(bad)
        assert "only a submission that passed" in await error("choose", submission=2)
        listed = await agent.call("submissions")
        return listed.structured_content

    listed = serve(small_task, conversation)
    assert [each["passed"] for each in listed["submissions"]] == [True, False]
    assert listed["submissions_left"] == 19
    assert listed["ended"] is None


@pytest.mark.slow
def test_the_same_file_is_not_judged_again(serve, small_task):
    """An agent that lost the answer may submit again."""

    async def conversation(agent):
        return await agent.submit(STILL), await agent.submit(STILL)

    first, second = serve(small_task, conversation)
    assert first == second


@pytest.mark.slow
def test_a_spent_budget_on_a_task(serve, small_task, out):
    """Twelve episodes are two submissions; without success, the run has ended."""

    async def conversation(agent):
        await agent.submit(STILL)
        left = await agent.submit(f"{STILL}\n")
        assert left["submissions_left"] == 0
        return await agent.error("submit", source=f"{STILL}\n\n")

    assert "all submissions failed" in serve(small_task, conversation, episodes=12)
    assert record(out)["status"] == "not verified"


@pytest.mark.slow
def test_a_spent_budget_on_a_set(serve, few):
    """The last submission gets what is left; one can still be chosen."""

    async def conversation(agent):
        await agent.submit(STILL)
        last = await agent.submit(STILL)
        assert (last["episodes_left"], len(last["episodes"])) == (0, 2)
        told = await agent.error("submit", source=STILL)
        assert "budget is spent" in told
        listed = (await agent.call("submissions")).structured_content
        assert [each["can_be_chosen"] for each in listed["submissions"]] == [True] * 2

    serve(few, conversation, episodes=10)


@pytest.mark.slow
def test_a_refused_file_costs_no_episode(serve, few):
    """Static and contract tests come first, and such a file cannot be chosen."""

    async def conversation(agent):
        answer = await agent.submit(f"import os\n\n\n{STILL}")
        assert (answer["episodes"], answer["episodes_left"]) == ([], 10)
        assert "os" in await agent.told("failures", submission=1)
        assert "refused it" in await agent.error("choose", submission=1)
        await agent.error("picture", submission=1, episode=1)

    serve(few, conversation, episodes=10)


def judges():
    """Processes of judges that this process has started."""
    found = set()
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            command = (folder / "cmdline").read_bytes()
            if int(fields[1]) == os.getpid() and b"judge.server" in command:
                found.add(int(folder.name))
    return found


def test_a_broken_judge(serve, small_task, out):
    """Neither verified nor failed: the submission does not count, nor is it kept."""
    others = judges()

    async def conversation(agent):
        for process in judges() - others:
            os.kill(process, signal.SIGKILL)
        told = await agent.error("submit", source=STILL)
        assert told.startswith("infrastructure fault, no verdict: the judge ended")
        assert told.endswith("this submission does not count")
        return (await agent.call("submissions")).structured_content

    listed = serve(small_task, conversation)
    assert (listed["submissions"], listed["submissions_left"]) == ([], 21)
    assert list(out.glob("iterations/*/*/controller.py")) == []


@pytest.mark.slow
def test_two_at_once(running, tmp_path, small_task, good_source):
    """Over HTTP: both get right answers, and no number twice."""
    from mcp import Client
    from mcp_agent import NAME, Agent, over_http

    server = running("--task", small_task.folder, "--out", tmp_path / "run")
    found = []

    async def one(source):
        transport = over_http(server.address)
        async with Client(transport, client_info=NAME) as client:
            found.append((source, await Agent(client).submit(source)))

    async def both():
        async with anyio.create_task_group() as group:
            for source in (STILL, good_source, f"{STILL}\n"):
                group.start_soon(one, source)

    anyio.run(both)
    assert {answer["submission"] for _, answer in found} == {1, 2, 3}
    for source, answer in found:
        assert answer["passed"] == (source == good_source)
        file = tmp_path / "run" / "iterations" / f"k0{answer['submission']}" / "j0"
        assert (file / "controller.py").read_text() == source
    assert record(tmp_path / "run")["agent"] == "over HTTP"


def test_two_servers_on_one_folder(serve, small_task, out, tdac):
    """The second one is refused in one line."""

    async def conversation(agent):
        return tdac("mcp", "--task", small_task.folder, "--out", out)

    code, text, error = serve(small_task, conversation)
    assert (code, text) == (2, "")
    assert "another process is at work" in error
    assert len(error.strip().splitlines()) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--task", "maze", "--set", "known"], "leave out --task"),
        (["--port", "0"], "--port needs --http"),
        (["--episodes", "5"], "episodes"),
        (["--set", "barn"], "files"),
    ],
)
def test_flags_that_are_refused(refused, arguments, told):
    error = refused("mcp", *arguments)
    assert told in error


@pytest.mark.slow
@pytest.mark.parametrize("how", ["SIGINT", "SIGTERM", "end of stdin"])
def test_the_end_of_a_server(tmp_path, how, no_traces, small_task):
    """At once, although a submission is being judged; stdout has the protocol only."""
    out, by_signal = tmp_path / "run", how != "end of stdin"
    process = subprocess.Popen(
        words("--task", small_task.folder, "--out", out),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )

    def send(**message):
        process.stdin.write(json.dumps({"jsonrpc": "2.0", **message}) + "\n")
        process.stdin.flush()

    with process:
        name = {"name": "raw\x1b[2J", "version": "1"}
        about = {"protocolVersion": "2025-06-18", "capabilities": {}}
        send(id=1, method="initialize", params={**about, "clientInfo": name})
        assert json.loads(process.stdout.readline())["id"] == 1
        send(method="notifications/initialized")
        arguments = {"source": "def policy(obs):\n    while True:\n        pass\n"}
        call = {"name": "submit", "arguments": arguments, "_meta": {"progressToken": 1}}
        send(id=2, method="tools/call", params=call)
        told = json.loads(process.stdout.readline())
        assert told["method"] == "notifications/progress"
        if by_signal:
            process.send_signal(getattr(signal, how))
        else:
            process.stdin.close()
        rest, error = process.stdout.read(), process.stderr.read()
        assert process.wait(SECONDS) == (130 if by_signal else 0)
    assert error == ("interrupted\n" if by_signal else "")
    for line in rest.splitlines():
        assert json.loads(line)["jsonrpc"] == "2.0"
    run = record(out)
    assert (run["status"], run["attempts"]) == ("interrupted", [])
    assert run["clients"] == ["raw\N{REPLACEMENT CHARACTER}[2J 1"]


@pytest.mark.slow
def test_nothing_is_left_of_a_server_that_was_not_used(tmp_path, tdac):
    """An agent's program may start its server each time, and need it never."""
    from mcp_agent import over_stdio

    async def conversation(agent):
        return await agent.told("submissions")

    converse(over_stdio(tmp_path, "--set", "known"), conversation)
    assert list((tmp_path / "runs").iterdir()) == []
