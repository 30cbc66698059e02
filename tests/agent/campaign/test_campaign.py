"""A campaign from the command line: it goes on, repeats nothing, and fails alone."""

import json
import re
from collections import Counter
from pathlib import Path

import pandas as pd
import pytest
from few_runs import Small

from tdac_agent.campaign.config import find_config, read_config
from tdac_agent.metrics import CANDIDATE_COLUMNS, RUN_COLUMNS, find_runs
from tdac_agent.models.lifecycle import retired
from tdac_agent.storage.shipped import shipped_names


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """Two kinds that work and one whose every run ends with a fault."""
    small = Small(tmp_path_factory.mktemp("campaign"))
    small.write()
    small.write("broken", learners=["replay:demo", "builtin"], keep="records")
    return small, small.run("--workers", 2, name="broken"), small.run("--json")


def test_a_campaign_leaves_its_tables_and_figures(small, done):
    small.write(learners=["builtin"], runs=1)
    out = small.folder / "out"
    said = done("campaign", small.folder / "few.yaml", "--out", out)
    assert "1 of 1 runs have ended" in said
    [run] = pd.read_csv(out / "runs.csv").to_dict("records")
    assert (run["learner"], run["tau"]) == ("builtin", 1)
    assert (out / "success_rate.png").is_file()
    assert (out / "cumulative_success-small.png").is_file()


@pytest.mark.slow
def test_runs_that_fail_stop_no_other_and_say_why(once):
    """Exit 3; the reason is told once, with how often it was met, and the way on."""
    _, (code, said, complained), _ = once
    # It may be the first of a machine, which compiles.
    complaints = [line for line in complained.splitlines() if "compiling" not in line]
    assert (code, complaints) == (3, [])
    assert said.count("replay") > 0
    assert "2 × fault: replay:demo: the question differs from" in said
    assert "2 of 4 runs have ended, 2 of them now" in said
    assert "to continue: tdac campaign broken.yaml --workers 2 --out out" in said
    assert said.count(" fault, ") == 4  # tried once more, after all others


@pytest.mark.slow
def test_runs_of_another_file_are_not_made_again(once):
    """The same runs have the same names: `builtin` was done, `scripted` was not."""
    small, _, (code, said, _) = once
    summary = json.loads(said)
    assert code == 0
    assert (summary["planned"], summary["finished"], summary["before"]) == (4, 4, 2)
    assert summary["problems"] == {}
    assert len(list(find_runs(small.folder / "out"))) == 6


@pytest.mark.slow
def test_the_same_command_again_does_nothing_and_says_so(once):
    small, _, _ = once
    before = {p: p.stat().st_mtime_ns for p in (small.folder / "out/runs").rglob("*")}
    table = small.table()
    code, said, _ = small.run()
    assert code == 0
    assert "all runs have already finished; nothing was done" in said
    assert "ignoring 1 other kind of run in" in said
    after = {p: p.stat().st_mtime_ns for p in (small.folder / "out/runs").rglob("*")}
    assert after == before
    assert small.table() == table


@pytest.mark.slow
def test_the_tables_hold_each_run_once_with_the_columns_of_the_metrics(once):
    small, _, _ = once
    runs = pd.read_csv(small.folder / "out/runs.csv")
    tried = pd.read_csv(small.folder / "out/candidates.csv")
    assert list(runs.columns) == list(RUN_COLUMNS)
    assert list(tried.columns) == list(CANDIDATE_COLUMNS)
    assert runs["run"].is_unique
    assert set(tried["run"]) <= set(runs["run"])
    assert sorted(Counter(runs["seed"]).values()) == [2, 2]  # pairs
    builtin = runs[runs["learner"] == "builtin"]
    assert (builtin["tau"] == 1).all()
    assert runs["learner"].str.startswith("scripted:").sum() == 2
    summary = pd.read_csv(small.folder / "out/summary.csv")
    assert (summary["R"] == 2).all()


@pytest.mark.slow
def test_shards_make_all_runs_together(small):
    """Each has its part; the whole has nothing left to do."""
    small.write(learners=["builtin"])
    for part in ("1/2", "2/2"):
        code, said, _ = small.run("--shard", part, "--workers", 1)
        assert code == 0
        assert "1 of 1 runs have ended" in said
    code, said, _ = small.run()
    assert "2 runs of 1 kind, R = 2" in said
    assert "nothing was done" in said


@pytest.mark.slow
def test_of_finished_runs_only_records_may_be_kept(once):
    """A handful of files; they are found finished, and count, as all others."""
    small, _, _ = once
    runs = [run.folder for run in find_runs(small.folder / "out")]
    thin = [run for run in runs if "-builtin-" in run.parent.name]
    names = "controller.py journal.jsonl report.json run.json task.yaml"
    assert [sorted(path.name for path in run.iterdir()) for run in thin] == [
        names.split()
    ] * 2
    assert all((run / "iterations").is_dir() for run in runs if run not in thin)


@pytest.mark.slow
def test_a_dry_run_writes_nothing_and_needs_no_key(done, monkeypatch):
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    said = done("campaign", "paper_2d", "--dry-run")
    assert "25 runs; no model was asked" in said
    words = " ".join(said.split())
    assert "if no controller ever passes: 1000 candidates are tested" in words
    assert "1500 questions are asked; without a limit they cost 410.81 USD" in words
    assert "so this campaign costs at most 450.00 USD" in words
    said = done("campaign", "paper_2d", "--dry-run", "--max-cost", 1e6)
    assert "never reached, since all runs cost at most 1782." in " ".join(said.split())
    said = done("campaign", "offline", "--dry-run")
    assert re.search(r"at most \d+ candidates are tested: K x \(1 \+ J\)", said)
    assert not list(Path().iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_names("paper_*.yaml"))
def test_the_limit_of_the_papers_campaigns_cuts_no_weak_learner_short(name, done):
    """It is above the cost if no controller ever passes: runs are not censored."""
    said = " ".join(done("campaign", Path(name).stem, "--dry-run").split())
    (cost,) = re.findall(r"without a limit they cost ([\d.]+) USD", said)
    assert float(cost) < read_config(find_config(Path(name).stem)).max_cost


def test_the_papers_campaigns_also_have_models_that_are_served():
    """As known on the day of the list: none of them will be retired."""
    names = shipped_names("paper_*_now.yaml")
    assert len(names) == 2
    for name in names:
        known = read_config(find_config(Path(name).stem))
        old = read_config(find_config(Path(name).stem.removesuffix("_now")))
        assert not retired(known.models, within_days=10_000)
        assert retired(old.models, within_days=10_000)
        same = ("tasks", "runs", "iterations", "patience", "settings", "prompts")
        assert all(getattr(known, one) == getattr(old, one) for one in same)
        assert len(known.learners) == len(old.learners)


@pytest.mark.parametrize(
    ("words", "code", "line"),
    [
        (
            ("paper_2d",),
            2,
            "error: no key for OpenAI: set the environment variable "
            "OPENAI_API_KEY; and no key for Anthropic",
        ),
        (("paper_2",), 2, "error: no campaign 'paper_2': expected a YAML file, or"),
        (("offline", "--shard", "5/4"), 2, "error: expected --shard as in 1/4"),
        (("offline", "--out", "/proc/none"), 2, "error: cannot write to /proc/none"),
    ],
)
def test_what_cannot_be_done_is_told_before_the_first_run(
    words, code, line, tdac, monkeypatch
):
    """One line, nothing begun."""
    for name in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    found, _, complained = tdac("campaign", *words)
    assert (found, len(complained.splitlines())) == (code, 1)
    assert complained.startswith(line)
    assert not list(Path().rglob("run.json"))
