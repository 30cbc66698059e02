"""The command line: exit codes, one clear line for each mistake, clean JSON."""

import dataclasses
import json
import os
import re
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import typer
from small import SHORT, small_cells, write_small_task

from tdac_agent import load_task
from tdac_agent.cli.main import PARTS, command_line
from tdac_agent.cli.task_changes import changed_task
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, TaskFlags
from tdac_agent.runs.resume import resume_arguments
from tdac_agent.tasks.task import lay_out
from tdac_envs.mapping.bundled import bundled_map

COMMANDS = [
    "map", "world", "synth", "verify", "play", "evaluate", "train", "check-suite",
    "demo", "rules", "report", "runs", "webots run", "export webots", "doctor",
    "export ros2", "ros sim", "ros drive", "falsify",
]  # fmt: skip
ENDS = ["--start", "30", "30", "--goal", "130", "30", "--robot-radius", "6"]


@pytest.fixture
def image(tmp_path):
    """The small map as an image file."""
    path = tmp_path / "plan.png"
    cv2.imwrite(str(path), np.where(small_cells(), 0, 255).astype(np.uint8))
    return path


def black_png(width, height):
    """A 1-bit PNG, small as a file whatever its size."""

    def chunk(kind, body):
        tail = struct.pack(">I", zlib.crc32(kind + body))
        return struct.pack(">I", len(body)) + kind + body + tail

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0))
    rows = zlib.compress(bytes(height * (1 + (width + 7) // 8)))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_has_an_example(done, command):
    """`--help` of each command shows how it is called."""
    out = done(*command.split(), "--help")
    assert re.search(rf"Examples?: .*tdac {command}", re.sub(r"\s+", " ", out))


def test_help_and_version(done):
    """Without a command the help; `--version` in one line."""
    out = done("--help")
    assert all(command.split()[0] in out for command in COMMANDS)
    out = done("--version")
    assert re.fullmatch(r"tdac \d+\.\d+\.\d+\n", out)


def test_a_command_reads_no_flags_of_another():
    """Its own part of the command line alone is built; any other word gets them all."""
    for own in PARTS.values():
        for word in own:
            assert set(typer.main.get_command(command_line([word])).commands) == {*own}
    for words in ([], ["--help"], ["verfy"]):
        assert len(command_line(words).registered_groups) == len(PARTS)


def test_the_list_of_commands_is_made_without_their_flags():
    """Names and helps are those of the commands themselves, in groups as well."""

    def listed(group):
        if not hasattr(group, "commands"):
            return group.help
        return {name: listed(command) for name, command in group.commands.items()}

    bare, whole = (typer.main.get_command(command_line([w])) for w in ("-h", "verfy"))
    assert listed(bare) == listed(whole)
    assert list(bare.commands) == list(whole.commands)
    assert [p.name for p in bare.commands["verify"].params] == []


def test_a_task_is_named_by_the_same_flags_everywhere():
    """All commands on one task have them in one order; `synth` two more, for models."""
    names = [field.name for field in dataclasses.fields(TaskFlags)]
    shared = [each for each in names if each not in {*ONLY_FOR_SYNTH, "file"}]
    for command in ("synth", "verify", "play", "mcp"):
        group = typer.main.get_command(command_line([command]))
        flags = [parameter.name for parameter in group.commands[command].params]
        assert [each for each in flags if each in shared] == shared
        extra = [each for each in flags if each in ONLY_FOR_SYNTH]
        assert extra == ([*ONLY_FOR_SYNTH] if command == "synth" else [])


def test_ctrl_c_while_the_command_line_is_loaded_is_one_line(tmp_path):
    """There is no traceback, however early it comes."""
    interrupts = "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n"
    (tmp_path / "typer.py").write_text(interrupts)
    process = subprocess.run(
        [sys.executable, "-m", "tdac_agent", "--version"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{os.getcwd()}"},
    )
    assert (process.returncode, process.stderr) == (130, "interrupted\n")


def test_the_help_is_quick():
    """It imports nothing that only the commands need."""
    code = (
        "import sys; sys.argv = ['tdac', '--help']\n"
        "from tdac_agent.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'cv2', 'numba', 'scipy', 'gymnasium', 'pydantic', 'pytest',"
        " 'pandas', 'matplotlib', 'anthropic', 'openai', 'torch', 'pygame', 'yaml'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert process.stdout.splitlines()[-1] == "HEAVY []"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("synth --k 3", "No such option: --k; did you mean -K?; see tdac synth --help"),
        ("synth -k 3", "did you mean -K?; see tdac synth --help"),
        ("synth --max-iterations 3", "did you mean --iterations?"),
        ("synth --Learner builtin", "did you mean --learner?"),
        ("synth --xyzzy", "No such option: --xyzzy; see tdac synth --help"),
        ("webots run", "see tdac webots run --help"),
        ("map x.png --start 1 2 0.5 4", "unexpected extra argument(s) (4)"),
        ("map x.png --goal 1,2 4", "unexpected extra argument(s) (4)"),
        ("map x.png --heading 0.5", "--heading needs --start X Y"),
        ("synth --start 330 --goal 99 100", "--start 330: expected two numbers X Y"),
        ("syth", "No such command 'syth'"),
        ("verify", "Missing argument 'CONTROLLER'; see tdac verify --help"),
    ],
)
def test_words_that_are_not_understood(refused, words, expected):
    """The option that may be meant, and the help of the command it was typed for."""
    err = refused(*words.split())
    assert err.startswith("error: ")
    assert expected in err
    assert err.count("\n") == 1


def is_one_clear_line(code, out, err, place, *left):
    """Exit 2, nothing on stdout, one line on stderr, nothing written but `left`."""
    assert code == 2, err
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    assert "/tmp/tdac" not in err
    assert [path.name for path in Path(place).iterdir()] == [*left]
    return True


# A file's content, made by a function of its path, and what the message says.
IMAGES = {
    "missing": (lambda path: None, "no such file"),
    "not an image": (lambda path: path.write_text("hello"), "image"),
    "a folder": (lambda path: path.mkdir(), ""),
    "empty": (lambda path: path.write_bytes(b""), ""),
    "1 x 1": (lambda path: cv2.imwrite(str(path), np.zeros((1, 1), np.uint8)), "1 x 1"),
    "all black": (
        lambda path: cv2.imwrite(str(path), np.zeros((120, 160), np.uint8)),
        "",
    ),
    "100 megapixels": (
        lambda path: path.write_bytes(black_png(10_000, 10_000)),
        "10000 x 10000",
    ),
}


@pytest.mark.parametrize("name", IMAGES)
@pytest.mark.parametrize("command", ["map", "synth"])
def test_images_that_cannot_be_used(tdac, tmp_path, command, name):
    """Each is refused with its reason."""
    path = tmp_path / "bad.png"
    make, reason = IMAGES[name]
    make(path)
    words = ["map", path] if command == "map" else ["synth", "--map", path]
    code, out, err = tdac(*words, *ENDS)
    assert is_one_clear_line(code, out, err, Path.cwd())
    assert reason in err


# Flags after `--map plan.png`, and what the message says.
PLACES = {
    "start outside": (["--start", 900, 30, "--goal", 130, 30], r"start \(900, 30\)"),
    "start in a wall": (["--start", 73, 30, "--goal", 130, 30], r"start \(73, 30\)"),
    "start near a wall": (["--start", 65, 30, "--goal", 130, 30], r"start \(65, 30\)"),
    "goal in a wall": (["--start", 30, 30, "--goal", 73, 30], r"goal \(73, 30\)"),
    "start at the goal": (
        ["--start", 30, 30, "--goal", 30, 30],
        "same pixel|already at the goal",
    ),
    "start without goal": (["--start", 30, 30], "--goal"),
    "goal without start": (["--goal", 30, 30], "--start"),
    "neither": ([], "--start X Y and --goal X Y"),
    "not a number": (["--start", "nan", 30, "--goal", 130, 30], "start"),
    "infinite": (["--start", 30, 30, "--goal", "inf", 30], "goal"),
    "metres": (["--metres", *ENDS], "resolution"),
    "word for a number": (["--start", "a", 30], "--start a 30: expected two num"),
    "huge body": (
        ["--start", 30, 30, "--goal", 130, 30, "--robot-radius", 60],
        "60 px",
    ),
    "too wide a body": (
        ["--start", 30, 40, "--goal", 120, 40, "--robot-radius", 25],
        "body of 25 px",
    ),
    "heading": ([*ENDS, "--heading", "nan"], "nan"),
    "radius": ([*ENDS[:6], "--robot-radius", "nan"], "radius"),
    "robot image": ([*ENDS, "--robot-image", "no.png"], "no robot image 'no.png'"),
    "bad robot image": ([*ENDS, "--robot-image", __file__], "robot image"),
    "unknown learner": ([*ENDS, "--learner", "gpt"], "unknown model 'gpt'"),
    "unknown optimizer": ([*ENDS, "--optimizer", "gpt"], "unknown model 'gpt'"),
    "from a missing file": ([*ENDS, "--from", "no.py"], "'no.py'"),
    "no iterations": ([*ENDS, "-K", 0], "-K"),
    "two tasks": ([*ENDS, "--task", "maze"], "--task already defines the task"),
}


# These leave a picture.
PICTURED = {
    *("start outside", "start in a wall", "start near a wall", "goal in a wall"),
    *("huge body", "too wide a body"),
}


@pytest.mark.parametrize("name", PLACES)
def test_tasks_that_cannot_be_used(tdac, image, name):
    """Each is refused with its reason and the values that are wrong."""
    words, reason = PLACES[name]
    if name == "too wide a body":
        reason = "25 px"
    radius = [] if "--robot-radius" in words else ["--robot-radius", 6]
    code, out, err = tdac("synth", "--map", image, *radius, *words)
    left = ["plan-map"] if name in PICTURED else []
    assert is_one_clear_line(code, out, err, Path.cwd(), *left)
    assert re.search(reason, err), err
    if left:
        assert re.search(r"^error: plan\.png: .*; look at plan-map/refused\.png$", err)
        assert Path("plan-map/refused.png").is_file()


def test_an_unreachable_goal(tdac, image):
    """A closed wall is named as what it is."""
    cells = small_cells()
    cells[:, 70:76] = True
    cv2.imwrite(str(image), np.where(cells, 0, 255).astype(np.uint8))
    code, out, err = tdac("synth", "--map", image, *ENDS)
    assert is_one_clear_line(code, out, err, Path.cwd(), "plan-map")
    assert re.search("path|room|connect|reach", err), err


@pytest.mark.parametrize(
    "words",
    [
        ["map", "IMAGE", "--start", "nan", "30", "--goal", "130", "30"],
        ["map", "IMAGE", "--start", "30", "30"],
        ["map", "IMAGE", "--metres", *ENDS],
        ["map", "IMAGE", "--out", "FILE/x", *ENDS],
        ["synth", "--map", "IMAGE", "--out", "FILE/x", *ENDS],
        ["synth", "--map", "IMAGE", "--out", "FULL", *ENDS],
        ["synth", "--task", "nosuch"],
        ["synth", "--map", "nosuch"],
        ["synth", "--task", "FILE"],
        ["verify", "no.py"],
        ["verify", "FULL"],
        ["verify", "FILE", "--task", "nosuch"],
        ["verify", "FILE", "--task", "maze", "--suite", "no"],
        ["verify", "FILE", "--task", "maze", "--profile", "x"],
        ["play", "FILE", "--task", "maze", "--video", "a.avi"],
        ["play", "FILE", "--task", "maze", "--video", "a"],
        ["play", "no.py", "--video", "a.mp4"],
        ["play", "FILE", "--video", "a.mp4", "--tier", "nosuch"],
        ["verify", "FILE", "--tier", "nosuch"],
        ["check-suite", "--tier", "nosuch"],
        ["check-suite", "--task", "nosuch"],
        ["check-suite", "--suite", "no"],
        ["check-suite", "--repeats", "0"],
        ["play", "FILE", "--task", "maze"],
        ["nosuch"],
        ["verify"],
        ["synth", "--nosuch"],
    ],
    ids=" ".join,
)
def test_wrong_words(tdac, image, tmp_path, monkeypatch, words):
    """Files, folders, names and flags that cannot be used."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    file, full = tmp_path / "file.py", tmp_path / "full"
    file.write_text("x = 1\n")
    full.mkdir()
    (full / "mine.txt").write_text("keep")
    names = {"IMAGE": image, "FILE": file, "FILE/x": file / "x", "FULL": full}
    code, out, err = tdac(*[names.get(word, word) for word in words])
    assert is_one_clear_line(code, out, err, Path.cwd())
    assert [path.name for path in full.iterdir()] == ["mine.txt"]
    assert file.read_text() == "x = 1\n"


YAML = {
    "broken": "map: [",
    "no mapping": "- 1\n- 2\n",
    "unknown key": "map: map.npy\nspeed: 3\n",
    "unknown key in robot": "map: map.npy\nrobot: {size: 3}\n",
    "wrong type": "map: map.npy\nstart: here\n",
    "one number": "map: map.npy\nstart: [1]\n",
    "negative radius": "map: map.npy\nrobot: {radius: -1}\n",
    "not a number": "map: map.npy\nstart: [.nan, 1]\n",
    "another schema": "schema: 2\nmap: map.npy\n",
    "another environment": "env: TDAC-Map3D-v0\n",
    "no map": "map: other.png\nstart: [1, 1]\ngoal: [2, 2]\n",
    "robot image": (
        "map: map.npy\nstart: [30, 30]\ngoal: [130, 30]\n"
        "robot: {radius: 6, image: no.png}\n"
    ),
    "binary": "\x00\x01",
}


@pytest.mark.parametrize("name", YAML)
def test_task_files_that_cannot_be_used(tdac, good, name):
    """The message names the file, and the key where there is one."""
    (good / "task.yaml").write_text(YAML[name])
    code, out, err = tdac("verify", good)
    assert is_one_clear_line(code, out, err, Path.cwd())
    if "unknown key" in name:
        assert "speed" in err or "robot.size" in err
        assert "not" in err


@pytest.mark.slow
def test_verify_says_yes_and_no(rejected, done, good):
    """Exit 0 for a controller that passes, 1 for another; a table for people."""
    out = done("verify", good, "--profile", "policy", "--paper")
    assert "passed: 16 of 16 tests passed" in out
    (good / "controller.py").write_text("def policy(obs):\n    return 1, 1\n")
    out = rejected("verify", good / "controller.py", "--profile", "policy")
    assert "failed: " in out
    assert "collision in step" in out


def test_verify_as_json_and_junit(rejected, good, tmp_path):
    """JSON is all that stdout holds; the JUnit file has a case for each test."""
    (good / "controller.py").write_text("def policy(obs):\n    return '\\x00<&'\n")
    junit = tmp_path / "junit.xml"
    out = rejected(
        "verify", good, "--profile", "policy", "--paper", "--json", "--junit", junit
    )
    report = json.loads(out)
    assert report["verdict"]["passed"] is False
    root = ElementTree.fromstring(junit.read_bytes())
    assert root.tag == "testsuite"
    assert int(root.get("tests")) == report["verdict"]["expected"] == len(root)
    assert int(root.get("failures")) == len(root.findall("testcase/failure"))


def test_a_junit_file_that_cannot_be_written(refused, good):
    """One clear line."""
    bad = good / "controller.py" / "x.xml"
    err = refused("verify", good, "--profile", "policy", "--junit", bad)
    assert err.splitlines()[-1].startswith("error: cannot write")


def test_a_verification_that_ends_early_leaves_no_folder(tdac, good, tmp_path):
    """Where it cannot write is told before anything is run."""
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "test_mine.py").write_text("import nosuchmodule\n")
    flags = ("--profile", "policy", "--suite", tmp_path / "broken")
    code, _, _ = tdac("verify", good, *flags, "--out", tmp_path / "kept")
    assert (code, (tmp_path / "kept").exists()) == (3, False)
    bad = good / "controller.py" / "kept"
    code, out, err = tdac("verify", good, "--profile", "policy", "--out", bad)
    assert is_one_clear_line(code, out, err, Path.cwd())
    assert err.startswith("error: cannot write to")


def test_a_broken_suite_is_exit_3(tdac, good, tmp_path):
    """Neither yes nor no."""
    (tmp_path / "test_mine.py").write_text("import nosuchmodule\n")
    code, _, err = tdac("verify", good, "--profile", "policy", "--suite", tmp_path)
    assert code == 3
    assert err.splitlines()[-1].startswith("infrastructure fault: the suite is broken")


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("command", ["verify", "check-suite"])
def test_a_misspelt_fixture_is_a_fault_of_the_suite(tdac, good, tmp_path, command):
    """It says nothing about the controller; the line and the nearest name are told."""
    text = "\n\ndef test_mine(rolout):\n    assert rolout().reached, 'not reached'\n"
    (tmp_path / "test_mine.py").write_text(text)
    words = [good, "--paper"] if command == "verify" else ["--task", good]
    flags = ("--profile", "policy", "--suite", tmp_path)
    code, out, err = tdac(command, *words, *flags)
    assert (code, out) == (3, "")
    assert err.splitlines()[-1] == (
        "infrastructure fault: the suite is broken: own/test_mine.py:3: test_mine "
        "needs the fixture 'rolout', which does not exist (did you mean 'rollout'?)"
    )


@pytest.mark.slow
def test_check_suite_says_yes(done, tmp_path):
    """Exit 0 and a table of the controllers."""
    folder = write_small_task(tmp_path / "short", profile="policy", **SHORT)
    out = done("check-suite", "--task", folder, "--repeats", 1)
    for name in ("reference", "do-nothing", "constant", "random", "raising", "slow"):
        assert name in out
    assert re.search(r"proven: map2d on small \(map .*\), profile policy, seed \d", out)


@pytest.mark.slow
def test_check_suite_says_no(rejected, tmp_path):
    """Exit 1; with --json the record alone on stdout."""
    folder = write_small_task(tmp_path / "short", profile="policy", **SHORT)
    (tmp_path / "test_mine.py").write_text("def test_no():\n    assert 0, 'never'\n")
    words = ["check-suite", "--task", folder, "--suite", tmp_path, "--repeats", 1]
    out = rejected(*words, "--json")
    record = json.loads(out)
    assert record["proven"] is False
    told = "the reference fails own/test_mine.py::test_no: never"
    assert record["problems"] == [told]
    assert record["rows"][0]["controller"] == "reference"


@pytest.mark.slow
def test_check_suite_of_a_broken_suite(tdac, good, tmp_path):
    """Exit 3: neither yes nor no."""
    (tmp_path / "test_mine.py").write_text("import nosuchmodule\n")
    code, _, err = tdac("check-suite", "--task", good, "--suite", tmp_path)
    assert code == 3
    assert err.splitlines()[-1].startswith("infrastructure fault: the suite is broken")


@pytest.mark.slow
def test_synth_writes_a_run(done, good):
    """Exit 0, a run folder; with --json the record alone on stdout."""
    (good / "controller.py").unlink()
    out = done("synth", "--task", good, "--out", "a", "--json")
    run = json.loads(out)
    assert run["status"] == "verified"
    assert Path("a/controller.py").is_file()


@pytest.mark.slow
def test_synth_keeps_the_profile_and_takes_a_tier(tdac, done, good):
    """The profile is part of the run and of its task; a run asks for no tier."""
    (good / "controller.py").unlink()
    words = ["synth", "--task", good, "--out", "a", "--profile", "policy"]
    out = done(*words, "--json", "--tier", "rlimits")
    assert json.loads(out)["profile"] == "policy"
    about = json.loads(Path("a/report.json").read_text())["provenance"]
    assert (about["profile"], about["sandbox"]) == ("policy", "rlimits")
    arguments = resume_arguments(Path("a"))
    assert arguments["problem"].profile == "policy"
    assert "tier" not in arguments
    code, _, errors = tdac(*words[:-2])
    assert (code, "profile policy instead of paper" in errors) == (2, True)
    code, _, errors = tdac("synth", "--resume", "a", "--profile", "paper")
    assert (code, "leave out --profile" in errors) == (2, True)
    code, _, errors = tdac("synth", "--resume", "a", "--tier", "strong")
    assert (code, "unknown sandbox tier 'strong'" in errors) == (2, True)


def test_usage_names_arguments_without_braces(tdac):
    """`POLICY...` is one or more, `[DIR]` may be left out."""
    assert "tdac evaluate [OPTIONS] POLICY..." in tdac("evaluate", "--help")[1]
    assert "tdac runs [OPTIONS] [DIR]" in tdac("runs", "--help")[1]
    text = tdac("webots", "run", "--help")[1]
    assert "tdac webots run [OPTIONS] CONTROLLER WORLD" in text
    assert "px" not in text


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("command", "target"),
    [
        (["verify", "--paper"], "."),
        (["play", "--video", "a.gif"], "controller.py"),
        (["verify", "--paper"], "controller.py"),
        (["play", "--video", "a.gif"], "."),
    ],
)
def test_flags_change_the_task_of_a_folder(rejected, good, command, target):
    """The note says that the verdict is not the folder's own."""
    (good / "controller.py").write_text("def policy(obs):\n    return 0.0, 0.0\n")
    words = (*command, good / target, "--start", "60", "35", "--robot-radius", "4")
    out = rejected(*words)
    assert out.startswith(
        "judged as another task: start 60 35, robot-radius 4; this is not the verdict "
        f"of {good}\n"
    )


def changed(folder, **flags):
    """The task of a folder with these flags."""
    return changed_task(load_task(folder), TaskFlags(**flags))


def test_what_follows_from_start_and_goal_is_not_kept(good, tmp_path):
    """The task file of a run has a horizon, which a longer way must not exceed."""
    file, fixing = good / "task.yaml", "horizon: 400\n"
    text = file.read_text()
    file.write_text(text.replace(fixing, ""))
    run = lay_out(load_task(good), tmp_path / "run")
    fixed = load_task(run)
    nearer = changed(run, goal=(100.0, 30.0), max_speed=0.5, rays=5)
    assert nearer.nominal.horizon > 2 * fixed.nominal.horizon
    assert nearer.nominal.robot.n_rays == 5
    assert nearer.nominal.robot.radius == fixed.nominal.robot.radius
    assert changed(run, tolerance=3.5).nominal.goal_tolerance == 3.5
    wider = changed(run, robot_radius=7.0).nominal.robot
    assert (wider.radius, wider.axle_length) == (7.0, 14.0)
    turned = changed(run, heading=0.5).nominal.start
    assert turned == (*fixed.nominal.start[:2], 0.5)
    assert changed(run).sha256() == fixed.sha256()
    file.write_text(text)
    assert changed(good, goal=(100.0, 30.0)).nominal.horizon == 400


def test_changes_keep_whose_tests_may_run(good):
    """A suite from elsewhere is not trusted because a flag changes the start."""
    (good / "mine").mkdir()
    (good / "mine" / "test_mine.py").write_text("def test_mine():\n    pass\n")
    (good / "task.yaml").write_text((good / "task.yaml").read_text() + "suite: mine\n")
    before, after = load_task(good), changed(good, goal=(100.0, 30.0))
    assert not before.trusted
    assert (after.trusted, after.suite, after.name) == (
        False,
        before.suite,
        before.name,
    )


def test_a_run_that_is_not_there(refused):
    """The nearest one is named."""
    Path("runs/maze-1").mkdir(parents=True)
    err = refused("play", "runs/nothing", "--video", "a.gif")
    assert err == (
        "error: there is no run or controller 'runs/nothing'; the nearest is "
        "runs/maze-1\n"
    )


@pytest.mark.slow
def test_synth_says_no(rejected, tmp_path):
    """Exit 1 where nothing was verified in K iterations."""
    folder = write_small_task(tmp_path / "task", profile="policy")
    (folder / "mine").mkdir()
    (folder / "mine" / "test_no.py").write_text("def test_no():\n    assert 0, 'no'\n")
    suite = ("--suite", folder / "mine")
    out = rejected("synth", "--task", folder, *suite, "-K", 1, "-J", 0)
    assert "not verified after 1 iteration;" in out
    assert Path("runs/small-1/run.json").is_file()


def test_map_prints_json(done, image):
    """The parameters, all candidates and the files that were written."""
    out = done("map", image, *ENDS, "--json")
    record = json.loads(out)
    assert record["params"]["start"] == [30, 30]
    assert all(Path(file).is_file() for file in record["files"])


def test_a_bundled_map_brings_its_own_heading(done):
    """As the environment of its name has it."""
    out = done("map", "maze", "--json")
    heading = bundled_map("maze").heading
    assert heading != 0.0
    assert json.loads(out)["params"]["heading"] == heading


def test_map_without_places(done, image):
    """A preview with rulers, and what to do next."""
    out = done("map", image)
    assert "then give --start X Y --goal X Y" in out
    assert Path("plan-map/preview.png").is_file()


def test_map_says_its_reading_once(done, image):
    """With a task and without: how the picture was read, and where the files are."""
    for ends in (ENDS, []):
        out = done("map", image, *ends)
        assert out.count("obstacles are dark pixels") == 1
        assert " ".join(out.split()).count("look at plan-map/preview.png") == 1


@pytest.fixture
def chessboard(tmp_path):
    """A picture that may be meant either way."""
    odd = (np.indices((320, 320)) // 40).sum(axis=0) % 2
    path = tmp_path / "board.png"
    cv2.imwrite(str(path), np.where(odd, 30, 230).astype(np.uint8))
    return path


@pytest.mark.parametrize("command", ["map", "synth"])
def test_a_close_call_shows_both_readings(refused, chessboard, command):
    """Exit 2 with one line that names them, the flag that settles it, the previews."""
    where = [chessboard] if command == "map" else ["--map", chessboard]
    ends = ["--start", 20, 20, "--goal", 60, 20, "--robot-radius", 5]
    err = refused(command, *where, *ends)
    (line,) = err.splitlines()
    assert "dark obstacles leave" in line
    assert "light obstacles leave" in line
    assert "--polarity dark or --polarity light" in line
    for polarity in ("dark", "light"):
        assert f"preview-{polarity}.png" in line
        assert Path(f"board-map/preview-{polarity}.png").is_file()


def test_polarity_and_threshold_are_flags_and_keys(
    done, refused, image, chessboard, tmp_path
):
    """What was said is in the parameters; a task file says it, too."""
    out = done("map", chessboard, "--polarity", "light", "--json")
    assert json.loads(out)["params"]["polarity"] == "light"
    out = done("map", image, *ENDS, "--threshold", 100, "--json")
    assert json.loads(out)["params"]["threshold"] == 100
    task = f"map: {image}\nstart: [30, 30]\ngoal: [130, 30]\nrobot: {{radius: 6}}\n"
    (tmp_path / "task.yaml").write_text(f"{task}polarity: light\n")
    err = refused("synth", "--task", tmp_path / "task.yaml", "--dry-run")
    assert "lies in an obstacle" in err


@pytest.mark.parametrize("suffix", ["mp4", "gif"])
def test_play_writes_a_film(done, good, suffix):
    """Exit 0 where the goal was reached; the speed of the film is told."""
    out = done("play", good, "--video", f"a.{suffix}", "--speed", "20")
    assert f"wrote a.{suffix} (at 20 times real time, " in out
    assert "reached after" in out
    assert Path(f"a.{suffix}").stat().st_size > 1000


def test_play_shows_what_the_controller_printed(rejected, good):
    """Its lines, without control sequences; what repeats is counted."""
    file = good / "controller.py"
    text = "def policy(obs):\n    print('\\x1b[31mhello')\n    return 0.0, 0.0\n"
    file.write_text(f"print('once')\n{text}")
    out = rejected("play", good, "--video", "a.gif", "--speed", "100")
    lines = out.splitlines()
    at = lines.index("the controller printed")
    assert lines[at + 1] == "once"
    assert re.fullmatch(r"hello  \(×\d+\)", lines[at + 2])
    assert "\x1b" not in out


def test_play_says_what_went_wrong(rejected, good):
    """Exit 1 and the reason where the controller fails."""
    (good / "controller.py").write_text("import nosuchmodule\n")
    out = rejected("play", good, "--video", "a.gif")
    assert "ModuleNotFoundError at import" in out
