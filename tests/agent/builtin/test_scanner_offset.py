"""Our own controllers start rays where the scanner is, not at the robot's centre."""

import importlib.util

import numpy as np
import pytest
from small import room_with_blocks

from tdac_agent.builtin.level import LEVELS
from tdac_agent.builtin.provider import template_of
from tdac_agent.planners.names import planner_names
from tdac_agent.planners.planner import source_of
from tdac_agent.tasks.task import lay_out
from tdac_agent.verification.judge.set_files import write_as_level

START = 60, 50, 0.0
OFFSET = -5.0, 3.0
TURN = np.array([0.2, -0.2], np.float32)
PLANNERS = sorted({*planner_names()} - {"go-to-goal"})


@pytest.fixture
def task(tmp_path):
    """A task in a room with two blocks."""
    return room_with_blocks(tmp_path, START, 120, OFFSET)


def state_after(source, task, folder, monkeypatch, steps=4, left_out=()):
    """What a controller remembers of a turn on the spot; its names."""
    write_as_level(folder, task)
    monkeypatch.chdir(folder)
    names = {}
    exec(compile(source, "controller.py", "exec"), names)
    env = task.setting.make_env(odometry=True)
    obs, _ = env.reset(seed=0)

    def shown(seen):
        return {key: value for key, value in seen.items() if key not in left_out}

    names["reset"](shown(obs))
    for _ in range(steps):
        names["policy"](shown(obs))
        obs = env.step(TURN)[0]
    return names, obs


def off_walls(task, places):
    """Largest distance of places from the nearest wall, px."""
    rows, columns = np.nonzero(task.nominal.terrain.grid.cells)
    x, y = np.asarray(places, float).reshape(-1, 2).T[..., None]
    assert len(x) > 20
    off_x = np.maximum(np.abs(x - columns) - 0.5, 0.0)
    off_y = np.maximum(np.abs(y - rows) - 0.5, 0.0)
    return float(np.hypot(off_x, off_y).min(axis=1).max())


@pytest.mark.parametrize("name", PLANNERS)
def test_planners_see_walls_where_they_are(name, task, tmp_path, monkeypatch):
    """What they remember of their scans lies on walls."""
    names, obs = state_after(source_of(name), task, tmp_path, monkeypatch)
    state = names["STATE"]
    if "grid" in state:
        assert off_walls(task, state["grid"].points[:, :2]) < 1e-3
    if "hits" in state:
        assert off_walls(task, [hit[:2] for hit in state["hits"].values()]) < 1e-3
    ranges = np.asarray(obs["ranges"], float)[names["ORDER"]]
    far, bearings = names["from_centre"](ranges)
    x, y, heading = map(float, obs["pose"])
    ends = np.column_stack(
        [x + far * np.cos(heading + bearings), y + far * np.sin(heading + bearings)]
    )
    assert off_walls(task, ends[far < names["RANGE"] - 1e-3]) < 1e-3


def walls_in(chart, half):
    j, i = np.nonzero(chart.walls)
    return np.column_stack([i - half, j - half])


@pytest.mark.parametrize("name", ["unknown", "moving", "crowd", "lost"])
def test_levels_see_walls_where_they_are(name, task, tmp_path, monkeypatch):
    """Their maps have no wall elsewhere, and nobody stands at a wall."""
    source = (LEVELS / f"{name}.py").read_text()
    hidden = ("pose",) if name == "lost" else ()
    names, _ = state_after(source, task, tmp_path, monkeypatch, left_out=hidden)
    state, cells = names["STATE"], task.nominal.terrain.grid.cells
    if name == "crowd":
        assert state["people"] == []
        return
    if name == "lost":
        surfaces = state["maps"].surfaces
        (x, y), _ = surfaces.points(0.0, 0.0, 200.0)
        # The mean place of the hits in a cell.
        assert off_walls(task, np.column_stack([x, y]) + START[:2]) < 0.5
        return
    chart, half = (
        (state["maps"], state["maps"].half)
        if name == "unknown"
        else (state["chart"], names["HALF"])
    )
    i, j = walls_in(chart, half).T
    assert len(i) > 20
    assert cells[j, i].all()


def test_the_template_knows_how_far_it_is_from_a_wall_ahead(task, tmp_path):
    """The free distance is that of the body, not of the scanner behind its centre."""
    folder = lay_out(task, tmp_path / "out")
    template = template_of(task.setting)
    (folder / "controller.py").write_text(template.render(template.kind()))
    spec = importlib.util.spec_from_file_location("sensors", folder / "sensors.py")
    sensors = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sensors)
    names = {"sensors": sensors, "__name__": "controller"}
    source = (folder / "controller.py").read_text().replace("import sensors\n", "")
    exec(compile(source, "controller.py", "exec"), names)
    obs, _ = task.setting.make_env().reset(seed=0, options={"start": (60, 60, 0.0)})
    free = names["Driver"](obs)._free_ahead(obs["ranges"])
    assert free == pytest.approx(163.5 - 60 - 8, abs=1e-3)
