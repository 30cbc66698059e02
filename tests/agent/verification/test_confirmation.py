"""Blind confirmations: what they accept, and that nobody can know their starts."""

import json
import xml.etree.ElementTree as ET

import pytest

from tdac_agent.cli.main import main  # noqa: F401 - the `tdac` fixture runs it
from tdac_agent.verification.confirmation import (
    DISTURBANCE,
    confirm,
    confirming_seeds,
    kept_confirmation,
)
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.verdict import confirmed_text, verified_text

SOMETIMES = """

_drive = policy


def policy(obs):
    x, y, heading = (float(value) for value in obs["pose"])
    if not policy.seen:
        policy.seen = True
        if int(1e6 * (x + y + heading)) % 100 < {percent}:
            raise ValueError("on purpose")
    return _drive(obs)


policy.seen = False
"""
"""What makes a controller fail in a share of all drives, which its start decides."""


def failing(source, percent):
    """A controller that fails on purpose in so many percent of all drives."""
    return source + SOMETIMES.format(percent=percent)


def test_a_good_controller_is_confirmed(small_task, good_source, warm, tmp_path):
    """All drives reach the goal; the report names plan, disturbance and sandbox."""
    seen = []
    report = confirm(
        good_source,
        small_task,
        out=tmp_path,
        judge=warm,
        watch=lambda *n: seen.append(n),
    )
    assert report.passed
    assert report.count == 93
    assert report.provenance.disturbance == DISTURBANCE
    assert report.scores is None  # it was selected by the test
    assert confirmed_text(report).startswith("arrives ≥ 95 % (")
    assert "not covered: other worlds, delays" in verified_text(report)
    assert seen[-1] == (93, report.successes)
    kept = EpisodeReport.model_validate_json((tmp_path / "episodes.json").read_text())
    assert kept == report


def test_it_ends_with_the_second_failure(small_task, good_source, warm):
    """A controller that fails in 40 % of all drives needs few of them."""
    report = confirm(failing(good_source, 40), small_task, judge=warm)
    assert not report.passed
    assert report.count - report.successes == 2
    assert report.count < 40
    assert "2 of " in confirmed_text(report)
    assert "on purpose" in report.failures[0].error


def test_starts_follow_from_the_controller_and_a_secret(small_task, monkeypatch):
    """The same file has the same starts; another number, file or secret has others."""
    seeds = confirming_seeds(b"a", small_task, 1)
    assert seeds == confirming_seeds(b"a", small_task, 1)
    others = [
        confirming_seeds(b"b", small_task, 1),
        confirming_seeds(b"a", small_task, 2),
    ]
    secret = "tdac_agent.tasks.installation.lasting_secret"
    monkeypatch.setattr(secret, lambda: b"another")
    others.append(confirming_seeds(b"a", small_task, 1))
    for other in others:
        assert set(seeds).isdisjoint(other)
    assert min(seeds) > 2**35  # those of a search are smaller


def test_a_kept_confirmation_is_that_of_one_controller_and_number(
    small_task, good_source, warm, tmp_path
):
    """Nothing else is answered from it."""
    source = failing(good_source, 40).encode()
    report = confirm(source, small_task, 1, out=tmp_path, judge=warm)
    assert kept_confirmation(tmp_path, source, small_task, 1) == report
    assert kept_confirmation(tmp_path, source, small_task, 2) is None
    assert kept_confirmation(tmp_path, b"other", small_task, 1) is None
    assert kept_confirmation(tmp_path / "none", source, small_task, 1) is None


def test_verify_tells_passed_from_verified(tdac, good, good_source, tmp_path):
    """`--no-confirm` and `--paper` end at passed; a failed confirmation exits 1."""
    file, junit = good / "controller.py", tmp_path / "junit.xml"
    for flag in ("--no-confirm", "--paper"):
        code, out, _ = tdac("verify", file, "--task", good, flag)
        assert code == 0
        assert "passed: " in out
        assert "verified" not in out
    # A file that passes the suite, as the seed of its starts decides, may fail later.
    file.write_text(failing(good_source, 40))
    words = ("verify", file, "--task", good, "--seed", passing_seed(tdac, file, good))
    code, out, _ = tdac(*words, "--junit", junit)
    assert code == 1
    assert "not verified: 2 of " in out
    assert "replay the first of them: tdac play" in out
    cases = {case.get("name"): case for case in ET.parse(junit).iter("testcase")}
    assert cases["blind drives"].find("failure") is not None
    code, out, _ = tdac(*words, "--json")
    assert json.loads(out)["confirmation"]["successes"] >= 0


def passing_seed(tdac, file, task):
    """A seed of the suite with which a file that sometimes fails passes."""
    for seed in range(200):
        words = ("verify", file, "--task", task, "--no-confirm", "--seed", seed)
        if tdac(*words)[0] == 0:
            return seed
    return pytest.fail("no seed found")
