"""An exported project holds the verified file, and reaches the goal with it."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from worlds_for_controllers import OPEN

from tdac_agent import load_task
from tdac_agent.environments.epuck.builtin import EPuckParameters, template_for
from tdac_agent.environments.epuck.export import POLICY, export_webots, project_name
from tdac_agent.evaluation.policy import load_controller
from tdac_agent.runs.run_record import Run
from tdac_agent.tasks.task import portable_task_file, write_workdir
from tdac_agent.webots.run import run_controller
from tdac_envs import load_world
from tdac_envs.webots.stage import open_stage

STUB = Path(__file__).parent / "stub"
GO = '''"""Turns to the goal and drives there."""
import math

import numpy as np
from sensors import load_params

LIMIT = load_params()["robot"]["max_wheel_speed"]
calls = []


def reset(obs):
    calls.append({key: (v.shape, v.dtype.name) for key, v in obs.items()})
    assert not np.isnan(np.concatenate(list(obs.values()))).any()


def policy(obs):
    assert len(calls) == 1 and LIMIT == 6.28
    assert calls[0] == {
        "pose": ((3,), "float32"), "goal": ((2,), "float32"),
        "wheel_speeds": ((2,), "float32"), "ps": ((8,), "float32"),
        "wheel_positions": ((2,), "float32"),
    }
    x, y, heading = obs["pose"]
    off = math.atan2(obs["goal"][1] - y, obs["goal"][0] - x) - heading
    off = math.remainder(off, 2 * math.pi)
    if abs(off) > 0.2:
        turn = math.copysign(0.4, off)
        return -turn, turn
    return 1.5 - off, 1.5 + off


if __name__ == "__main__":
    raise SystemExit("not to be run as a program")
'''  # fmt: skip


def make_run(folder, spec, source, status="verified"):
    """A run folder with what an export needs."""
    folder.mkdir(parents=True)
    (folder / "spec.yaml").write_text(yaml.safe_dump(spec))
    task = load_task(folder / "spec.yaml")
    write_workdir(folder, task)
    (folder / "task.yaml").write_text(portable_task_file(task))
    (folder / "controller.py").write_text(source)
    run = Run(
        folder=folder,
        task=task.name,
        task_sha256=task.sha256(),
        learner="builtin",
        optimizer="builtin",
        iterations=1,
        patience=0,
        seed=0,
        status=status,
        tau=1 if status == "verified" else None,
        started="2026-01-01T00:00:00",
    )
    (folder / "run.json").write_text(run.model_dump_json())
    return folder


def steps_in_env(folder):
    """Steps to the goal by `env.step(policy(obs))`, as it was verified."""
    task = load_task(folder)
    env = task.make_env()
    obs, _ = env.reset(seed=0)
    with load_controller(folder / "controller.py", task) as policy:
        policy.reset(obs)
        for step in range(1, task.nominal.horizon + 1):
            obs, _, terminated, _, info = env.step(policy(obs))
            if terminated:
                assert info["is_success"]
                return step
    raise AssertionError("the goal is not reached")


@pytest.fixture
def verified(tmp_path):
    """A run whose controller goes straight to the goal of an open world."""
    (tmp_path / "open.wbt").write_text(OPEN.replace("0 0 1 0.0", "0 0 1 2.5"))
    spec = {
        "schema": 1,
        "env": "TDAC-EPuck-v0",
        "name": "my open world",
        "world": str(tmp_path / "open.wbt"),
    }
    return make_run(tmp_path / "run", spec, GO)


def test_files(verified, tmp_path):
    """World, adapter, and the verified file with all that it was verified with."""
    project = export_webots(verified, tmp_path / "out")
    name = "tdac_my_open_world"
    assert project.world == tmp_path / "out" / "worlds" / f"{name}.wbt"
    folder = tmp_path / "out" / "controllers" / name
    assert project.controller == folder / f"{name}.py"
    assert {path.name for path in folder.iterdir()} == {
        f"{name}.py", POLICY, "params.json", "sensors.py", "world.wbt",
    }  # fmt: skip
    assert (folder / POLICY).read_bytes() == (verified / "controller.py").read_bytes()
    for file in ("params.json", "world.wbt", "sensors.py"):
        assert (folder / file).read_bytes() == (verified / file).read_bytes()
    assert "Not run in Webots itself" in (tmp_path / "out" / "README.md").read_text()


def test_nothing_shadows_webots(verified, tmp_path):
    """No file or folder is called as a module of Webots."""
    project = export_webots(verified, tmp_path / "out")
    names = {path.stem for path in project.controller.parent.iterdir()}
    assert names.isdisjoint({"controller", "vehicle"})
    assert project_name("controller") == "tdac_controller"
    assert project_name("ä/../b c") == "tdac_b_c"
    assert project_name("ü") == "tdac_task"


def test_the_world_is_the_one_of_the_task(verified, tmp_path):
    """It differs in the robot's controller alone; its PROTOs are declared."""
    project = export_webots(verified, tmp_path / "out")
    text = project.world.read_text()
    assert text.startswith("#VRML_SIM R2025a utf8\n")
    assert text.count("supervisor TRUE") == 1
    assert f'controller "{project.controller.stem}"' in text
    world, flat = load_world(project.world), load_world(verified / "world.wbt")
    assert world.robots[0].controller == project.controller.stem
    assert world.robots[0].pose == flat.robots[0].pose
    assert (world.goal, world.obstacles, world.arenas, world.time_step) == (
        flat.goal, flat.obstacles, flat.arenas, flat.time_step,
    )  # fmt: skip
    declared = set(re.findall(r'EXTERNPROTO ".*/([^/]+)\.proto"', text))
    protos = {"E-puck", "RectangleArena", "TexturedBackground"}
    assert declared == {*protos, "TexturedBackgroundLight"}


def drive_bare(project, folder):
    """Runs the adapter with the stub and nothing else on its path; what it prints."""
    elsewhere = folder / "elsewhere"
    shutil.copytree(project.folder, elsewhere)
    adapter = elsewhere / project.controller.relative_to(project.folder)
    environment = {"PYTHONPATH": str(STUB), "PATH": os.environ["PATH"]}
    done = subprocess.run(
        [sys.executable, adapter],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_bare_interpreter_with_a_stub(verified, tmp_path):
    """With nothing of tdac on its path it drives just as it did when verified."""
    project = export_webots(verified, tmp_path / "out")
    printed = drive_bare(project, tmp_path)
    assert printed == f"reached the goal after {steps_in_env(verified)} steps\n"


@pytest.mark.slow
def test_here_it_takes_as_many_steps(verified, tmp_path):
    """Run as a Webots controller it passes; one step more, for the first samples."""
    project = export_webots(verified, tmp_path / "out")
    stage = open_stage(project.world)
    report = run_controller(project.controller, stage, stage.make_env()).report
    assert report.passed, report
    assert report.steps == steps_in_env(verified) + 1


@pytest.mark.slow
@pytest.mark.parametrize("world", ["arena", "corridor", "crates"])
def test_builtin_controllers_of_bundled_worlds(tmp_path, world):
    """A controller of the built-in learner takes as many steps ± 5 %, also bare."""
    spec = {"schema": 1, "env": "TDAC-EPuck-v0", "world": world, "name": world}
    source = template_for(load_task_of(spec, tmp_path).nominal).render(
        EPuckParameters()
    )
    folder = make_run(tmp_path / "run", spec, source)
    project = export_webots(folder, tmp_path / "out")
    stage = open_stage(project.world)
    report = run_controller(project.controller, stage, stage.make_env()).report
    assert report.passed, report
    wanted = steps_in_env(folder)
    assert abs(report.steps - wanted) <= 0.05 * wanted
    found = re.fullmatch(
        r"reached the goal after (\d+) steps\n", drive_bare(project, tmp_path)
    )
    assert found is not None
    assert abs(int(found[1]) - wanted) <= 0.05 * wanted


def load_task_of(spec, tmp_path):
    file = tmp_path / "task-of.yaml"
    file.write_text(yaml.safe_dump(spec))
    return load_task(file)


def test_command(done, verified):
    """Exit 0; it says what it wrote, what came out, and what was not tried."""
    out = done("export", "webots", verified, "--out", "project")
    assert "run by tdac, as a Webots controller: reached the goal after" in out
    assert "not run in Webots itself" in out
    assert Path("project/worlds/tdac_my_open_world.wbt").is_file()


def test_json(tdac, verified):
    """The record names the files, and how the project drove here."""
    code, out, _ = tdac("export", "webots", verified, "--out", "project", "--json")
    record = json.loads(out)
    assert code == 0
    assert record["run_in_webots"] is False
    assert record["driven_here"]["outcome"] == "reached"
    assert Path(record["controller"]).is_file()
    assert Path(record["world"]).is_file()


@pytest.mark.slow
def test_the_whole_way(tdac, done):
    """What `tdac synth` has verified drives as a Webots project; ± 5 % of the steps."""
    assert tdac("synth", "--task", "epuck-crates", "--out", "run")[0] == 0
    out = done("export", "webots", "run", "--out", "project")
    found = re.search(r"the goal after (\d+) steps \(when verified: (\d+)\)", out)
    assert found is not None, out
    here, verified = map(int, found.groups())
    assert abs(here - verified) <= 0.05 * verified


@pytest.mark.slow
def test_command_with_a_controller_that_does_not_get_there(rejected, verified):
    """Exit 1: what drives here is the exported file."""
    (verified / "controller.py").write_text("def policy(obs):\n    return 0.1, -0.1\n")
    out = rejected("export", "webots", verified, "--out", "project")
    assert "not passed: the goal was not reached" in out


class TestRefused:
    def test_not_verified(self, refused, verified):
        """Only verified controllers are exported."""
        record = json.loads((verified / "run.json").read_text())
        (verified / "run.json").write_text(
            json.dumps({**record, "status": "not verified"})
        )
        err = refused("export", "webots", verified, "--out", "project")
        assert "has no controller that passed (not verified)" in err
        assert not Path("project").exists()

    def test_a_map(self, refused, tmp_path):
        """A controller for a map is none for Webots."""
        spec = {"schema": 1, "map": "maze", "name": "maze"}
        folder = make_run(tmp_path / "run", spec, "def policy(obs): return 0, 0\n")
        err = refused("export", "webots", folder, "--out", "project")
        assert "is a run of TDAC-Map2D-v0" in err

    def test_a_folder_in_use(self, refused, verified):
        """Nothing is overwritten."""
        Path("project").mkdir()
        Path("project/mine.txt").write_text("mine")
        err = refused("export", "webots", verified, "--out", "project")
        assert "project is not an empty folder" in err
        assert [path.name for path in Path("project").iterdir()] == ["mine.txt"]

    def test_no_run(self, refused):
        """A folder without a run."""
        err = refused("export", "webots", ".", "--out", "project")
        assert "is not a run folder" in err
