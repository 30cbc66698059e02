"""A server that was killed is started again: nothing is lost or counted twice."""

import signal
import time

import anyio
import pytest
from changed_run import journal
from few_worlds import write_set
from mcp_agent import (
    converse,
    over_http,
    over_stdio,
    record,
)
from script import STILL

SECONDS = 60
SPIN = "def policy(obs):\n    return 0.3, -0.3\n"


def wait_until(true):
    """Waits until a condition is true."""
    deadline = time.monotonic() + SECONDS
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def has(folder, event, count):
    """Whether the journal has so many records of an event."""
    found = [each for each in journal(folder) if each["event"] == event]
    return len(found) == count


def kill_when(server, true, request):
    """Sends a request, and kills the server when a condition is true."""

    async def whole():
        async with anyio.create_task_group() as group:

            async def kill():
                await anyio.to_thread.run_sync(wait_until, true)
                server.end(signal.SIGKILL)
                group.cancel_scope.cancel()

            group.start_soon(kill)
            transport = over_http(server.address)
            await anyio.to_thread.run_sync(converse, transport, request)

    with pytest.raises(Exception):  # noqa: B017, PT011 - however it breaks
        anyio.run(whole)


async def submissions(agent):
    """The list, once what an earlier server left has been judged."""
    while (result := await agent.call("submissions")).is_error:
        assert "ask again" in result.content[0].text
        await anyio.sleep(0.2)
    return result.structured_content


@pytest.mark.slow
def test_a_request_is_not_kept_waiting_for_what_was_left(
    serve, small_task, out, monkeypatch
):
    """It is told why there is no answer yet; the next ones are answered."""

    async def first(agent):
        return await agent.submit(STILL)

    serve(small_task, first)
    left = out / "iterations/k02/j0/controller.py"
    left.parent.mkdir(parents=True)
    left.write_text(f"import time\n\ntime.sleep(3)\n{STILL}")
    monkeypatch.setattr("tdac_agent.mcp.server.PATIENCE", 0.01)

    async def later(agent):
        return await agent.error("submissions"), await submissions(agent)

    told, listed = serve(small_task, later)
    assert "an earlier server was ended while it judged" in told
    assert [each["submission"] for each in listed["submissions"]] == [1, 2]


@pytest.mark.slow
def test_killed_while_it_judges(running, tmp_path):
    """The submission in progress is judged at the next start, on the same worlds."""
    write_set(tmp_path / "few.yaml")
    out = tmp_path / "run"
    arguments = "--set", tmp_path / "few.yaml", "--episodes", 40, "--out", out
    server = running(*arguments)

    async def first(agent):
        return await agent.submit(STILL)

    async def second(agent):
        return await agent.submit(SPIN)

    assert converse(over_http(server.address), first)["episodes_left"] == 32
    kill_when(server, lambda: has(out, "drive.start", 2), second)
    assert record(out)["status"] == "running"

    async def later(agent):
        listed = await submissions(agent)
        third = await agent.submit(STILL)
        return listed, third

    # Over stdio, which is on record from now on.
    listed, third = converse(over_stdio(tmp_path, "--out", out), later)
    assert [each["submission"] for each in listed["submissions"]] == [1, 2]
    assert "of 8 worlds" in listed["submissions"][1]["summary"]
    assert listed["episodes_left"] == 24
    assert (third["submission"], third["episodes_left"]) == (3, 16)
    run = record(out)
    assert [attempt["k"] for attempt in run["attempts"]] == [1, 2, 3]
    assert run["agent"] == "unconfined"
    ends = [each["k"] for each in journal(out) if each["event"] == "verify.end"]
    assert ends == [1, 2, 3]


@pytest.mark.slow
def test_killed_after_the_choice(running, tmp_path, solver):
    """The choice is final: the next start gives the verdict, with the same salt."""
    write_set(tmp_path / "few.yaml")
    out = tmp_path / "run"
    server = running("--set", tmp_path / "few.yaml", "--out", out)

    async def first(agent):
        await agent.submit(solver)
        await agent.choose(1)

    file = out / "sealed" / "salt"
    kill_when(server, file.exists, first)
    salt = file.read_bytes()

    async def later(agent):
        told = await agent.error("submit", source=STILL)
        return told, await agent.choose(1)

    told, verdict = converse(over_stdio(tmp_path, "--out", out), later)
    assert "was chosen" in told
    assert verdict["verified"]
    assert file.read_bytes() == salt
    assert record(out)["status"] == "verified"


@pytest.mark.slow
def test_a_finished_run_answers_from_its_record(serve, small_task, good_source, out):
    """All but `submit`, without another verification."""

    async def first(agent):
        await agent.submit(STILL)
        await agent.submit(good_source)
        return await agent.choose(2)

    verdict = serve(small_task, first)
    before = (out / "run.json").read_bytes()

    async def later(agent):
        assert await agent.choose(2) == verdict
        assert "test_constants" in await agent.told("failures", submission=1)
        assert await agent.picture(2, "nominal")
        assert "nothing can be submitted" in await agent.error("submit", source="x=1")
        return (await agent.call("submissions")).structured_content

    listed = serve(small_task, later)
    assert [each["verified"] for each in listed["submissions"]] == [False, True]
    assert listed["ended"].endswith("submission 2 was chosen and is verified")
    assert (out / "run.json").read_bytes() == before
    file = out / "confirmation.json"
    file.write_text(file.read_text().replace("0.95", "0.9999"))

    async def changed(agent):
        assert "missing or was changed" in await agent.error("choose", submission=2)

    serve(small_task, changed)


def test_another_run_is_refused(serve, small_task, few, out, refused):
    """Another task, another budget, and a run that another program began."""

    async def conversation(agent):
        await agent.told("submissions")

    serve(small_task, conversation)
    error = refused("mcp", "--set", "known", "--out", out)
    assert f"tdac mcp --out {out}" in error
    words = "--task", small_task.folder, "--episodes", 60, "--out", out
    error = refused("mcp", *words)
    assert "K 21 instead of 10" in error
    error = refused("synth", "--resume", out)
    assert f"tdac mcp --out {out}" in error


def test_a_run_of_another_installation_is_refused(serve, small_task, out, refused):
    """Its record is not trusted."""

    async def conversation(agent):
        await agent.told("submissions")

    serve(small_task, conversation)
    text = (out / "run.json").read_text()
    mark = record(out)["mark"]
    (out / "run.json").write_text(text.replace(mark, "0" * len(mark)))
    error = refused("mcp", "--out", out)
    assert "did not begin" in error
