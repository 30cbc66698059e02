"""Killed with -9 at any moment, a run goes on as if nothing had been."""

import json
import random
import re
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path

import pytest
from crash_child import run_all
from fault_server import OPENAI, answers
from script import STILL
from small import write_small_task

from tdac_agent.models.prices import SHIPPED, load_prices
from tdac_agent.runs.ownership import is_own_folder
from tdac_agent.runs.run_record import load_rules, load_run
from tdac_agent.storage.journal import read_records

CHILD = Path(__file__).parents[1] / "crash_child.py"
PRICE = load_prices(SHIPPED).models["openai:gpt-4o"]
ENOUGH = 10.0


class Model:
    """Answers by the rules in the question; bills each question at the worst case."""

    def __init__(self, server, good_source):
        self.server = server
        self.good = good_source
        self.iterations = 6
        self.billed = 0.0
        self.lock = threading.Lock()
        self.asked = Counter()
        server.script = [self.play]

    def play(self, line):
        prompt = line.seen.body["messages"][0]["content"]
        tokens_in, tokens_out = len(prompt.encode()), line.seen.body["max_tokens"]
        with self.lock:
            self.asked[line.seen.path, prompt] += 1
            self.billed += PRICE.most(tokens_in, tokens_out)
        learnt = len(set(re.findall(r"Lesson (\d+)\.", prompt)))
        if "list of at most" in prompt:
            rule = {"op": "add", "scope": "code", "text": f"Lesson {learnt + 1}."}
            text = f"```json\n{json.dumps([rule])}\n```\n"
        else:
            source = (
                self.good if learnt == self.iterations - 1 else f"{STILL}N = {learnt}\n"
            )
            text = f"```python\n{source}```\n"
        usage = (tokens_in, tokens_out)
        answers(OPENAI, text, counts=usage)(line)

    @property
    def url(self):
        return self.server.url(OPENAI).replace("/v1", "/RUN/v1")


@pytest.fixture
def model(server, good_source, monkeypatch, tmp_path):
    monkeypatch.setenv("TDAC_PRICES", str(SHIPPED))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return Model(server, good_source)


@pytest.fixture
def task_folder(tmp_path):
    return write_small_task(tmp_path / "task", profile="policy")


def start(model, task, folders, kill_at=0, share=1.0, max_cost=ENOUGH):
    """Makes the runs; their statuses, None where their process was killed."""
    if kill_at == 0 and len(folders) == 1:
        ended = run_all(task, model.url, max_cost, folders, model.iterations)
    else:
        words = [CHILD, task, model.url, kill_at, share, max_cost, model.iterations]
        done = subprocess.run(
            [sys.executable, *map(str, [*words, *folders])],
            capture_output=True,
            text=True,
            check=False,
        )
        assert "Traceback" not in done.stderr, done.stderr
        ended = None if done.returncode == -9 else done.stdout.split()
    assert model.billed <= max_cost + 1e-9, "the budget was exceeded"
    return ended


def steps(folder):
    """What happened, without what tells processes and lost calls apart."""
    return [
        {name: fact for name, fact in record.items() if name != "seconds"}
        for record in read_records(folder / "journal.jsonl")
        if record["event"] not in {"run.resume", "run.end", "call.intent"}
    ]


def state(folder):
    """All that a run leaves, but for clock and identity."""
    run = load_run(folder)
    apart = {"id", "started", "seconds", "cost_lost", "mark"}
    texts = {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.suffix in {".md", ".py", ".diff", ".npz", ".yaml", ".npy"}
        or path.parent.name == "blobs"
    }
    return run.model_dump(exclude=apart), load_rules(folder), steps(folder), texts


def check_calls(model, folder, index, kills):
    """Each settled call was made once; more often only one whose answer was lost."""
    records = read_records(folder / "journal.jsonl")
    intents = Counter(r["key"] for r in records if r["event"] == "call.intent")
    settled = Counter(r["key"] for r in records if r["event"] == "call.reply")
    prompts = {r["key"]: r["prompt"] for r in records if r["event"] == "call.intent"}
    assert set(settled.values()) == {1}
    assert set(settled) == set(intents)
    assert intents.total() - len(intents) <= kills
    for key, asked in intents.items():
        prompt = (folder / "blobs" / prompts[key]).read_text()
        seen = model.asked[f"/run{index}/v1/chat/completions", prompt]
        assert 1 <= seen <= asked
        assert asked > 1 or seen == 1


@pytest.fixture
def whole(model, task_folder, tmp_path):
    """Makes the run that nobody kills, in so many iterations."""

    def make(iterations):
        model.iterations = iterations
        folder = tmp_path / "whole" / "run"
        folder.parent.mkdir()
        assert start(model, task_folder, [folder]) == ["passed"]
        assert load_run(folder).tau == iterations
        check_calls(model, folder, 0, kills=0)
        model.asked.clear()
        model.billed = 0.0
        return folder

    return make


@pytest.mark.slow
@pytest.mark.parametrize(
    "kills",
    [[(5, 0.5)], [(5, 0.5), (4, 1.0)]],
    ids=["once", "again"],
)
def test_a_run_that_is_killed(model, task_folder, whole, tmp_path, kills):
    """In the middle of an answer's line, and then after that of a verification."""
    expected = state(whole(2))
    folder = tmp_path / "killed" / "run"
    folder.parent.mkdir()
    for kill_at, share in kills:
        assert start(model, task_folder, [folder], kill_at, share) is None
    assert load_run(folder).status == "running"
    assert is_own_folder(load_run(folder))
    assert start(model, task_folder, [folder]) == ["passed"]
    assert is_own_folder(load_run(folder))
    assert state(folder) == expected
    check_calls(model, folder, 0, kills=len(kills))
    run = load_run(folder)
    assert run.cost_lost > 0
    assert model.billed <= run.cost + run.cost_lost


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1, 9))
def test_killed_at_every_line(model, task_folder, whole, tmp_path, first):
    """Once at each line of the journal, cut at a drawn place, then the same again.

    A test has every eighth line.
    """
    reference = whole(6)
    lines = len(read_records(reference / "journal.jsonl"))
    assert lines > 40
    expected = state(reference)
    cut = random.Random(first)
    for kill_at in range(first, lines + 1, 8):
        folder = tmp_path / f"killed-{kill_at}" / "run"
        folder.parent.mkdir()
        model.asked.clear()
        model.billed = 0.0
        share = cut.choice([0.0, 1.0, cut.random()])
        assert start(model, task_folder, [folder], kill_at, share) is None
        assert start(model, task_folder, [folder]) == ["passed"]
        assert state(folder) == expected, f"killed at line {kill_at}"
        check_calls(model, folder, 0, kills=1)


@pytest.mark.slow
def test_eight_runs_that_share_a_budget(model, task_folder, whole, tmp_path):
    """Killed together, they go on together; the server never bills too much."""
    expected = state(whole(6))
    place = tmp_path / "eight"
    place.mkdir()
    folders = [place / f"run-{index}" for index in range(8)]
    cut, kills = random.Random(3), 0
    for _ in range(6):
        kill_at, share = cut.randrange(20, 110), cut.random()
        if start(model, task_folder, folders, kill_at, share) is not None:
            break
        kills += 1
    assert kills >= 4
    assert start(model, task_folder, folders) == ["passed"] * 8
    for index, folder in enumerate(folders):
        run, rules, happened, _ = state(folder)
        assert {**run, "index": 0} == expected[0]
        assert rules == expected[1]
        assert len(happened) == len(expected[2])
        check_calls(model, folder, index, kills)


@pytest.mark.slow
def test_eight_runs_that_exhaust_a_budget(model, task_folder, tmp_path):
    """They stop, censored, killed or not; with more money they come to their end."""
    place = tmp_path / "eight"
    place.mkdir()
    folders = [place / f"run-{index}" for index in range(8)]
    few = 3.0
    assert start(model, task_folder, folders, 60, 0.5, max_cost=few) is None
    ended = start(model, task_folder, folders, max_cost=few)
    assert set(ended) <= {"passed", "budget"}
    assert "budget" in ended
    for folder, status in zip(folders, ended, strict=True):
        assert load_run(folder).censored == (status == "budget")
    assert start(model, task_folder, folders) == ["passed"] * 8
    for index, folder in enumerate(folders):
        assert not load_run(folder).censored
        check_calls(model, folder, index, kills=1)
