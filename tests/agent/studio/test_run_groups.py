"""Runs of the list by campaign."""

import pytest

pytest.importorskip("nicegui", reason="needs tdac[studio]")

from tdac_agent.studio.pages.trail import above_run, trail_html
from tdac_agent.studio.run_groups import (
    campaign_command,
    campaign_of,
    grouped,
    name_within,
)


def row(run, status, usd=0.0):
    return {"run": run, "status": status, "usd": usd}


ROWS = [
    row("runs/b", "verified", 1.0),
    row("campaigns/one/runs/maze/r0002", "verified", 0.25),
    row("campaigns/one/runs/maze/r0001", "verified", 0.25),
    row("campaigns/one/runs/maze/r0003", "passed", 0.5),
    row("runs/a", "not verified"),
    row("campaigns/one-more/r0001", "budget", None),
    row("campaigns/one/runs/maze/r0004", "killed", 0.5),
]


def test_a_campaign_is_one_group():
    """Those that are not verified come first, by name; a campaign may have no run."""
    campaigns = ["campaigns/none", "campaigns/one", "campaigns/one-more"]
    none, one, more, others = grouped(ROWS, campaigns)
    assert (none.campaign, none.rows) == ("campaigns/none", ())
    names = [name_within(each["run"], "campaigns/one") for each in one.rows]
    assert names == ["maze/r0004", "maze/r0003", "maze/r0001", "maze/r0002"]
    assert (one.verified, len(one.rows), one.usd) == (2, 4, 1.5)
    assert [each["run"] for each in more.rows] == ["campaigns/one-more/r0001"]
    assert more.usd is None
    assert [each["run"] for each in others.rows] == ["runs/b", "runs/a"]


def test_the_way_to_a_run(tmp_path):
    """Through its campaign, if it has one; nothing in a name is markup."""
    at = "campaigns/a <b>/runs/maze/r0001"
    (tmp_path / at).mkdir(parents=True)
    assert campaign_of(tmp_path, at) == ""
    (tmp_path / "campaigns/a <b>/campaign.yaml").touch()
    assert campaign_of(tmp_path, at) == "campaigns/a <b>"
    assert campaign_of(tmp_path, "../outside/run") == ""
    steps = above_run(tmp_path, at)
    assert [step.name for step in steps] == ["Runs", "campaigns/a <b>"]
    html = trail_html(at, tmp_path, steps)
    assert "<b>" not in html
    assert '<a href="/campaign?at=campaigns/a%20%3Cb%3E">campaigns/a &lt;b&gt;</a>' in (
        html
    )
    assert '<li aria-current="page">runs/maze/r0001</li>' in html


def test_a_campaign_goes_on_in_its_folder():
    """Not in the one that its name would choose; no name is taken for a flag."""
    text = campaign_command("-my campaigns/x")
    assert text == (
        "tdac campaign './-my campaigns/x/campaign.yaml' --out './-my campaigns/x'"
    )
