"""Campaigns on task sets: names, what the runs do, tables, the report."""

import json
from pathlib import Path

import pandas as pd
import pytest
import yaml
from few_runs import Small
from few_worlds import write_set
from killing import check_same_in_the_end

from tdac_agent.campaign.config import CampaignError, read_config
from tdac_agent.campaign.plan import PlannedRun, make_plan
from tdac_agent.metrics import SET_RUN_COLUMNS
from tdac_agent.runs.run_record import load_run
from tdac_agent.tasks.installation import seed_from
from tdac_envs import load_set

BAR = {"bar": 0.5}
"""A bar that few worlds settle."""


class SmallSet(Small):
    """A campaign on a task set of small worlds."""

    def write(self, name="few", **changes):
        """Writes its file."""
        write_set(self.folder / "worlds.yaml", **BAR)
        sets = {"tasks": [], "sets": ["worlds.yaml"], "learners": ["builtin"]}
        limits = {"episodes": 4, "feedback_episodes": 2}
        super().write(name, **{**sets, **limits, **changes})

    def table(self, out="out"):
        """What came of all runs, without what the clock has a say in."""
        runs = pd.read_csv(self.folder / out / "set_runs.csv")
        return runs.drop(columns=["seconds"]).to_csv()


class SmallBoth(SmallSet):
    """Likewise, also on the small task."""

    def write(self, name="few", **changes):
        """Writes its file."""
        super().write(name, tasks=["small"], **changes)


@pytest.fixture
def on_set(tmp_path):
    """A campaign on a set, in a folder of its own."""
    return SmallSet(tmp_path)


def planned(folder, name="few"):
    file = folder / f"{name}.yaml"
    return make_plan(read_config(file), file.parent)


@pytest.mark.slow
def test_a_campaign_on_a_set(on_set, tdac, monkeypatch):
    """Each run selects on `dev` and is verified on hidden worlds of its own."""
    on_set.write(keep="records", seed=7)
    code, said, complained = on_set.run("--workers", 1)
    complaints = [line for line in complained.splitlines() if "compiling" not in line]
    assert (code, complaints) == (0, [])
    assert "2 of 2 runs have ended" in said
    assert "verified in iteration 1" in said
    assert "tables in out: set_runs.csv, set_summary.csv\n" in said
    runs = pd.read_csv(on_set.folder / "out/set_runs.csv")
    assert list(runs.columns) == list(SET_RUN_COLUMNS)
    assert (runs["status"] == "verified").all()
    assert (runs["episodes"] == 4).all()
    assert runs["seed"].tolist() == [7, 8]
    assert runs["success"].between(0.5, 1.0).all()
    (row,) = pd.read_csv(on_set.folder / "out/set_summary.csv").to_dict("records")
    assert (row["R"], row["verified"], row["rate"]) == (2, 2, 1.0)
    assert 0.0 < row["rate_low"] < 1.0 == row["rate_high"]
    folders = [on_set.folder / "out/runs" / name for name in runs["run"]]
    salts = set()
    for folder in folders:
        names = "controller.py hidden.json journal.jsonl report.json run.json set.yaml"
        assert sorted(path.name for path in folder.iterdir()) == names.split()
        hidden = json.loads((folder / "hidden.json").read_text())
        salts.add(hidden["provenance"]["salt_sha256"])
        assert load_run(folder).then_verify
    assert len(salts) == 2
    before = on_set.table()
    code, said, _ = on_set.run()
    assert (code, on_set.table()) == (0, before)
    assert "nothing was done" in said
    monkeypatch.chdir(on_set.folder)
    code, said, _ = tdac("report", "out", "--out", "page.html")
    assert (code, "2 runs, 2 verified" in said) == (0, True)
    page = (on_set.folder / "page.html").read_text()
    assert "Summary of task sets" in page
    assert 'data-label="rate">1.00 [0.16, 1.00]</td>' in page


def test_runs_on_sets_have_names_of_their_own(on_set):
    """The limits of episodes change runs on sets, and none on tasks."""
    names = []
    for episodes in (4, 6):
        on_set.write(tasks=["small"], episodes=episodes)
        plan = planned(on_set.folder)
        names.append([run.name for run in plan.all()])
        for run in plan.all():
            assert PlannedRun.from_json(run.to_json()) == run
    first, second = names
    assert first[0::2] == second[0::2]
    assert set(first[1::2]).isdisjoint(second[1::2])
    assert first[1].startswith("set-worlds-builtin-dual-tier-")
    (on_set.folder / "worlds.yaml").unlink()
    write_set(on_set.folder / "worlds.yaml", **BAR, goal_tolerance=14.0)
    changed = [run.name for run in planned(on_set.folder).all()]
    assert set(changed[1::2]).isdisjoint(second[1::2])


def test_a_level_and_a_task_of_the_same_name(on_set):
    """`epuck` is both; the labels tell them apart."""
    on_set.write(tasks=["epuck"], sets=["epuck"])
    plan = planned(on_set.folder)
    assert [cell.task_name for cell in plan.cells] == ["epuck", "set epuck"]
    assert [cell.on_set for cell in plan.cells] == [False, True]
    assert plan.problem(plan.cells[1]) is plan.sets["epuck"]


def test_learners_share_the_worlds_of_a_run(on_set):
    """The seed of run n depends on the set and on n, not on who writes."""
    on_set.write()
    sha256 = load_set(on_set.folder / "worlds.yaml").sha256
    assert seed_from(b"run 1", sha256) == seed_from(b"run 1", sha256)
    assert seed_from(b"run 1", sha256) != seed_from(b"run 2", sha256)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sets": []}, "tasks: expected at least one, or one of sets"),
        ({"sets": ["a", "a"]}, "sets: 'a' is listed twice"),
        ({"episodes": 1}, "episodes: .*expected at least 2, got 1"),
    ],
)
def test_a_wrong_file_on_sets_is_refused_in_a_line(changes, message, on_set):
    on_set.write(**changes)
    with pytest.raises(CampaignError, match=message) as caught:
        read_config(on_set.folder / "few.yaml")
    assert "\n" not in str(caught.value)


def test_an_unknown_set_is_one_line(on_set, refused):
    on_set.write(sets=["nosuch"])
    complained = refused("campaign", on_set.folder / "few.yaml")
    assert "unknown task set" in complained
    assert "nosuch" in complained


def test_a_dry_run_on_a_set(on_set, done):
    """It has the first question's price, and writes nothing."""
    on_set.write(learners=["openai:gpt-6-sol"], max_cost=1.0)
    text = yaml.safe_load((on_set.folder / "few.yaml").read_text())
    assert text["sets"] == ["worlds.yaml"]
    said = done("campaign", on_set.folder / "few.yaml", "--dry-run")
    assert "set worlds" in said
    assert "2 runs; no model was asked" in said
    assert not list(Path().iterdir())


@pytest.mark.slow
def test_killed_campaigns_on_sets_end_the_same(tmp_path):
    """Workers and drivers, at random moments; beside runs on a task."""
    check_same_in_the_end(tmp_path, 2, 4, 12.0, small_of=SmallBoth)
