"""Blind confirmations: what they accept, and that nobody can know their starts."""

import json
import shutil
import xml.etree.ElementTree as ET

import pytest
import yaml
from script import Script, code

import tdac_agent
from tdac_agent import load_task
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task import lay_out
from tdac_agent.verification.confirmation import (
    DISTURBANCE,
    confirm,
    confirming_seeds,
    disturbance_of,
    kept_confirmation,
    read_confirmation,
)
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.verdict import (
    confirmed_text,
    delivered_text,
    not_covered,
    verified_text,
)
from tdac_envs.robots.bundled import load_robot

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


UNLESS_IT_SLIPS = """

import math

_steer, _last, _first = policy, [], []


def policy(obs):
    pose, speeds = [float(v) for v in obs["pose"]], obs["wheel_speeds"]
    mean = float(speeds[0] + speeds[1]) / 2
    if _last and mean > 0.3:
        moved = math.hypot(pose[0] - _last[0], pose[1] - _last[1]) / mean
        _first.append(moved)
        if abs(moved - _first[0]) > 0.005 * moved:
            raise ValueError("it slipped")
    _last[:] = pose
    return _steer(obs)
"""
"""What makes a controller fail if its wheels slip, which no test of the suite does."""


def failing(source, percent):
    """A controller that fails on purpose in so many percent of all drives."""
    return source + SOMETIMES.format(percent=percent)


@pytest.fixture
def out(tmp_path):
    return tmp_path / "run"


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
    assert "not covered: other worlds, late actions, late readings" in verified_text(
        report
    )
    assert seen[-1] == (93, report.successes)
    calm = report.provenance.model_copy(update={"disturbance": Disturbance.none()})
    quiet = verified_text(report.model_copy(update={"provenance": calm}))
    assert "other worlds, noise of ranges, slip, late actions" in quiet
    burger = load_robot("turtlebot3-burger").disturbances()
    own = Disturbance.none().changed(burger)
    drove_with = report.provenance.model_copy(update={"disturbance": own})
    assert not_covered(report.model_copy(update={"provenance": drove_with})) == (
        "other worlds, late actions, missing ranges, lost messages, another axle, "
        "other physics (floor, motors, battery)"
    )
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


def test_a_task_that_states_the_usual_disturbance_gets_it(tmp_path, small_task):
    """What a task says of its disturbances holds, whatever else is the default."""
    folder = lay_out(small_task, tmp_path / "task")
    file = folder / "task.yaml"
    plain, keys = load_task(file), yaml.safe_load(file.read_text())
    assert disturbance_of(plain) == DISTURBANCE
    usual = Disturbance()
    file.write_text(yaml.safe_dump({**keys, "disturbances": {"delay": usual.delay}}))
    stated = load_task(file)
    assert disturbance_of(stated) == usual
    assert stated.sha256() != plain.sha256()
    again = load_task(lay_out(stated, tmp_path / "again") / "task.yaml")
    assert disturbance_of(again) == usual
    assert again.sha256() == stated.sha256()


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


@pytest.mark.slow
def test_verify_tells_passed_from_verified(tdac, good, good_source, tmp_path):
    """`--no-confirm` and `--paper` end at passed; a failed confirmation exits 1."""
    file, junit = good / "controller.py", tmp_path / "junit.xml"
    file.write_text(good_source + UNLESS_IT_SLIPS)
    words = ("verify", file, "--task", good)
    for flag in ("--no-confirm", "--paper"):
        code, out, _ = tdac(*words, flag)
        assert code == 0
        assert "passed: " in out
        assert "verified" not in out
    code, out, _ = tdac(*words, "--junit", junit)
    assert code == 1
    assert "not verified: 2 of 2 blind drives failed; at most 1 of 93 may" in out
    assert "replay the first of them: tdac play" in out
    cases = {case.get("name"): case for case in ET.parse(junit).iter("testcase")}
    assert cases["blind drives"].find("failure") is not None


@pytest.mark.slow
def test_a_run_goes_on_after_a_failed_confirmation(small_task, good_source, warm, out):
    """Its failures are told to the model; the next confirmation has more drives."""
    model = Script(code(good_source + UNLESS_IT_SLIPS), code(good_source))
    run = tdac_agent.synthesize(small_task, model, out=out, iterations=1, judge=warm)
    assert (run.status, run.verified, run.passed) == ("verified", True, True)
    assert [each.passed for each in run.confirmations] == [False, True]
    assert run.confirmations[1].episodes == 125
    assert [each.confirmed for each in run.attempts] == [False, True]
    assert all(each.passed for each in run.attempts)
    told = model.requests[1]
    assert "All tests passed. Then it drove blind" in told.prompt
    assert "it slipped" in told.prompt
    assert read_confirmation(run).passed
    assert delivered_text(run) == "in iteration 1 (2 candidates, 2 confirmations)"


@pytest.fixture(scope="module")
def unconfirmed(small_task, good_source, warm, tmp_path_factory):
    """The folder of a run whose controller passed, and failed its blind drives."""
    folder = tmp_path_factory.mktemp("unconfirmed") / "run"
    model = Script(code(good_source + UNLESS_IT_SLIPS))
    once = {"iterations": 1, "patience": 0, "refine": False}
    tdac_agent.synthesize(small_task, model, out=folder, judge=warm, **once)
    return folder


def test_a_run_that_is_never_confirmed(unconfirmed):
    """It delivers what passed, and says what the blind drives showed."""
    run = load_run(unconfirmed)
    assert (run.status, run.verified, run.passed) == ("not verified", False, True)
    assert run.reason == "2 of 2 blind drives failed; at most 1 of 110 may"
    assert run.controller.is_file()


@pytest.mark.slow
def test_what_passed_is_confirmed_later(small_task, good_source, warm, out):
    """By the same command without `--no-confirm`; nothing is asked or tested again."""
    given = {"out": out, "iterations": 1, "judge": warm}
    model = Script(code(good_source))
    run = tdac_agent.synthesize(small_task, model, confirm=False, **given)
    assert (run.status, run.confirmations) == ("passed", [])
    run = tdac_agent.synthesize(small_task, model, **given)
    assert (run.status, len(run.confirmations)) == ("verified", 1)
    assert len(model.requests) == 1


@pytest.mark.parametrize("change", ["bound", "words", "other"])
def test_a_changed_confirmation_is_not_shown(unconfirmed, good_source, out, change):
    """Not with another bound, nor what is none, nor that of another controller."""
    shutil.copytree(unconfirmed, out)
    run = load_run(out)
    found = read_confirmation(run)
    assert found is not None
    assert not found.passed
    file, record = out / "confirmation.json", json.loads(found.model_dump_json())
    if change == "bound":
        record["sequential"]["test"]["least"] = 0.9999
    elif change == "words":
        record["sequential"] = None
    else:
        run.controller.write_text(good_source)
    if change != "other":
        file.write_text(json.dumps(record))
    assert read_confirmation(run) is None


@pytest.mark.slow
def test_a_forged_confirmation_is_not_believed(small_task, good_source, warm, out):
    """A run that goes on drives again what it did not write itself."""
    source = good_source + UNLESS_IT_SLIPS
    given = {"out": out, "iterations": 1, "patience": 0, "refine": False, "judge": warm}
    tdac_agent.synthesize(small_task, Script(code(source)), confirm=False, **given)
    forged = out / "iterations" / "k01" / "j0" / "confirmation"
    report = confirm(good_source, small_task, 1, out=forged, judge=warm)
    seeds = confirming_seeds(source.encode(), small_task, 1)
    facts = {"controller_sha256": sha256_of(source), "first": seeds.start}
    about = report.provenance.model_copy(update=facts)
    report = report.model_copy(update={"provenance": about})
    (forged / "episodes.json").write_text(report.model_dump_json())
    assert kept_confirmation(forged, source.encode(), small_task, 1) is not None
    run = tdac_agent.synthesize(small_task, Script(), **given)
    assert run.status == "not verified"
