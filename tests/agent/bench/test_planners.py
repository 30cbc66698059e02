"""Classical planners: each drives on each of its levels, with the values on record."""

import json

import pytest
import yaml

from tdac_agent.planners.names import FOLDER, PLANNERS, planner_names
from tdac_agent.planners.planner import (
    TUNED,
    levels_of,
    planner_on,
    ranges_of,
    source_of,
    with_values,
)
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError

FIRST = [(name, levels_of(name)[0]) for name in planner_names()]
ALL = [(name, level) for name in planner_names() for level in levels_of(name)]
PAIRS = [*FIRST, *(pair for pair in ALL if pair not in FIRST)]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(("name", "level"), PAIRS)
def test_it_drives(name, level, warm):
    """It passes the tests, and no episode ends with an error of its own."""
    tasks = load_set(level)
    source = planner_on(name, tasks).source
    report = verify_episodes(source, tasks, 1, split="dev", judge=warm)
    assert not report.refused, report.told
    assert {each.outcome for each in report.episodes} <= {
        "reached", "collision", "out of time",
    }  # fmt: skip


@pytest.mark.slow
def test_dwa_arrives(warm):
    """A planner with a map of what it has seen is no straw man."""
    tasks = load_set("unknown")
    report = verify_episodes(
        planner_on("dwa", tasks).source, tasks, 6, split="dev", judge=warm
    )
    assert report.successes >= 4


@pytest.mark.slow
def test_values_on_record_are_of_this_file():
    """Known constants, within their ranges, on levels of the planner."""
    tuned = json.loads((FOLDER / TUNED).read_text())
    for name, levels in tuned.items():
        assert set(levels) <= {*levels_of(name), "barn", "barn-slow"}
        for level, values in levels.items():
            assert set(values) == set(ranges_of(name))
            planner = planner_on(name, load_set(level))
            assert planner.tuned
            for constant, value in values.items():
                low, high = ranges_of(name)[constant]
                assert low <= value <= high
                assert f"\n{constant} = {value!r}\n" in planner.source


def test_a_planner_is_its_file_and_an_entry(tdac):
    """The table names all; the commands, which read it without a parser, list all."""
    text = PLANNERS.read_text("utf-8")
    assert planner_names() == tuple(yaml.safe_load(text))
    for command in (("bench", "run"), ("evaluate",)):
        code, told, _ = tdac(*command, "--help")
        assert code == 0
        assert all(name in told for name in planner_names())


def test_files_have_the_constants_that_are_tuned():
    for name in planner_names():
        with_values(source_of(name), dict.fromkeys(ranges_of(name), 1.0))


@pytest.mark.slow
def test_what_is_not_tuned_is_said():
    assert planner_on("go-to-goal", load_set("known")).tuned is None
    assert planner_on("mppi", load_set("unknown")).tuned
    on_barn = planner_on("mppi", load_set("barn-slow"))
    assert on_barn.tuned is False
    assert on_barn.source == planner_on("mppi", load_set("unknown")).source
    with pytest.raises(ValueError, match="expected one line 'NO = "):
        with_values(source_of("dwa"), {"NO": 1.0})


def test_a_level_that_it_cannot_drive():
    with pytest.raises(TaskError, match="orca needs what is observed in moving, c"):
        planner_on("orca", load_set("known"))
