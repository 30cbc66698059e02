"""What driving leaves in a folder is only used again if it was written here."""

import json
import shutil

import pytest
from script import STILL

from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import identity_of
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.episode_report import EpisodeProvenance, summarise
from tdac_agent.verification.store import (
    MARK,
    REPORT_FILE,
    ROWS_FILE,
    UNFINISHED,
    is_marked,
    keep_report,
    kept_report,
    read_report,
)
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set

COUNT = 4


@pytest.fixture
def problem(request, small_task, level):
    """A task, or a set of short episodes."""
    return small_task if request.param == "task" else load_set(level)


def drive(problem, out, warm, watch=None):
    more = {"first": 0, "out": out, "judge": warm, "watch": watch}
    return verify_episodes(STILL, problem, COUNT, **more)


def interrupted(problem, out, warm):
    """Drives until two episodes are on record."""

    def interrupt(count, _):
        if count >= 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        drive(problem, out, warm, interrupt)
    return out / UNFINISHED / ROWS_FILE


def succeeded(line):
    """A row that claims a success."""
    return json.dumps({**json.loads(line), "outcome": "reached", "collisions": 0})


@pytest.mark.slow
@pytest.mark.parametrize("problem", ["task", "set"], indirect=True)
def test_edited_rows_are_driven_again(problem, tmp_path, warm):
    """Rows with a mark are not driven again; edited, added or copied ones are."""
    out = tmp_path / "out"
    rows = interrupted(problem, out, warm)
    lines = rows.read_text().splitlines()
    rows.write_text("".join(f"{succeeded(line)}\n" for line in lines))
    counts = []
    report = drive(problem, out, warm, lambda count, _: counts.append(count))
    assert report.successes == 0
    assert counts[-1] == COUNT
    assert not (out / UNFINISHED).exists()


@pytest.mark.slow
@pytest.mark.parametrize("problem", ["set"], indirect=True)
def test_rows_with_a_mark_are_used(problem, tmp_path, warm):
    """They are the first that the next call counts."""
    rows = interrupted(problem, tmp_path / "out", warm)
    kept, counts = len(rows.read_text().splitlines()), []
    drive(problem, tmp_path / "out", warm, lambda count, _: counts.append(count))
    assert counts[0] >= min(kept, 2)


@pytest.mark.parametrize("dynamics", ["", "0" * 64])
def test_results_on_other_dynamics_are_no_answer(tmp_path, dynamics):
    """They are read, and driven again when they are asked for."""
    own = episodes_of(load_set("known"))
    facts = {"name": own.name, **identity_of(own), "split": "dev"}
    facts |= {"controller_sha256": "", "sandbox": "none", "limits": {}}
    about = EpisodeProvenance(**facts, versions=versions())
    report = summarise(about, (), None, 0.0)
    keep_report(report, tmp_path)
    assert kept_report(tmp_path, identity_of(own), ()) == report
    about = about.model_copy(update={"dynamics": dynamics})
    report = report.model_copy(update={"provenance": about})
    keep_report(report, tmp_path)
    assert kept_report(tmp_path, identity_of(own), ()) is None
    assert read_report(tmp_path) == report


@pytest.mark.parametrize("problem", ["set"], indirect=True)
def test_a_report_without_its_mark_is_none(problem, tmp_path, warm):
    """An edited one, one without a mark, and one with the mark of another."""
    out, other = tmp_path / "out", tmp_path / "other"
    report = drive(problem, out, warm)
    wanted, numbers = {"name": report.provenance.name}, range(COUNT)
    assert kept_report(out, wanted, numbers) == report
    assert kept_report(out, {"name": "else"}, numbers) is None
    assert kept_report(out, wanted, range(COUNT + 1)) is None
    shutil.copytree(out, other)
    text = (other / REPORT_FILE).read_text().replace('"seconds"', '"seconds" ')
    (other / REPORT_FILE).write_text(text)
    assert not is_marked(other / REPORT_FILE)
    assert kept_report(other, wanted, numbers) is None
    (out / REPORT_FILE).with_suffix(MARK).unlink()
    assert kept_report(out, wanted, numbers) is None
