"""A hostile agent submits the attacks of the zoo: nothing gets through."""

import contextlib
import json
import sys
import tempfile
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "zoo"))

from cases import all_cases
from enclosure import Canaries
from grounds import write_map_task, zoo_task
from mcp_agent import converse

from tdac_agent import load_task
from tdac_agent.mcp.opening import open_session
from tdac_agent.mcp.server import Counter
from tdac_agent.sandbox import MAX_SOURCE_BYTES
from tdac_agent.tasks.installation import lasting_secret

ATTACKS = [case for case in all_cases() if not case.passes]
FEW = {
    *("forged_positions", "proc_walk", "tapes_of_known_starts", "read_secret"),
    *("installation_secret", "write_judge", "terminal_escapes", "env_keys"),
    *("printed_verdict", "patched_modules", "ten_megabytes", "right_to_left"),
}


async def attack(agent, case, source):
    """Everything that the agent is told about an attack."""
    if len(source) > MAX_SOURCE_BYTES:
        return [await agent.error("submit", source=source)]
    answer = await agent.submit(source)
    number = answer["submission"]
    assert not answer["passed"], case
    told = [json.dumps(answer, ensure_ascii=False)]
    told.append(await agent.told("failures", submission=number))
    told.append(await agent.told("submissions"))
    told.append(await agent.error("choose", submission=number))
    return told


def submit_all(cases, out):
    """Submits attacks among canaries: one run for each kind of task, profile, seed."""
    groups = {}
    for case in cases:
        seed = None if case.header.get("seed") else 0
        groups.setdefault((case.kind, case.header["profile"], seed), []).append(case)
    for (kind, profile, seed), own in groups.items():
        task = task_of(kind, out).with_profile(profile)
        check(own, task, seed, out / f"{kind}-{profile}-{seed}")


def task_of(kind, out):
    """The zoo's task, with files of which a run folder can have copies."""
    if kind != "map2d":
        return zoo_task(kind)
    folder = out / "task"
    folder.mkdir(parents=True, exist_ok=True)
    return load_task(write_map_task(folder))


def check(cases, task, seed, out):
    """No attack of these is verified, reads anything, or controls a terminal."""
    episodes = 6 * (len(cases) + 1)
    with (
        tempfile.TemporaryDirectory(prefix="zoo-") as name,
        Canaries(name) as around,
        open_session(task, out, episodes, "unconfined") as session,
        contextlib.closing(Counter(session)) as counter,
    ):
        # Weak controllers fail with the zoo's seed, not with each one.
        session.run.seed = seed
        secrets = (Path(name) / "secret.txt").read_text(), lasting_secret().hex()

        async def conversation(agent):
            for case in cases:
                source = around.fill_in(case.body).decode("utf-8", "replace")
                for text in await attack(agent, case, source):
                    for secret in (*secrets, "\x1b", "\u202e"):
                        assert secret not in text, case

        converse(counter.server(), conversation)
        assert not any(around.touched().values())
    kept = [path for path in out.rglob("*.json*") if path.is_file()]
    for path in kept:
        content = path.read_text()
        assert not any(secret in content for secret in secrets), path


@pytest.mark.slow
def test_a_few_attacks(tmp_path):
    """What is tried in each run of the tests."""
    few = [case for case in ATTACKS if case.name in FEW and case.kind == "map2d"]
    assert len(few) == len(FEW)
    submit_all(few, tmp_path / "runs")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map2d", "epuck"])
def test_all_attacks(tmp_path, kind):
    """The whole zoo, one after another in the same run."""
    submit_all([case for case in ATTACKS if case.kind == kind], tmp_path / "runs")
