"""Promises of a second opinion: what arrives is driven again with MuJoCo."""

import json
from pathlib import Path
from typing import get_args

import pytest
from script import AHEAD, Script, code
from small import write_small_task
from unconfirmed import synthesize
from without_marks import reading

from tdac_agent import load_task
from tdac_agent.synthesis.options import Engine
from tdac_agent.verification.diagnosis.report import OtherEpisode, SecondOpinion
from tdac_agent.verification.diagnosis.second_opinion import as_test, opinion_text
from tdac_agent.verification.verify import verify
from tdac_envs.core.errors import TaskError
from tdac_envs.physics.moved import ENGINES

pytest.importorskip("mujoco")
NAMES = ["nominal", *(f"jitter {n}" for n in range(1, 6))]


def other(name, outcome="reached", gap=0.0196, exact=0.0201):
    return OtherEpisode(name=name, outcome=outcome, steps=7, gap=gap, exact_gap=exact)


@pytest.mark.slow
def test_an_e_puck_drives_again_from_the_same_starts(crates, crates_source, warm):
    report = verify(crates_source, crates, judge=warm, physics="mujoco")
    opinion = report.second_opinion
    assert report.passed
    assert opinion is not None
    assert opinion.engine.startswith("MuJoCo ")
    assert not opinion.scaled
    assert [each.name for each in opinion.episodes] == NAMES
    gaps = {each.name: each.smallest_gap.gap for each in report.episodes}
    for each in opinion.episodes:
        assert each.arrives
        assert each.exact_gap == gaps[each.name]
        # Another motion, by less than a millimetre and a half.
        assert each.gap == pytest.approx(each.exact_gap, abs=1.5e-3)
    assert {each.gap for each in opinion.episodes} != set(gaps.values())


@pytest.mark.slow
def test_a_map_without_metres_is_scaled_and_says_so(good, done):
    """The nominal episode alone, with `--paper`; the line follows the verdict."""
    words = "--paper", "--physics", "mujoco", "--require-physics", "--out", "out"
    said = done("verify", good / "controller.py", "--task", good, *words)
    line = said.splitlines()[-1]
    assert line.startswith("second opinion (MuJoCo ")
    assert ", with a body radius of 0.1 m): 1 of 1 arrive; smallest gap " in line
    assert " px with the exact step, " in line
    report = json.loads(Path("out/report.json").read_text())
    assert report["second_opinion"]["scaled"] is True
    assert report["tests"]["second_opinion[mujoco]"] == "passed"
    assert report["verdict"]["passed"] is True


def test_what_does_not_arrive_here_is_not_driven_again(crates, warm):
    """Required, the opinion then is one more test that failed."""
    report = verify(
        AHEAD, crates, profile="policy", paper=True, judge=warm, physics="mujoco",
        require_physics=True,
    )  # fmt: skip
    assert report.second_opinion is None
    assert report.tests["second_opinion[mujoco]"] == "failed"
    assert "no episode reached the goal" in report.failures[-1].message


@pytest.mark.slow
def test_without_it_a_report_says_nothing(good, done):
    said = done("verify", good / "controller.py", "--task", good, "--paper", "--json")
    assert json.loads(said)["second_opinion"] is None


def test_the_line_has_arrivals_and_both_gaps(crates):
    opinion = SecondOpinion(
        engine="MuJoCo 4.0.1",
        episodes=(other("nominal"), other("jitter 1", "collision", 0.0, 0.03)),
    )
    assert opinion_text(opinion, crates.setting.shown) == (
        "second opinion (MuJoCo 4.0): 1 of 2 arrive (jitter 1: collision in step 7); "
        "smallest gap 20.1 mm with the exact step, 0 mm with MuJoCo"
    )


def test_the_line_says_who_measured_the_rays(crates):
    opinion = SecondOpinion(
        engine="MuJoCo 4.0.1", episodes=(other("nominal"),), measured=True
    )
    begin = "second opinion (MuJoCo 4.0, with its rays): 1 of 1 arrive; "
    assert opinion_text(opinion, crates.setting.shown).startswith(begin)


def test_the_commands_offer_what_the_environments_have():
    assert get_args(Engine) == ENGINES


@pytest.mark.slow
def test_an_opinion_with_its_own_rays_says_so(good, done):
    words = "--paper", "--physics", "mujoco-rays", "--require-physics", "--out", "out"
    said = done("verify", good / "controller.py", "--task", good, *words)
    assert ", with its rays, with a body radius of 0.1 m): 1 of 1 arrive" in said
    tests = json.loads(Path("out/report.json").read_text())["tests"]
    assert tests["second_opinion[mujoco-rays]"] == "passed"


def test_a_required_opinion_is_a_test_that_all_arrive():
    good = SecondOpinion(engine="MuJoCo 4.0.0", episodes=(other("nominal"),))
    assert as_test(good, "mujoco") == ({"second_opinion[mujoco]": "passed"}, [])
    bad = (other("nominal", "truncated"),)
    outcome, (failure,) = as_test(good.model_copy(update={"episodes": bad}), "mujoco")
    assert outcome == {failure.test: "failed"}
    assert "0 of 1 arrive (nominal: truncated in step 7)" in failure.message


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ("--physics", "mujoko"),
            "'mujoko' is not one of 'exact', 'mujoco'",
        ),
        (("--require-physics",), "--require-physics needs --physics mujoco"),
    ],
)
def test_a_mistake_is_one_line(good, refused, words, told):
    command = "verify", good / "controller.py", "--task", good, *words
    assert told in refused(*command)


def test_a_task_with_movers_is_refused_before_anything_is_driven(good_source, tmp_path):
    task = load_task(write_small_task(tmp_path, movers="bounce:2"))
    with pytest.raises(TaskError, match="has no movers; leave them out"):
        verify(good_source, task, physics="mujoco")


@pytest.mark.slow
def test_a_run_asks_for_it_and_its_page_says_so(tmp_path, good_source, warm):
    """Each candidate that arrives here has the line; one that does not has none."""
    task = load_task(write_small_task(tmp_path / "task", profile="policy"))
    run = synthesize(
        task,
        Script(code(AHEAD), code(good_source)),
        out=tmp_path / "run",
        iterations=2,
        patience=1,
        physics="mujoco",
        judge=warm,
    )
    assert run.passed
    page = reading(tmp_path / "run")
    line = "second opinion (MuJoCo "
    assert page.count(line) == 1
    assert "6 of 6 arrive; smallest gap " in page[page.index(line) :][:120]


def test_a_run_is_refused_before_the_model_is_asked(tmp_path):
    task = load_task(write_small_task(tmp_path / "task", movers="bounce:2"))
    model = Script()
    with pytest.raises(TaskError, match="has no movers"):
        synthesize(task, model, out=tmp_path / "run", physics="mujoco")
    assert model.requests == []


@pytest.mark.slow
def test_an_episode_is_played_in_three_dimensions(done, good):
    said = done("play", good, "--view", "3d", "--video", "a.gif", "--speed", "50")
    assert "wrote a.gif" in said
    assert Path("a.gif").stat().st_size > 20_000
