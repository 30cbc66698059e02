"""An agent goes from nothing to a verified controller, on a task and on a set."""

import os
import re
import stat

import pytest
from changed_run import journal
from few_worlds import KNOWN, half_of
from mcp_agent import converse, over_stdio, record
from script import STILL
from without_marks import reading

from tdac_agent import load_task
from tdac_agent.environments.map2d.builtin import MapParameters, template_for

PNG = b"\x89PNG\r\n\x1a\n"
TOOLS = {"read_task", "submit", "failures", "picture", "submissions", "choose"}


@pytest.fixture(scope="module")
def good_on_maze():
    """A controller that is verified on the bundled maze."""
    task = load_task("maze")
    return template_for(task.params.robot, task.nominal.dt).render(MapParameters())


@pytest.mark.slow
def test_from_nothing_to_verified_on_a_bundled_task(tmp_path, good_on_maze, done):
    """Over stdio: a bad, a better and a good controller; the run is like any other."""
    better = good_on_maze.replace("def main", "def not_main")

    async def conversation(agent):
        tools = (await agent.client.list_tools()).tools
        assert {tool.name for tool in tools} == TOOLS
        assert all(tool.description for tool in tools)
        text = await agent.told("read_task")
        assert "the task maze" in text
        assert "policy(obs)" in text
        assert "21 submissions" in text
        bad = await agent.submit(STILL)
        assert (bad["submission"], bad["passed"]) == (1, False)
        assert agent.steps, "no progress was told"
        told = await agent.told("failures", submission=1)
        assert "missing constants" in told
        second = await agent.submit(better)
        assert not second["passed"]
        assert "main" in await agent.told("failures", submission=2)
        good = await agent.submit(f"```python\n{good_on_maze}```\n")
        assert (good["submission"], good["passed"]) == (3, True)
        assert good["submissions_left"] == 18
        told = await agent.told("failures", submission=3, envelope=16)
        assert "not each deviation was tried" in told
        assert re.search(r"search of (1[0-6]|[1-9]) episodes", told), told
        for number, episode in ((1, "nominal"), (3, "jitter 1")):
            assert (await agent.picture(number, episode)).startswith(PNG)
        verdict = await agent.choose(3)
        assert verdict["verified"]
        assert "nothing can be submitted" in await agent.error("submit", source=better)
        return bad, second

    out = tmp_path / "run"
    bad, second = converse(over_stdio(tmp_path, "--out", out), conversation)
    assert "27 of 41" in bad["summary"]
    assert not second["summary"].startswith("27")
    run = record(out)
    assert (run["learner"], run["status"], run["tau"]) == ("mcp", "verified", 3)
    assert (run["agent"], run["clients"]) == ("unconfined", ["scripted 7"])
    assert (out / "controller.py").read_text().strip() == good_on_maze.strip()
    assert (out / "trajectory.png").is_file()
    diff = (out / "iterations" / "k03" / "j0" / "controller.diff").read_text()
    assert "-def not_main" in diff
    page = reading(out)
    assert "unconfined: scripted 7" in page
    assert "tdac asked no model" in page
    text = done("runs", tmp_path)
    assert "agent: unconfined (scripted 7)" in text


@pytest.mark.slow
def test_from_nothing_to_verified_on_a_small_set(serve, easy, solver, out):
    """Feedback on new worlds each time, a verdict only by `choose`, aggregates only."""

    async def conversation(agent):
        text = await agent.told("read_task")
        assert "the task set easy" in text
        assert "128 episodes" in text
        bad = await agent.submit(STILL)
        assert "0 of 8 worlds" in bad["summary"]
        told = await agent.told("failures", submission=1)
        assert "8 no motion" in told
        better = await agent.submit(half_of(solver))
        good = await agent.submit(solver)
        assert "8 of 8 worlds" in good["summary"]
        assert not good["passed"]
        assert good["episodes_left"] == 128 - 3 * 8
        worlds = [e["name"] for each in (bad, better, good) for e in each["episodes"]]
        assert len(set(worlds)) == 24
        for number, name in ((1, worlds[0]), (3, f"world {worlds[-1]}")):
            assert (await agent.picture(number, name)).startswith(PNG)
        verdict = await agent.choose(3)
        assert await agent.choose(3) == verdict
        assert "that is final" in await agent.error("choose", submission=2)
        return verdict

    verdict = serve(easy, conversation)
    assert verdict["verified"]
    assert verdict["worlds"] >= verdict["reached"] > 4
    assert "hidden worlds; accepted at" in verdict["summary"]
    run = record(out)
    assert (run["status"], run["tau"], run["agent"]) == ("verified", 3, "unconfined")
    events = [each["event"] for each in journal(out)]
    assert events.index("choose") < events.index("hidden.start")
    assert stat.S_IMODE(os.stat(out).st_mode) == 0o700
    assert stat.S_IMODE(os.stat(out / "sealed").st_mode) == 0o700
    assert "unconfined: scripted 7" in reading(out)


@pytest.mark.slow
def test_from_nothing_to_verified_on_the_ladder(tmp_path, tdac):
    """The level `unknown`, over stdio, with its built-in controller as the good one."""
    good = KNOWN.with_name("unknown.py").read_text()

    async def conversation(agent):
        assert "the task set unknown" in await agent.told("read_task")
        await agent.submit(STILL)
        await agent.submit(half_of(good))
        assert "8 of 8 worlds" in (await agent.submit(good))["summary"]
        return await agent.choose(3)

    out = tmp_path / "run"
    server = over_stdio(tmp_path, "--set", "unknown", "--out", out)
    assert converse(server, conversation)["verified"]
    assert record(out)["status"] == "verified"


@pytest.mark.slow
def test_a_bad_choice_fails(serve, few, out):
    """The verdict is that of hidden worlds, whatever the agent hopes."""

    async def conversation(agent):
        await agent.submit(STILL)
        return await agent.choose(1)

    verdict = serve(few, conversation, episodes=2)
    assert not verdict["verified"]
    assert "rejected at" in verdict["summary"]
    assert record(out)["status"] == "not verified"


@pytest.mark.slow
def test_an_agent_of_the_old_protocol(tmp_path):
    """The handshake with `initialize` tells its name, too."""

    async def conversation(agent):
        return await agent.told("submissions")

    server = over_stdio(tmp_path, "--set", "known", "--out", tmp_path / "run")
    assert "left: 128 episodes" in converse(server, conversation, mode="legacy")
    assert record(tmp_path / "run")["clients"] == ["scripted 7"]
