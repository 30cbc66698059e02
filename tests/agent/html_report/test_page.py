"""The page says what is on disk, as far as it is there, and runs nothing of it."""

import base64
import hashlib
import json
import re
import shutil
from html.parser import HTMLParser

import pytest
from changed_run import change_run
from hostile_model import EVIL

from tdac_agent.errors import RunError
from tdac_agent.html_report import make_page
from tdac_agent.html_report.page import shortened
from tdac_agent.runs.history import gather_run
from tdac_agent.runs.run_record import load_rules, load_run, status_now
from tdac_agent.storage.locks import LOCK_FILE, hold
from tdac_agent.verification.diagnosis.report import Report

VOID = {"meta", "link", "input", "br", "img"}


class Outline(HTMLParser):
    """Tags with their attributes, texts by the tag around them, and who is open."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.scripts, self.open, self.shown = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts.append((self.tags[-1][1], data))
        elif self.open and self.open[-1] != "style":
            self.shown.append(data)


@pytest.fixture(scope="module")
def outline(page):
    """The page, parsed."""
    return Outline(page)


@pytest.mark.slow
def test_every_tag_is_closed(outline):
    """In the right order, whatever stands between them."""
    assert outline.open == []


def test_nothing_is_loaded(outline):
    """Every address is in the file itself."""
    for _, attributes in outline.tags:
        for name in ("src", "href", "data", "action", "srcset", "poster"):
            address = attributes.get(name, "#")
            assert address.startswith(("#", "data:image/")), address
    assert "@import" not in str(outline.tags)


def test_no_script_but_its_own(outline, page):
    """One script runs, by its hash; no handler, and data are data."""
    running = [text for about, text in outline.scripts if "type" not in about]
    (script,) = running
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = next(a["content"] for t, a in outline.tags if "http-equiv" in a)
    assert f"script-src 'sha256-{digest}'" in policy
    assert policy.startswith("default-src 'none'")
    for _, attributes in outline.tags:
        assert not [name for name in attributes if name.startswith("on")]
    data = [text for about, text in outline.scripts if "type" in about]
    assert len(data) == 3  # the scenes, and the episodes of two runs
    assert all(json.loads(text) for text in data)
    assert "<img src=x" not in page


def test_hostile_text_is_shown(outline, hostile):
    """Code, rules, notes, names and messages that hold markup can be read."""
    shown = "".join(outline.shown)
    assert shown.count(EVIL) >= 20
    for text in (
        f"model {EVIL}",
        f"# {EVIL}",
        f"Rule of {EVIL}",
        f"note {EVIL}",
        hostile.name,
        f"own[{EVIL}]",
    ):
        assert text in shown
    assert "\u202e" not in shown
    assert "⟨U+202E⟩" in shown


def test_what_came_of_each_candidate(outline, hostile):
    """Failed tests, messages and diagnoses of each report, and the rules in force."""
    shown = " ".join("".join(outline.shown).split())
    told = gather_run(hostile)
    assert [(one.k, one.j) for one in told.tried] == [(1, 0), (1, 1), (2, 0), (2, 1)]
    assert [len(one.learnt.rules) for one in told.tried] == [0, 0, 1, 1]
    assert [len(one.learnt.fresh) for one in told.tried] == [0, 0, 1, 0]
    assert told.tried[1].learnt.changes == (f"added R1: Rule of {EVIL}",)
    for one in told.tried:
        report = Report.model_validate_json((one.folder / "report.json").read_bytes())
        assert report.failures
        for failure in report.failures:
            assert " ".join(shortened(failure.message).split()) in shown
            if failure.diagnosis:
                assert " ".join(failure.diagnosis.text.split()) in shown


def test_verified_or_not(page, outline):
    """The verdict of each run, and the sum of them, come first."""
    shown = " ".join("".join(outline.shown).split())
    assert "0 of 2 runs verified 1 passed all tests" in shown[:300]
    assert page.count('class="badge passed">passed<') == 2
    assert page.count('class="badge not-verified">not verified<') == 2
    assert "Clopper-Pearson: independent trials" in shown


def test_many_runs_are_folded(runs, hostile, tmp_path):
    """Each is a line that can be opened; those that are not verified come first."""
    for name in "abcd":
        shutil.copytree(runs / "verified", tmp_path / name)
    shutil.copytree(hostile, tmp_path / "z")
    text = make_page(tmp_path).html.decode()
    folded = re.findall(r'id="run-\d">\n<details class="whole"><summary>', text)
    assert len(folded) == 5
    first = text[text.index('id="run-1"') : text.index('id="run-2"')]
    assert "<h2>z " in first
    assert Outline(text).open == []


def test_where_it_is_from(outline, runs):
    """Hashes, versions, seeds, sandbox and commands are those on record."""
    shown = "".join(outline.shown)
    report = Report.model_validate_json(
        (runs / "verified" / "report.json").read_bytes()
    )
    about = report.provenance
    for fact in (
        *(about.controller_sha256, about.suite_sha256, about.map_sha256),
        *(about.sandbox, f"numpy {about.versions['numpy']}"),
        "tdac verify verified",
        "tdac synth --task verified --learner replay:verified",
    ):
        assert fact in shown


def test_a_run_is_repeated_with_its_own_options(copied):
    """Whatever they are; usual values are left out."""
    own = {"iterations": 3, "refine": False, "max_output": 9}
    names = {"learner": "openai:m", "optimizer": "openai:m"}
    change_run(copied, **own, **names, base_url="http://a")
    shown = " ".join("".join(Outline(make_page(copied).html.decode()).shown).split())
    begun = "tdac synth --task run --learner {} -K 3 --no-refine --no-confirm {}"
    assert begun.format("openai:m", "--base-url http://a --max-output 9") in shown
    assert begun.format("replay:run", "--max-output 9") in shown
    change_run(copied, search="of another version")
    assert "--search &#39;of another version&#39;" in make_page(copied).html.decode()


def test_the_same_page_again(runs, page):
    """Nothing in it depends on when and where it was made."""
    assert make_page(runs).html.decode() == page
    assert str(runs.parent) not in page.replace(runs.name, "")


@pytest.mark.slow
def test_size_of_a_long_run(long_run):
    """Twenty iterations at their worst stay below 5 MB, with all of their episodes."""
    html = make_page(long_run).html
    assert len(html) < 5e6
    episodes = re.search(rb'id="episodes-1">(.*?)</script>', html)
    assert len(json.loads(episodes[1])) == 2 * 20 * 6


def damaged(folder, name, content=None):
    """One file of a run, cut in the middle, or replaced."""
    path = folder / name
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if content is None else content)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("iterations/k01/j0/report.json", "k01/j0/report.json: damaged"),
        ("report.json", "report.json: damaged"),
        ("task.yaml", "Not readable"),
        ("rules.json", "is not a rules file"),
        ("journal.jsonl", "passed in iteration 1"),
        ("iterations/k01/j1/trajectories/nominal.npz", "jitter 1: reached"),
        ("iterations/k01/j1/controller.py", "passed in iteration 1"),
    ],
)
def test_a_torn_file(copied, name, told):
    """One damaged file is told, and takes nothing else away."""
    (copied / "rules.json").touch()
    damaged(copied, name, b"\xff{" if name in ("task.yaml", "rules.json") else None)
    text = make_page(copied).html.decode()
    shown = " ".join("".join(Outline(text).shown).split()) + text.replace('"', "")
    assert told.partition(": reached")[0] in shown
    assert "41 of 41" in shown or "tests passed" in shown
    assert "iteration 1" in shown


def cut_short(folder):
    """Has a run end, or be at work, after its first candidate."""
    attempts = load_run(folder).attempts[:1]
    change_run(folder, status="running", tau=None, attempts=attempts)


def test_a_run_that_was_killed(copied):
    """What was judged is there; the candidate it died in is named."""
    cut_short(copied)
    (copied / "iterations" / "k01" / "j1" / "report.json").unlink()
    shown = " ".join("".join(Outline(make_page(copied).html.decode()).shown).split())
    assert "killed" in shown[:200]
    assert "iteration 1, repair 1 verification not finished" in shown
    assert "Each number is an iteration (k on the command line)" in shown
    assert "tdac synth --resume run" in shown


def test_who_wrote_a_candidate(copied):
    """A controller that the run began with is not the Learner's."""
    page = make_page(copied).html.decode()
    written, edited = page.count("written by the Learner"), page.count("edited by the")
    assert (written, edited) == (1, 1)
    change_run(copied, given_sha256="0" * 64)
    page = make_page(copied).html.decode()
    assert page.count("given at the start") == 1
    assert page.count("written by the Learner") == 0


def test_a_run_that_is_still_at_work(copied):
    """Its lock says so; it was not killed or ended early, and nobody is to go on."""
    cut_short(copied)
    with hold(copied / LOCK_FILE):
        text = make_page(copied).html.decode()
    shown = " ".join("".join(Outline(text).shown).split())
    assert "running after 2 candidates" in shown
    assert "This run is still in progress" in shown
    for word in ("killed", "ended early", "--resume"):
        assert word not in shown


@pytest.mark.slow
def test_only_several_runs_have_rates(copied):
    """One that is at work is counted as such."""
    alone = make_page(copied).html.decode()
    assert "Clopper-Pearson" not in alone
    assert 'id="summary"' not in alone
    other = shutil.copytree(copied, copied.parent / "other")
    cut_short(other)
    with hold(other / LOCK_FILE):
        text = make_page(copied.parent).html.decode()
    shown = " ".join("".join(Outline(text).shown).split())
    assert "1 running" in shown
    assert "Clopper-Pearson" in shown


def test_a_run_that_ends_while_its_record_is_read_was_not_killed(copied):
    """What was at work before that has ended as its next record says."""
    run = load_run(copied)
    assert status_now(run, before=True) == "passed"
    left = run.model_copy(update={"status": "running", "tau": None})
    assert status_now(left, before=True) == "running"
    assert status_now(left, before=False) == "killed"
    with hold(copied / LOCK_FILE):
        assert status_now(left, before=False) == "running"


def test_a_run_that_has_only_begun(copied):
    """No candidate yet: still a page."""
    change_run(copied, status="interrupted", tau=None, attempts=[])
    shutil.rmtree(copied / "iterations")
    (copied / "journal.jsonl").unlink()
    shown = " ".join("".join(Outline(make_page(copied).html.decode()).shown).split())
    assert "interrupted after 0 candidates" in shown


def test_unreadable_among_others(runs, tmp_path):
    """One run that cannot be read is named, the others are reported."""
    place = shutil.copytree(runs, tmp_path / "runs")
    damaged(place / "verified", "run.json")
    found = make_page(place)
    assert (found.runs, found.verified) == (1, 0)
    assert found.unreadable[0].startswith("verified is not a run folder: ")
    assert "Not readable: verified is not a run folder" in found.html.decode()


def test_no_run(tmp_path):
    """A folder without runs, or with unreadable ones only, is one clear line."""
    with pytest.raises(RunError, match="there is no run at or below"):
        make_page(tmp_path)
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(RunError, match="is not a run folder"):
        make_page(tmp_path)
    with pytest.raises(RunError, match="there is no folder"):
        make_page(tmp_path / "none")


def test_the_command(copied, tdac, refused):
    """Writes the file beside the run or where it is told, and says so in a line."""
    code, out, err = tdac("report", copied)
    assert (code, err) == (0, "")
    assert out.startswith(f"{copied / 'report.html'}: 1 run, 0 verified; ")
    assert (copied / "report.html").read_bytes().startswith(b"<!doctype html>")
    assert tdac("report", copied, "--out", "other.html")[0] == 0
    err = refused("report", copied, "--out", copied / "none" / "a.html")
    assert "there is no such folder" in err
    err = refused("report", copied / "iterations")
    code, _, err = tdac("report", copied / "none")
    assert (code, err) == (2, f"error: there is no folder {copied / 'none'}\n")


def test_rules_of_the_run(outline, hostile):
    """The life of each rule stands at the end."""
    shown = "".join(outline.shown)
    for rule in load_rules(hostile).rules:
        assert rule.effect_text in shown
