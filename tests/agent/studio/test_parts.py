"""Parts of the studio without a browser: drafts, jobs, unpacked runs."""

import io
import json
import math
import shlex
import shutil
import time
import zipfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
import pytest
from changed_run import change_run

pytest.importorskip("nicegui", reason="needs tdac[studio]")

from nicegui import Client
from nicegui.page import page

import tdac_agent
from tdac_agent.cli.task_choice import chosen_task
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.models.budget import Enough
from tdac_agent.runs.ownership import sign
from tdac_agent.runs.replay import DEMO, RULES
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.journal import append_record
from tdac_agent.studio.comparison import (
    difference,
    figures_of,
    lines_of,
    settings_of,
)
from tdac_agent.studio.draft import (
    Checked,
    TaskDraft,
    check,
    fitting_radius,
    sentence_of,
)
from tdac_agent.studio.driving import KeyboardDrive
from tdac_agent.studio.folder import deployable
from tdac_agent.studio.jobs import JobFile, StudioJob, free_folder, job_of, jobs, start
from tdac_agent.studio.pages.bench import named_entrants, progress_of
from tdac_agent.studio.pages.home import address_with
from tdac_agent.studio.pages.questions import KINDS, asked_for
from tdac_agent.studio.pages.run_list import unpack
from tdac_agent.studio.pages.writers import Writers
from tdac_agent.studio.run_status import (
    asked_by,
    episodes_driven,
    from_elsewhere,
    initial_controller_text,
    last_step,
)
from tdac_agent.studio.source_view import names_of, view_of
from tdac_envs.worlds.bodies import BODY_RADIUS

SECONDS = 120


def test_a_local_model_needs_neither_key_nor_limit(monkeypatch):
    """What is missing is said as the command would; the limit is for paid models."""
    for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL"):
        monkeypatch.delenv(name, raising=False)
    with Client(page("/")):
        writers = Writers(Path(), lambda: None)
        writers._who.value, writers._model.value = "openai", "qwen3"
        assert "set the environment variable OPENAI_API_KEY" in writers.problem()
        assert writers.words()[2:] == ["--max-cost", "2"]
        writers._server.value = "http://localhost:11434/v1"
        assert writers.problem() is None
        assert writers.words()[2:] == ["--base-url", "http://localhost:11434/v1"]
        writers._server.value = "http://["
        assert "is not a valid URL" in writers.problem()


def flags_of(words):
    """The flags of a command line, as far as drafts use them."""
    given, left = {}, list(words)
    names = {
        "--map": "map_image",
        "--world": "world",
        "--polarity": "polarity",
        "--robot": "robot",
        "--frame": "frame",
    }
    while left:
        flag = left.pop(0)
        if flag in names:
            given[names[flag]] = left.pop(0)
        elif flag in ("--start", "--goal"):
            given[flag[2:]] = (float(left.pop(0)), float(left.pop(0)))
        else:
            key = {"--heading": "heading", "--robot-radius": "robot_radius"}[flag]
            given[key] = float(left.pop(0))
    return TaskFlags(**given)


@pytest.mark.parametrize(("kind", "source"), [("map", "office"), ("world", "maze")])
def test_a_draft_is_the_task_of_its_command(kind, source, tmp_path):
    """What the page checks is what the shown command does."""
    view = view_of(kind, source)
    draft = TaskDraft.of(view, source)
    checked = check(draft, view, tmp_path)
    assert checked.problem == ""
    assert chosen_task(flags_of(draft.words())).sha256() == checked.task.sha256()
    assert checked.narrowest.width > 2.0 * (view.radius or BODY_RADIUS)


def metric_map(folder):
    """A map of 20 x 15 m with cells of 5 cm."""
    plan = np.full((300, 400), 255, np.uint8)
    plan[:8] = plan[-8:] = plan[:, :8] = plan[:, -8:] = 0
    cv2.imwrite(str(folder / "plan.png"), plan)
    (folder / "plan.yaml").write_text(
        "image: plan.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return view_of("map", str(folder / "plan.yaml"))


def test_robots_that_fit_are_offered(tmp_path):
    """Those in metres where metres are known, and e-pucks in worlds."""
    metric = metric_map(tmp_path)
    names = [robot.name for robot in metric.robots]
    burgers = ["turtlebot3-burger", "turtlebot3-burger-lds02"]
    assert names == ["create3-rplidar", "jackal", *burgers]
    world = view_of("world", "maze")
    assert [robot.name for robot in world.robots] == ["e-puck", "e-puck2"]
    assert view_of("map", "maze").robots == ()


def test_a_draft_with_a_robot_is_the_task_of_its_command(tmp_path, monkeypatch):
    """Its size is that of the robot; the slider's is kept for later."""
    monkeypatch.chdir(tmp_path)
    maps = TaskDraft("map", "plan.yaml", (60, 70), (340, 70), 0.0, 15.0)
    worlds = TaskDraft.of(view_of("world", "maze"), "maze")
    for draft, robot, view in (
        (maps, "turtlebot3-burger", metric_map(tmp_path)),
        (worlds, "e-puck2", view_of("world", "maze")),
    ):
        named = replace(draft, robot=robot)
        checked = check(named, view, tmp_path)
        assert checked.problem == ""
        words = named.words()
        assert words[words.index("--robot") :][:2] == ["--robot", robot]
        assert "--robot-radius" not in words
        assert chosen_task(flags_of(words)).sha256() == checked.task.sha256()
        assert replace(named, robot=None) == draft
    assert named.task_file().robot.file == "e-puck2"
    assert fitting_radius(named, checked) is None
    assert "&robot=e-puck2" in address_with(named)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map", "world"])
def test_clicks_lead_back_to_places(kind):
    for name in names_of(kind):
        view = view_of(kind, name)
        assert view.goal is not None
        ((x, y),) = view.at([view.goal]).tolist()
        assert 0 <= x <= view.width
        assert 0 <= y <= view.height
        assert view.place(x, y) == pytest.approx(view.goal)


def test_what_cannot_be_driven(tmp_path):
    view = view_of("map", "maze")
    draft = TaskDraft.of(view, "maze")
    wide = check(replace(draft, radius=30.0), view, tmp_path)
    assert wide.task is None
    assert "too near" in wide.problem
    assert wide.widest == pytest.approx(20.4, abs=0.2)
    assert check(replace(draft, radius=wide.widest - 0.5), view, tmp_path).task
    outside = check(replace(draft, goal=(5.0, 5.0)), view, tmp_path)
    assert "outside of the closed wall" in outside.problem


@pytest.mark.slow
@pytest.mark.parametrize("source", ["maze", "rooms", "street"])
def test_the_narrowest_passage_limits_the_robot(source, tmp_path):
    """On maps with one way, it and the widest robot that gets through agree."""
    view = view_of("map", source)
    checked = check(TaskDraft.of(view, source), view, tmp_path)
    narrowest = checked.narrowest
    assert narrowest.at == "path"
    assert math.dist(*narrowest.ends) == pytest.approx(narrowest.width, rel=1e-3)
    # Radii are tested from pixel to pixel, passages between walls.
    assert 0.0 <= narrowest.width / 2.0 - checked.widest < 1.0


def test_a_path_through_the_narrower_of_two_doors(tmp_path):
    """The passage is that of the path, though wider robots find another one."""
    plan = np.full((300, 400), 255, np.uint8)
    plan[:8] = plan[-8:] = plan[:, :8] = plan[:, -8:] = 0
    plan[:, 196:204] = 0
    plan[50:90, 190:210] = 255
    plan[170:250, 190:210] = 255
    cv2.imwrite(str(tmp_path / "plan.png"), plan)
    view = view_of("map", str(tmp_path / "plan.png"))
    draft = TaskDraft("map", "plan.png", (60.0, 70.0), (340.0, 70.0), 0.0, 15.0)
    narrow = check(draft, view, tmp_path)
    assert narrow.narrowest.width == pytest.approx(40.0, abs=0.1)
    assert sorted(y for _, y in narrow.narrowest.ends) == [49.5, 89.5]
    assert narrow.widest == pytest.approx(39.4, abs=0.6)
    assert "(bar) is 40 px wide; another path has room" in sentence_of(narrow, view)[0]
    wide = check(replace(draft, radius=25.0), view, tmp_path)
    assert wide.narrowest.width == pytest.approx(80.0, abs=0.1)
    assert "(bar) is 80 px wide: room for a radius of" in sentence_of(wide, view)[0]
    near = check(
        replace(draft, start=(25.0, 210.0), goal=(60.0, 210.0)), view, tmp_path
    )
    assert near.narrowest.at == "start"
    assert near.narrowest.width == pytest.approx(2 * 17.5, abs=0.1)
    assert "narrowest at the start, 17.5 px from a wall" in sentence_of(near, view)[0]


def test_a_passage_of_a_world(tmp_path):
    """The bundled corridor has passages of 0.2 m beside its boxes."""
    view = view_of("world", "corridor")
    checked = check(TaskDraft.of(view, "corridor"), view, tmp_path)
    assert checked.narrowest.width == pytest.approx(0.2, abs=1e-3)


def wait_for(job):
    end = time.monotonic() + SECONDS
    while job.running and time.monotonic() < end:
        time.sleep(0.05)
    assert not job.running


def test_a_job_is_found_again(tmp_path):
    job = start(tmp_path, ["runs", "."], "runs/x")
    assert job_of(tmp_path, "runs/x") == job
    assert job.command == "tdac runs ."
    wait_for(job)
    assert job.code == 0
    assert "no runs in ." in job.output()
    other = start(tmp_path, ["runs", "missing"], "runs/y")
    wait_for(other)
    assert other.code == 2
    assert [each.file.about for each in jobs(tmp_path)] == ["runs/y", "runs/x"]
    assert shlex.split(other.command)[0] == "tdac"
    # A damaged record hides no other one.
    (other.folder.with_name("99999")).mkdir()
    (other.folder.with_name("99999") / "job.json").write_text("{")
    assert [each.file.about for each in jobs(tmp_path)] == ["runs/y", "runs/x"]


@pytest.mark.slow
def test_a_command_at_work_is_not_started_twice(tmp_path):
    """As by a double click; and its folder is given to no other one."""
    job = start(tmp_path, ["runs", "."], free_folder("demo", tmp_path))
    assert job.file.about == "runs/demo-1"
    assert start(tmp_path, ["runs", "."], "runs/demo-1") == job
    assert start(tmp_path, ["--version"], "runs/demo-1") != job
    assert free_folder("demo", tmp_path) == "runs/demo-2"
    for each in jobs(tmp_path):
        wait_for(each)
    again = start(tmp_path, ["runs", "."], "runs/demo-1")
    assert again != job  # that one has ended
    wait_for(again)


def test_files_of_one_name_are_told_apart():
    """Two entrants of a bench cannot have the same name."""
    files = ["runs/a/controller.py", "x/runs/a/controller.py", "mine.py", "x/mine.py"]
    words = named_entrants(["builtin", *files, "policies/ppo/policy.zip"])
    assert words == [
        "builtin",
        "a=runs/a/controller.py",
        "a-2=x/runs/a/controller.py",
        "mine.py",
        "mine.py-2=x/mine.py",
        "ppo=policies/ppo/policy.zip",
    ]


def test_a_bench_tells_how_far_it_is(tmp_path):
    words = ("bench", "builtin", "dwa", "--set", "known,lost", "-n", "10")
    facts = {"words": words, "started": datetime.now(UTC), "born": "", "about": "b"}
    job = StudioJob(tmp_path, JobFile(**facts, pid=2), ours=True)
    assert progress_of(job, tmp_path)[0] == 0.0
    for name, file in (
        ("known/a", "episodes.json"),
        ("known/b", "unfinished/episodes.jsonl"),
    ):
        path = tmp_path / "driven" / name / file
        path.parent.mkdir(parents=True)
        path.write_text("{}\n" * 5)
    share, text = progress_of(job, tmp_path)
    assert share == pytest.approx(1.5 / 4)
    assert text == "15 of 40 episodes driven"


def packed(**files):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in files.items():
            archive.writestr(name.replace("__", "/"), content)
    return stream.getvalue()


def test_a_run_folder_is_unpacked(tmp_path):
    data = packed(**{"maze-1/run.json": "{}", "maze-1/iterations/x.md": "text"})
    folder = unpack(data, "maze 1", tmp_path)
    assert folder.name == "maze-1"
    assert json.loads((folder / "run.json").read_text()) == {}
    assert (folder / "iterations" / "x.md").read_text() == "text"
    assert unpack(data, "maze 1", tmp_path).name == "maze-1-2"


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"a.txt": "x"}, "has no run.json"),
        ({"run.json": "{}", "../out.txt": "x"}, "leads out of"),
        ({"run.json": "{}", "/etc/x": "x"}, "leads out of"),
    ],
)
def test_what_is_not_unpacked(tmp_path, files, message):
    with pytest.raises(ValueError, match=message):
        unpack(packed(**files), "run", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_run_from_elsewhere_is_marked():
    """Such as the recorded run that `tdac demo` replays."""
    folder = Path(tdac_agent.__file__).parent / "runs" / "demo"
    assert load_run(folder).status == "verified"
    assert "did not begin" in from_elsewhere(load_run(folder))


def test_a_run_from_elsewhere_always_asks(tmp_path):
    """Also one that wants nothing special; the limit that it suggests is named."""
    plain = load_run(RULES).model_copy(
        update={"learner": "builtin", "optimizer": "builtin", "seed": None}
        | {"folder": tmp_path}
    )
    assert asked_by(plain) == []
    more = plain.model_copy(update={"enough": Enough(max_cost=0.7)})
    assert asked_by(more) == ["use up to 0.7 USD in all"]
    ours = more.model_copy(update={"mark": sign(more, None)})
    assert asked_by(ours) is None


def test_keys_drive(tmp_path):
    """Up drives ahead; left turns to the left, as a person sees it."""
    drive = KeyboardDrive.of("unknown", "dev", 0)
    env = drive._env
    drive.press("ArrowUp", True)
    assert drive.action() == (1.0, 1.0)
    drive.press("ArrowLeft", True)
    left, right = drive.action()
    assert right > left > 0
    drive.press("ArrowUp", False)
    left, right = drive.action()
    assert right > 0 > left
    before = env.pose()[2]
    frame = drive.step()
    assert frame.ndim == 3
    # y points down: a turn to the left is negative.
    assert -1.0 < math.remainder(env.pose()[2] - before, math.tau) < 0.0
    assert drive.status == f"{drive.dt:.1f} s"


def test_a_controller_is_downloaded_with_what_it_reads(tmp_path):
    """A file alone could not be imported: it reads its map."""
    folder = tmp_path / "run"
    shutil.copytree(DEMO, folder)
    for name in ("controller.py", "sensors.py", "params.json", "report.json"):
        (folder / name).write_text(name)
    with zipfile.ZipFile(io.BytesIO(deployable(folder))) as packed:
        names = "controller.py params.json sensors.py"
        assert sorted(packed.namelist()) == names.split()
        assert packed.read("sensors.py") == b"sensors.py"


@pytest.mark.parametrize(
    ("widest", "radius", "fits"),
    [(24.3, 38.0, 24.0), (24.3, 20.0, None), (None, 38.0, None), (0.4, 3.0, None)],
)
def test_a_radius_that_gets_through(widest, radius, fits):
    """A step of the slider below the widest one, if a smaller radius helps."""
    draft = TaskDraft.of(view_of("map", "maze", None), "maze", None)
    checked = Checked(None, widest=widest)
    assert fitting_radius(replace(draft, radius=radius), checked) == fits


def test_a_run_tells_what_became_of_a_given_controller(tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(DEMO, folder)
    assert initial_controller_text(load_run(folder)) == ""  # it began with no file
    run = change_run(folder, given_sha256="0" * 64, optimizer="builtin")
    failed = len(run.attempts[0].failed_tests)
    text = initial_controller_text(load_run(folder))
    begin = (
        f"Your controller failed {failed} tests: see iteration 1 below. The controller"
    )
    assert text.startswith(begin)
    assert text.endswith("is another one, by the built-in template.")


def test_what_a_question_asks_for(tmp_path):
    """By the name under which the run keeps it."""
    kept = tmp_path / "iterations" / "k01" / "j1" / "edit.prompt.md"
    kept.parent.mkdir(parents=True)
    kept.write_text("Repair it.")
    assert asked_for(tmp_path, "Repair it.") == KINDS["edit"]
    assert asked_for(tmp_path, "Repair it. Please.") == "an answer"


def test_what_differs_between_two_runs(tmp_path):
    """Figures, settings of the loop and of the task, and lines of the controllers."""
    one, other = tmp_path / "one", tmp_path / "other"
    for folder, radius in ((one, 15.0), (other, 19.0)):
        shutil.copytree(DEMO, folder)
        (folder / "task.yaml").write_text(f"name: maze\nrobot: {{radius: {radius}}}\n")
        (folder / "controller.py").write_text(f"import math\n\nRADIUS = {radius}\n")
    run = load_run(other)
    change_run(other, patience=run.patience + 1, seconds=1e4)

    def differing(values_of):
        lines = lines_of(values_of(one), values_of(other))
        return {name: (one, other) for name, one, other in lines if one != other}

    assert differing(figures_of) == {"time": (f"{run.seconds:.1f} s", "10000.0 s")}
    repairs = str(run.patience), str(run.patience + 1)
    radii = "15.0", "19.0"
    assert differing(settings_of) == {
        "maximum repairs per iteration": repairs,
        "task: robot: radius": radii,
    }
    lines = difference(one, other).splitlines()
    assert lines[3:] == [" import math", " ", "-RADIUS = 15.0", "+RADIUS = 19.0"]
    assert difference(one, one) == ""
    (other / "controller.py").unlink()
    assert difference(one, other) is None


def test_the_last_step_of_a_run_is_in_words():
    """Not the end of a long line, which says nothing alone."""
    output = (
        "task plan: shortest path 920 px, body radius 30 px, at most\n2500 steps\n"
        "✘ k=12 j=0  8 failed: test_progress\n"
        "  k=12 j=3  test_end_to_end.py::test_progress -> lookahead 120 -> 60\n"
        "note: the file\ngives no resolution\n"
    )
    said = "iteration 12, repair 3: test_progress -> lookahead 120 -> 60"
    assert last_step(output) == said
    passed = last_step("✔ k=1 j=0  all tests passed\n")
    assert passed == "✔ iteration 1: all tests passed"
    assert last_step("error: k=1 is too small\n") == ""
    compiling = "compiling the environment, 3 of 17 (cached for later runs)"
    assert last_step(f"{output}tdac: {compiling}\n") == compiling


def test_a_run_on_a_set_tells_how_far_it_is(tmp_path):
    """Episodes of the limit alone: those of a comparison at the end are others."""
    assert episodes_driven(load_run(DEMO)) == ""  # it is on one task
    folder = tmp_path / "run"
    shutil.copytree(DEMO, folder)
    change_run(folder, episodes=40, improve=8)
    for what, driven in (("feedback", 8), ("validation", 5), ("comparison", 30)):
        record = {"event": "drive.end", "what": what, "driven": driven}
        append_record(folder / "journal.jsonl", record)
    for name in ("feedback-2", "comparison-1"):
        rows = folder / "iterations/k01/j0" / name / "unfinished/episodes.jsonl"
        rows.parent.mkdir(parents=True)
        rows.write_text("{}\n" * 3)
    assert episodes_driven(load_run(folder)) == "16 of at most 48 episodes driven"
