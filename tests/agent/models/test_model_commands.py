"""`tdac synth` with models: one clear line for what is missing, and for what broke."""

import json
import sys

import pytest
from fault_server import OPENAI, answers, fails
from small import write_small_task


@pytest.fixture
def task_file(tmp_path):
    return write_small_task(tmp_path / "task", profile="policy") / "task.yaml"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--learner", "gpt"], "unknown model 'gpt'; known: builtin, anthropic:MODEL"),
        (
            ["--learner", "anthropic:m"],
            "set the environment variable ANTHROPIC_API_KEY",
        ),
        (["--optimizer", "openai:m"], "set the environment variable OPENAI_API_KEY"),
        (["--base-url", "http://here/v1"], "--base-url is for anthropic:MODEL and"),
        (["--learner", "replay:none"], "cannot replay: none is not a run folder"),
        (["--learner", "command:none-such"], "there is no program 'none-such'"),
    ],
)
def test_what_is_missing(refused, task_file, monkeypatch, words, expected, tmp_path):
    """Exit 2, one line on stderr, and no run folder."""
    for name in ("ANTHROPIC_API_KEY", "OPENAI_API_KEY", "OPENAI_BASE_URL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv("ANTHROPIC_BASE_URL", raising=False)
    err = refused("synth", "--task", task_file, *words)
    assert err.startswith("error: ")
    assert expected in err
    assert list((tmp_path / "here").iterdir()) == []


@pytest.mark.slow
def test_what_broke(tdac, server, task_file, tmp_path):
    """Exit 3: the reason in one line, and where the run so far is."""
    server.script = [fails(OPENAI, 403, "permission_error", "not for you")]
    url = server.url(OPENAI)
    words = ["--learner", "openai:m", "--base-url", url, "--out", tmp_path / "run"]
    code, out, err = tdac("synth", "--task", task_file, *words)
    assert code == 3
    last = err.splitlines()[-1]
    expected = "infrastructure fault: openai:m: 403: permission_error: "
    assert last == f"{expected}not for you (request req_7)"
    assert f"the run so far is in {tmp_path / 'run'}" in out
    assert json.loads((tmp_path / "run/run.json").read_text())["status"] == "fault"


@pytest.mark.slow
def test_learner_and_optimizer_are_independent(
    tdac, server, task_file, tmp_path, good_source
):
    """A served model writes, a program repairs; both are named in the record."""
    bad = "def policy(obs):\n    return 0.0, 0.0\n"
    server.script = [answers(OPENAI, f"```python\n{bad}```\n")]
    (tmp_path / "fixed.md").write_text(f"```python\n{good_source}```\n")
    program = (
        f"import sys; sys.stdin.read(); print(open(r'{tmp_path}/fixed.md').read())"
    )
    (tmp_path / "model.py").write_text(program)
    repair = f"command:{sys.executable} {tmp_path / 'model.py'}"
    words = ["--learner", "openai:m", "--optimizer", repair, "--json"]
    words += ["--base-url", server.url(OPENAI), "--out", tmp_path / "run"]
    code, out, err = tdac("synth", "--task", task_file, *words)
    assert code == 0, err
    run = json.loads(out)
    assert (run["learner"], run["optimizer"]) == ("openai:m", repair)
    assert [(a["k"], a["j"], a["passed"]) for a in run["attempts"]] == [
        (1, 0, False),
        (1, 1, True),
    ]
    assert len(server.seen) == 1
    assert "optimizer command:" in " ".join(err.split())
