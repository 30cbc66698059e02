"""Promises of the reader on worlds by other people."""

import dataclasses
import json

import pytest

from benchmarks.real_worlds import main, measure
from tdac_envs import load_world, read_world, write_world
from tdac_envs.worlds.footprint import Polygon


@pytest.fixture(scope="module")
def folder(real_data):
    return real_data / "worlds"


@pytest.fixture(scope="module")
def truths(folder):
    return json.loads((folder / "expected.json").read_text())


@pytest.mark.slow
def test_every_world_is_as_an_independent_reader_has_it(folder, truths):
    """Poses, arenas, footprints, markers, and nothing dropped."""
    rows = [measure(folder / name, truth) for name, truth in truths.items()]
    assert {row.name: row.problems for row in rows if row.problems} == {}
    assert len(rows) >= 18
    assert sum(row.matched for row in rows) == sum(row.footprints for row in rows) > 100


def test_every_world_is_written_and_read_again(folder):
    """Equal, but for what is not modelled."""
    for path in sorted(folder.glob("*.wbt")):
        world = load_world(path)
        again = read_world(write_world(world))
        assert again == dataclasses.replace(world, unmodelled=()), path.name


def test_the_papers_world(folder):
    """A round arena, four boxes, two rocks, a marked goal."""
    world = load_world(folder / "00_paper_empty.wbt")
    assert world.goal == (0.54125, -0.0579839)
    assert world.robot.pose == pytest.approx((-0.430503, 0.554463, -2.863117), abs=1e-6)
    assert world.arena.inside.radius == 1
    kinds = [thing.kind for thing in world.obstacles]
    assert (kinds.count("WoodenBox"), kinds.count("Rock")) == (4, 2)
    rocks = [thing for thing in world.obstacles if thing.kind == "Rock"]
    assert all(isinstance(rock.solid[0].shape, Polygon) for rock in rocks)
    assert world.unmodelled == ()


def test_the_benchmark_sees_what_is_wrong(
    folder, truths, tmp_path, monkeypatch, capsys
):
    """A robot that is off, a box that is elsewhere, an obstacle that is gone."""
    name = "26_cyberbotics_e-puck.wbt"
    truth = truths[name]
    assert measure(folder / name, truth).problems == []
    moved = json.loads(json.dumps(truth))
    moved["robots"][0]["x"] += 0.002
    moved["arena"][0]["wallThickness"] = 0.02
    moved["obstacles"][0]["poly"] = [
        [x + 0.01, y] for x, y in truth["obstacles"][0]["poly"]
    ]
    del moved["obstacles"][1]
    moved["nonphysical"] = [{"name": "ghost", "x": 0, "y": 0}]
    moved["skipped"] = {"Dragon": 1}
    problems = " | ".join(measure(folder / name, moved).problems)
    for said in ("no robot at 0.002", "unexpected robot", "no such arena", "IoU 0.7",
                 "1 WoodenBox only in ours", "no marker ghost", "Dragon"):  # fmt: skip
        assert said in problems
    broken = tmp_path / "broken.wbt"
    broken.write_text("#VRML_SIM R2025a utf8\nFoo {")
    (tmp_path / "expected.json").write_text(json.dumps({"broken.wbt": truth}))
    monkeypatch.setattr("sys.argv", ["real_worlds.py", str(tmp_path)])
    assert main() == 1
    out = capsys.readouterr().out
    assert "broken.wbt: does not load: broken.wbt, line 2, column 6" in out
    assert out.splitlines()[-1].startswith("0 of 1 worlds as expected")
