"""E-puck controllers through judge, records, pictures and command line."""

import json
import math
import re

import cv2
import gymnasium as gym
import numpy as np
import pytest
from script import AHEAD, STILL
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.cli.play import drive_disturbed
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.environments.epuck.pictures import reaches
from tdac_agent.evaluation.policy import load_controller
from tdac_agent.runs.run_record import load_run
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task_file import TaskFile
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.suite.starts import spread_starts
from tdac_agent.verification.verify import load_trajectories, verify
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.drawing.canvas import TRAIL
from tdac_envs.epuck.infrared import TABLE
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.wbt.writer import write_world

LEGO = '\nLegoTallWall {\n  translation 0.1 3 0\n  name "north"\n}\n'


@pytest.fixture
def controller(tmp_path, crates_source):
    file = tmp_path / "controller.py"
    file.write_text(crates_source)
    return file


def test_starts_are_spread_in_metres(crates):
    """Moved starts lie within a body radius, on several sides, and are feasible."""
    starts = spread_starts(crates.nominal, 3, 5)
    assert starts == spread_starts(crates.nominal, 3, 5)
    x, y, heading = crates.nominal.start
    offsets = np.array([(s.x - x, s.y - y) for s in starts])
    turns = [math.remainder(s.heading - heading, math.tau) for s in starts]
    assert np.hypot(*offsets.T).max() <= 0.037
    assert np.hypot(*offsets.T)[:4].min() > 0.015
    assert max(map(abs, turns)) <= 0.5
    assert {tuple(np.sign(row)) for row in offsets[:4]} == {
        (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)
    }  # fmt: skip
    assert all(crates.nominal.ground.gap(s.x, s.y) >= 0.037 for s in starts)


def test_a_collision_is_judged_and_drawn(crates, warm, tmp_path):
    """The report names what was hit; the trajectory and a picture are kept."""
    report = verify(AHEAD, crates, profile="policy", judge=warm, out=tmp_path)
    assert not report.passed
    nominal = report.episodes[0]
    assert (nominal.outcome, nominal.collisions) == ("collision", 1)
    assert 1.0 < nominal.d0 < 1.5
    diagnosis = next(f.diagnosis for f in report.failures if f.diagnosis)
    assert diagnosis.thing.startswith("WoodenBox 'box ")
    assert " mm" in diagnosis.text
    assert " px" not in diagnosis.text
    assert Report.model_validate_json((tmp_path / "report.json").read_text()) == report
    trajectory = load_trajectories(tmp_path / "trajectories")["nominal"]
    assert trajectory.ranges.shape == (nominal.steps + 1, 8)
    assert trajectory.ranges[-1].max() > 400.0
    picture = cv2.imread(str(tmp_path / "trajectories" / "nominal.png"))
    assert picture.shape[0] > 300
    assert picture.shape[1] > 880


def test_feedback_is_in_millimetres(crates, warm):
    """What fails the progress test is told in the units of the prompt."""
    report = verify(STILL, crates, profile="policy", judge=warm)
    message = next(f.message for f in report.failures if "test_progress" in f.test)
    assert re.search(
        r"the path to the goal must fall from 127\d\.\d mm to 8[89]\d\.\d mm or less "
        r"\(70%\); its smallest value was 127\d\.\d mm",
        message,
    )


def test_a_trajectory_picture_has_each_run(crates):
    """A run goes through the picture where it went through the world, y up."""
    pictures, view = crates.pictures(), crates.pictures().backdrop()
    poses = np.array([(-0.6, 0.0, 0.0), (-0.6, 0.4, 1.5), (-0.2, 0.4, 0.0)])
    image = pictures.trajectories([poses], ["out of time"], ["one"])
    (u, v), (left, _), (_, low) = view.whole().at(
        np.array([(-0.6, 0.2), (-0.7, 0.2), (-0.6, 0.1)])
    )
    assert left < u
    assert low > v
    around = image[int(v) - 3 : int(v) + 4, int(u) - 3 : int(u) + 4].astype(int)
    assert np.abs(around - TRAIL).sum(axis=2).min() < 60


@pytest.mark.slow
def test_frames_show_what_the_sensors_read(crates, warm, tmp_path):
    """A video's frames are of one size, and a ray ends where its reading says."""
    verify(AHEAD, crates, profile="policy", judge=warm, out=tmp_path)
    rollout = drive_disturbed(crates, AHEAD.encode(), 0, Disturbance(), "auto").rollout
    frames = list(crates.pictures().frames(rollout, 2))
    assert len({frame.shape for frame in frames}) == 1
    assert len(frames) == (rollout.trajectory.steps + 1) // 2 + 1
    assert np.allclose(reaches(TABLE[:, 1].astype(np.float32)), TABLE[:, 0], atol=1e-6)
    assert reaches(np.array([5000.0, 10.0], np.float32)).tolist() == [0.0, 0.07]


@pytest.mark.slow
def test_disturbed_episodes_are_what_the_environment_draws(crates, crates_source, warm):
    """Disturbed episodes: reproducible, in metres, and counted."""
    report = verify_episodes(crates_source, crates, 6, judge=warm)
    assert report.provenance.unit == "m"
    assert report.successes + len(report.failures) == 6
    again = verify_episodes(crates_source, crates, 6, judge=warm)
    figures = [e.model_dump(exclude={"cpu_seconds"}) for e in report.worst]
    assert figures == [e.model_dump(exclude={"cpu_seconds"}) for e in again.worst]
    for episode in report.worst:
        env = crates.disturbed_env(Disturbance())
        _, info = env.reset(seed=episode.seed)
        assert episode.d0 == round(info["path_distance"], 4)


def test_a_policy_drives_the_environment(crates, controller):
    """`env.step(policy(obs))` with a loaded controller, from Python."""
    env = gym.make("tdac_envs:TDAC-EPuck-v0", **crates.env_kwargs())
    observation, _ = env.reset(seed=0)
    with load_controller(controller, crates) as policy:
        for _ in range(30):
            observation, _, terminated, _, _ = env.step(policy(observation))
    assert not terminated
    assert observation["pose"][0] > -0.6


@pytest.mark.slow
def test_a_run_is_self_contained(crates, tmp_path, warm):
    """A synthesis leaves the world, its original, the picture and a task that loads."""
    run = synthesize(crates, out=tmp_path / "run", iterations=2, judge=warm)
    assert run.passed
    folder = tmp_path / "run"
    names = {path.name for path in folder.iterdir()}
    assert {"world.wbt", "original.wbt", "trajectory.png", "params.json"} <= names
    assert (folder / "original.wbt").read_bytes() == world_file("crates").read_bytes()
    assert load_run(folder).task_sha256 == load_task(folder).sha256() == crates.sha256()


@pytest.mark.slow
def test_command_line_verifies_in_a_world(tdac, done, controller, tmp_path):
    """`--task epuck-NAME` and `--world NAME` are the same; the table is in mm."""
    out = done("verify", controller, "--task", "epuck-crates")
    assert "Episodes as the environment recorded them (mm)" in out
    assert "passed: 46 of 46" in out
    words = ("verify", controller, "--world", "crates", "--profile", "policy")
    code, out, _ = tdac(*words, "--start", "-0.6", "0.1", "0.2", "--json")
    report = json.loads(out)
    assert code == 0
    assert report["provenance"]["unit"] == "m"
    assert report["provenance"]["task"] == "crates"


@pytest.mark.slow
def test_command_line_lists_what_is_left_out(refused, done, controller, tmp_path):
    """A node that may be solid is refused; ignored, the verdict lists it."""
    file = tmp_path / "w.wbt"
    file.write_text(world_file("crates").read_text() + LEGO)
    words = ("verify", controller, "--world", file, "--profile", "policy", "--paper")
    err = refused(*words)
    assert "LegoTallWall" in err
    assert "--ignore NAME" in err
    out = done(*words, "--ignore", "north")
    assert "left out of the world: LegoTallWall 'north' at (0.1, 3)" in out
    out = done(*words, "--ignore", "LegoTallWall", "--json")
    left_out = json.loads(out)["provenance"]["left_out"]
    assert left_out == ["LegoTallWall 'north' at (0.1, 3)"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--world", "crate"], "did you mean 'crates'"),
        (["--world", "none.wbt"], "none.wbt: no such file"),
        (["--world", "broken.wbt"], r"broken.wbt:2:\d+|line 2"),
        (["--world", "nogoal.wbt"], "names no goal: give --goal X Y in metres"),
        (["--world", "crates", "--goal", "5", "5"], "goal \\(5, 5\\)"),
        (["--world", "crates", "--start", "0.6", "0"], "already at the goal"),
        (["--world", "crates", "--start", "0", "0", "nan"], "finite"),
        (["--world", "crates", "--map", "maze"], "leave out --map"),
        (["--world", "crates", "--robot-radius", "3"], "leave out --robot-radius"),
        (["--world", "crates", "--heading", "1"], "--heading needs --start"),
        (["--task", "epuck", "--goal", "9", "9"], "goal \\(9, 9\\)"),
        (["--task", "epuck-crate"], "did you mean 'epuck-crates'"),
        (["--map", "maze", "--ignore", "x"], "leave out --ignore"),
        (["--world", "crates", "--ignore", "x"], "no node called 'x' to ignore"),
    ],
)
def test_bad_input_is_one_line(refused, controller, words, message):
    """Whatever makes no sense is refused in one line, with exit code 2."""
    with open("broken.wbt", "w") as file:
        file.write("#VRML_SIM R2025a utf8\nWorldInfo { basicTimeStep }\n")
    world = load_task("epuck-crates").nominal.ground.world
    text = write_world(world).replace("GOAL", "ELSEWHERE")
    with open("nogoal.wbt", "w") as file:
        file.write(text)
    err = refused("verify", controller, *words)
    assert re.search(message, err), err


@pytest.mark.slow
def test_tasks_of_files_name_their_world(tmp_path, controller, tdac):
    """A task.yaml names a world beside it, and the profile that it wants."""
    (tmp_path / "mine.wbt").write_text(world_file("crates").read_text())
    (tmp_path / "my.yaml").write_text(
        f"env: {EPUCK.id}\nworld: mine.wbt\nprofile: policy\ngoal: [0.6, 0.1]\n"
    )
    code, out, _ = tdac("verify", controller, "--task", tmp_path / "my.yaml", "--json")
    assert json.loads(out)["provenance"]["profile"] == "policy"
    assert code == 0
    spec = TaskFile(env=EPUCK.id, world="mine.wbt", goal=(0.6, 0.1))
    assert load_task(spec, base=tmp_path).nominal.goal == (0.6, 0.1)
