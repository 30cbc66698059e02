"""Promises of the benchmark that sets our search beside GEPA's."""

import ast
import sys

import pytest
from few_worlds import write_set

from benchmarks.gepa_search import PAIRS, Terms, by_gepa, by_ours, kept, main
from benchmarks.in_process import Drives
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set

START = "NEAR = 0.2\nWIDE = 4.0\n\n\ndef policy(obs):\n    return 1.0, 1.0\n"
IMPROVE = 128


class Ground:
    """Episodes that follow from two constants, best at 1; each world weighs them."""

    def __init__(self):
        self.driven = []

    def __call__(self, source, split, index):
        self.driven.append((source, split, index))
        values = [node.value.value for node in ast.parse(source).body[:2]]
        weight = index % 5 / 4
        errors = [abs(value - 1.0) / max(value, 1.0) for value in values]
        score = 1.0 - weight * errors[0] - (1.0 - weight) * errors[1]
        return EpisodeRow(
            index=index,
            generator="mazes",
            outcome="reached",
            steps=100,
            horizon=400,
            time_score=score,
            path_score=score,
            barn_score=0.0,
            d_min=0.0,
            length=200.0,
            least_steps=60.0,
            gap=1.2,
            detour=1.5,
            in_sight=0.5,
            density=0.2,
            cpu_seconds=0.0,
        )

    def mean(self, source):
        """Mean score of a controller, over all kinds of worlds."""
        return sum(self(source, "test", index).time_score for index in range(5)) / 5


def searched(by, seed):
    """What a search finds, and what it drove."""
    ground = Ground()
    found = by(Terms(load_set("unknown"), START, seed, IMPROVE, ground))
    return found, ground.driven


@pytest.mark.parametrize("by", [by_ours, by_gepa])
def test_a_search_improves_within_its_episodes_and_is_the_same_twice(by):
    """No more episodes than ours may have, all of them on worlds of `dev`."""
    if by is by_gepa:
        pytest.importorskip("gepa")
    found, driven = searched(by, 3)
    terms = Terms(load_set("unknown"), START, 3, IMPROVE, Ground())
    screened = set(terms.worlds("feedback", 8))
    counted = [each for each in driven if each[2] not in screened]
    assert found.episodes == len(counted) == len(set(counted))
    assert terms.episodes - terms.shares.block < found.episodes <= terms.episodes
    assert {split for _, split, _ in driven} == {"dev"}
    assert Ground().mean(found.source) > Ground().mean(START) + 0.02
    assert searched(by, 3) == (found, driven)
    assert searched(by, 4)[0].source != found.source


def test_both_begin_with_the_same_controller_worlds_and_proposal():
    pytest.importorskip("gepa")
    _, ours = searched(by_ours, 5)
    _, theirs = searched(by_gepa, 5)
    terms = Terms(load_set("unknown"), START, 5, IMPROVE, Ground())
    block = terms.worlds("improve", terms.shares.block)
    assert {index for _, _, index in theirs} == set(block)
    begun = [(START, "dev", index) for index in block]
    assert theirs[: len(begun)] == begun
    assert [each for each in ours if each in begun] == begun
    second = next(source for source, *_ in theirs if source != START)
    assert second == next(source for source, *_ in ours if source != START)


@pytest.mark.slow
def test_an_episode_here_is_that_of_the_judge(tmp_path, solver, warm):
    """Up to its CPU time; a controller that raises fails its episode, and no more."""
    path = write_set(tmp_path / "few.yaml")
    drive = Drives(str(path))
    judged = verify_episodes(
        solver, load_set(path), 1, split="dev", first=4, judge=warm
    )
    own = drive(solver, "dev", 4)
    same = {"cpu_seconds": 0.0}
    assert own.model_copy(update=same) == judged.episodes[0].model_copy(update=same)
    assert own.success
    for wrong in (
        "def policy(obs):\n    return 1 / 0\n",
        "import nothing_of_the_kind\n",
    ):
        failed = drive(wrong, "dev", 4)
        assert (failed.outcome, failed.time_score) == ("error", 0.0)


def test_without_gepa_the_command_says_how_to_install_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "gepa", None)
    monkeypatch.setattr("sys.argv", ["gepa_search", str(tmp_path)])
    with pytest.raises(SystemExit, match="gepa is missing: pip install gepa"):
        main()


@pytest.mark.slow
def test_a_pair_is_driven_once_and_kept(tmp_path, monkeypatch, capsys):
    """A row for each pair, and a table with intervals."""
    pytest.importorskip("gepa")
    words = ["gepa_search", str(tmp_path), "--improve", "32", "--pairs", "1"]
    monkeypatch.setattr("sys.argv", [*words, "--worlds", "2"])
    main()
    assert "gepa − ours" in capsys.readouterr().out
    row = kept((tmp_path, 0, 32, 2))
    assert max(row["ours_episodes"], row["gepa_episodes"]) <= 24
    assert 0.0 <= row["start"] <= 1.0
    assert len((tmp_path / PAIRS).read_text().splitlines()) == 2
