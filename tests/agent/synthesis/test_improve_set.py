"""Search beyond the first success: the archive, what is asked, what comes of it."""

import json
import re
from pathlib import Path

import pytest
from few_worlds import write_set
from hypothesis import given
from hypothesis import strategies as st
from script import STILL, Script, code

from tdac_agent.runs.history import gather_run
from tdac_agent.runs.selection_record import read_selection
from tdac_agent.synthesis.archive import Archive, Member
from tdac_agent.synthesis.candidates import Candidate, Figures
from tdac_agent.synthesis.workload import LEAST_IMPROVE, shares

scores = st.floats(0.0, 1.0)
names = ("time", "path", "success", "worst")
figures = st.builds(
    lambda *values: Figures(dict(zip(names, values, strict=True)), {"time": "time"}),
    *[scores] * 4,
)


@st.composite
def archives(draw):
    """An archive of up to eight members; the first one is a founder."""
    archive = Archive()
    for k, each in enumerate(draw(st.lists(figures, min_size=1, max_size=8))):
        parent = archive.members[0] if k else None
        candidate = Candidate(k, 0, f"A = {k}", Path())
        archive.members.append(Member(candidate, each, parent))
    return archive


@given(archives())
def test_the_best_founder_is_a_finalist(archive):
    chosen = archive.finalists(4)
    assert any(archive.base is each for each in chosen)
    assert len(chosen) <= 5
    assert [each.k for each in chosen] == sorted({each.k for each in chosen})


@given(st.integers(2, 10_000), st.integers(LEAST_IMPROVE, 10_000))
def test_the_shares_are_all_episodes(episodes, improve):
    """And there are at least some variations."""
    parts = shares(episodes, improve)
    used = parts.feedback + parts.validation + parts.explore + 2 * parts.comparison
    assert used == episodes + improve
    assert parts.variations >= 3
    assert (parts.variations + 1) * parts.block <= parts.explore


@pytest.mark.slow
def test_a_better_variation_is_asked_for_and_selected(
    improve, on_set, solver, tmp_path
):
    """The model sees the parent, its figures, and what was tried with it."""
    slow = solver.replace("def policy(", "def fast(") + (
        "\n\ndef policy(obs):\n    left, right = fast(obs)\n"
        "    return 0.6 * left, 0.6 * right\n"
    )
    quick = slow.replace("0.6", "0.95")
    refused = f"import subprocess\n{slow}"
    model = Script(*map(code, (slow, STILL, slow, refused, quick)))
    run = improve(on_set, model, ask="repair")
    asked = [kind for kind, *_ in model.asked()]
    assert asked == ["generate", *["improve"] * (len(asked) - 1)]
    first, second = (request.prompt for request in model.requests[1:3])
    assert "The controller to improve" in first
    assert "return 0.6 * left" in first
    assert "What was tried" not in first
    tried = (
        r"Mean time score -0\.\d{3} in 4 episodes; lost .* failure \+1\.000.*:\n```diff"
    )
    assert re.search(tried, second)
    best = read_selection(tmp_path / "run")
    assert run.status == "selected"
    assert (run.folder / "controller.py").read_text() == quick
    found = best.improvement
    assert (found.k, found.j, found.worlds) == (1, 0, 4)
    assert found.after > found.before
    assert 0.0 < found.low < found.after - found.before < found.high
    assert best.used <= 4 + 32
    parents = [attempt.parent for attempt in run.attempts]
    assert parents[0] is None
    assert parents[1:5] == [(1, 0)] * 4
    notes = [attempt.notes[-1] for attempt in run.attempts[1:]]
    assert notes[1] == "same code as k=1 j=0"
    assert "+0." in notes[3]
    told = gather_run(run.folder)
    assert [one.k for one in told.tried] == [1, *range(21, 25)]
    diff = (run.folder / "iterations/k24/j0/controller.diff").read_text()
    assert "-    return 0.6 * left" in diff  # from its parent


@pytest.mark.slow
def test_the_command_says_what_improving_brought(tdac, refused, tmp_path):
    few = write_set(tmp_path / "few.yaml")
    words = ("synth", "--set", few, "--episodes", 4, "--feedback-episodes", 2)
    words += ("--improve", 32, "--seed", 1, "--search", "paper")
    code, out, err = tdac(*words, "--dry-run", "--json")
    assert (code, err) == (0, "")
    varied = shares(4, 32).variations
    assert json.loads(out)["questions"] == 20 * 3 + varied
    code, out, err = tdac(*words, "--out", "run")
    assert (code, err) == (0, "")
    assert re.search(r"improving: \d variations?; ", out)
    assert "~ k=21 j=0" in out
    err = refused("synth", "--feedback-episodes", 3)
    assert "--feedback-episodes needs --set NAME" in err
