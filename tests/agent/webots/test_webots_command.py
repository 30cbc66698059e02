"""`tdac webots run`: exit codes, JSON, a film, one clear line for each mistake."""

import json
from pathlib import Path

import cv2
import pytest
from worlds_for_controllers import BLOCKED, NO_GOAL, OPEN, epuck

from tdac_agent.sandbox import TIERS, available_tiers

CONTROLLERS = Path(__file__).parent / "controllers"


@pytest.fixture
def there(tmp_path):
    """A folder with worlds."""
    for name, text in {"open": OPEN, "blocked": BLOCKED, "bare": NO_GOAL}.items():
        (tmp_path / f"{name}.wbt").write_text(text)
    return tmp_path


def record(answer):
    code, out, _ = answer
    return code, json.loads(out)


@pytest.mark.slow
def test_reached(tdac, there):
    """Exit 0; the record says where, when and how."""
    code, run = record(
        tdac("webots", "run", CONTROLLERS / "module_loop.py", there / "open.wbt",
             "--json")
    )  # fmt: skip
    assert code == 0
    assert run["schema_version"] == 1
    assert (run["passed"], run["outcome"], run["why_not"]) == (True, "reached", "")
    assert run["goal"] == [0.4, 0.0]
    assert run["world"] == "open.wbt"
    assert run["d0"] == pytest.approx(0.8, abs=0.01)
    assert run["d_min_euclidean"] <= 0.02
    assert run["time"] == pytest.approx(0.032 * run["steps"])


def test_not_reached(rejected, there):
    """Exit 1, and a table that names the reason."""
    out = rejected(
        "webots", "run", CONTROLLERS / "module_loop.py", there / "open.wbt",
        "--steps", 20,
    )  # fmt: skip
    assert "not passed: the goal was not reached (out of time)" in out
    assert "not run in Webots itself" in out


@pytest.mark.slow
def test_without_a_goal_or_with_another(tdac, there):
    """A world without one is driven in; --goal sets one."""
    words = ["webots", "run", CONTROLLERS / "wall_follower.py", there / "bare.wbt"]
    code, run = record(tdac(*words, "--steps", 60, "--json"))
    assert (code, run["goal"], run["passed"]) == (0, None, True)
    code, run = record(tdac(*words, "--steps", 60, "--json", "--goal", 0.5, 0.3))
    assert (code, run["goal"], run["passed"]) == (1, [0.5, 0.3], False)


def test_another_start(tdac, there):
    """The robot stands there, turned as is said, and a supervisor finds it there."""
    program = there / "where.py"
    program.write_text(
        "from controller import Supervisor\n"
        "robot = Supervisor()\n"
        "me = robot.getSelf()\n"
        "for _ in range(2):\n"
        "    print(me.getPosition(), me.getField('rotation').getSFRotation()[3])\n"
        "    robot.step(32)\n"
    )
    words = ["webots", "run", program, there / "open.wbt", "--json", "--start"]
    _, run = record(tdac(*words, 0.1, -0.2, 1.5))
    assert run["start"] == [0.1, -0.2, 1.5]
    for line in run["output"].splitlines():
        assert line == "[0.1, -0.2, 0.0] 1.5"
    _, run = record(tdac(*words, 0.1, -0.2))
    assert run["start"] == [0.1, -0.2, 0.0]


def test_progress_for_whoever_watches(tdac, there, monkeypatch):
    """On a terminal a bar counts the steps; elsewhere there is none."""
    words = ["webots", "run", CONTROLLERS / "module_loop.py", there / "open.wbt"]
    assert "20/20" not in tdac(*words, "--steps", 20)[1]
    monkeypatch.setenv("FORCE_COLOR", "1")
    _, out, _ = tdac(*words, "--steps", 20)
    assert "module_loop.py" in out
    assert all(f"{step:2}/20" in out for step in (0, 10, 20))


def test_bundled_world(tdac):
    """A world can be named."""
    code, run = record(
        tdac("webots", "run", CONTROLLERS / "main_style.py", "arena", "--json")
    )
    assert (code, run["outcome"]) == (1, "controller ended")
    assert run["world"] == "arena.wbt"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("speed", "frames", "told"),
    [
        ([], 12, "(in real time, 1 s)"),
        (["--speed", 4], 6, "(at 4 times real time, 0 s)"),
    ],
)
def test_film(rejected, there, speed, frames, told):
    """Real time by default; with `--speed`, a picture stands for more steps."""
    film = there / "run.mp4"
    out = rejected(
        "webots", "run", CONTROLLERS / "module_loop.py", there / "open.wbt",
        "--steps", 21, "--video", film, *speed,
    )  # fmt: skip
    assert f"run.mp4 {told}" in out
    read = cv2.VideoCapture(str(film))
    assert int(read.get(cv2.CAP_PROP_FRAME_COUNT)) == frames


def test_a_controller_that_fails(rejected, there):
    """Exit 1, with its own lines."""
    (there / "mine").mkdir()
    broken = there / "mine" / "broken.py"
    broken.write_text(
        "from controller import Robot\nRobot().getDevice('x').enable(1)\n"
    )
    out = rejected("webots", "run", broken, there / "open.wbt")
    assert "AttributeError at the run (line 2)" in out
    assert 'Device "x" was not found on robot "e-puck"' in out


def test_what_it_prints_does_not_steer_the_terminal(rejected, there):
    """Colours and cursor movements are taken out, other control characters shown."""
    (there / "mine").mkdir()
    bold = there / "mine" / "bold.py"
    bold.write_text(
        "from controller import AnsiCodes\n"
        "print(AnsiCodes.RED_FOREGROUND + 'red' + AnsiCodes.RESET)\n"
        "print('\\x1b[2J\\x1b[1;1Hpassed\\x1b]0;title\\x07', end='')\n"
    )
    out = rejected("webots", "run", bold, there / "open.wbt")
    assert "\nred\npassed\ufffd]0;title\ufffd\n" in out
    assert not set(out) & {"\x1b", "\x07"}


def test_without_a_sandbox(tdac, there, monkeypatch):
    """Exit 3: nothing is said about the controller."""
    monkeypatch.setenv("PATH", "")
    code, out, err = tdac(
        "webots", "run", CONTROLLERS / "keyboard.py", there / "open.wbt",
        "--tier", "bubblewrap",
    )  # fmt: skip
    assert (code, out) == (3, "")
    assert err.startswith("infrastructure fault: the sandbox failed: bubblewrap")


@pytest.mark.slow
@pytest.mark.parametrize("tier", [tier.name for tier in TIERS])
def test_every_sandbox(tdac, there, tier):
    """A run is the same in each tier that works here."""
    if not any(
        status.works for status in available_tiers() if status.tier.name == tier
    ):
        pytest.skip(f"{tier} does not work here")
    code, run = record(
        tdac("webots", "run", CONTROLLERS / "odometry.py", there / "open.wbt",
             "--steps", 30, "--tier", tier, "--json")
    )  # fmt: skip
    assert (code, run["sandbox"], run["steps"]) == (1, tier, 30)
    assert len(run["output"].splitlines()) == 29


@pytest.mark.slow
def test_another_tolerance(tdac, there):
    """A goal is reached earlier where farther away is near enough."""
    words = ["webots", "run", CONTROLLERS / "module_loop.py", there / "open.wbt"]
    _, near = record(tdac(*words, "--json"))
    code, far = record(tdac(*words, "--json", "--tolerance", 0.1))
    assert code == 0
    assert 0.08 < far["d_min_euclidean"] <= 0.1
    assert far["steps"] < near["steps"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nothing.py", "open.wbt"], "cannot read the controller 'nothing.py'"),
        (["good.py", "nowhere.wbt"], "nowhere.wbt: no such file"),
        (["good.py", "arens"], "did you mean 'arena'?"),
        (["good.py", "open.wbt", "--video", "x.avi"], "must end in .mp4 or .gif"),
        (["good.py", "open.wbt", "--tier", "magic"], "unknown sandbox tier"),
        (["good.py", "open.wbt", "--goal", "nan", "0"], "--goal must be finite"),
        (["good.py", "open.wbt", "--goal", "9", "9"], "outside the arena's wall"),
        (["good.py", "open.wbt", "--start", "9", "0"], "the start is outside"),
        (["good.py", "open.wbt", "--start", "0", "inf"], "--start must be finite"),
        (["good.py", "open.wbt", "--heading", "1"], "--heading needs --start X Y"),
        (["good.py", "empty.wbt"], "empty.wbt: there is no e-puck in it"),
        (["good.py", "open.wbt", "--ignore", "X"], "no node called 'X' to ignore"),
        (["good.py"], "Missing argument"),
        (["good.py", "open.wbt", "--steps", "0"], "--steps"),
        (["good.py", "open.wbt", "--seconds", "0"], "--seconds"),
        (["good.py", "open.wbt", "--seconds", "inf"], "--seconds must be finite"),
    ],
)
def test_usage(refused, words, said):
    """Exit 2 and one line that says what to do."""
    Path("open.wbt").write_text(OPEN)
    Path("empty.wbt").write_text("#VRML_SIM R2025a utf8\n")
    Path("good.py").write_text("pass\n")
    err = refused("webots", "run", *words)
    assert said in err


STARTS = "from controller import Robot\nrobot = Robot()\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            "while True:\n    pass\n",
            "it never called robot.step(), and after 1.5 s of CPU time the time "
            "limit ended it; call robot.step() in its loop, or set a longer limit with "
            "--seconds",
        ),
        (
            "robot.step(160)\nwhile True:\n    pass\n",
            "it used 1.5 s of CPU time, the time limit, and had done 5 of 50 steps; "
            "set a longer limit with --seconds",
        ),
        (
            "import time\nrobot.step(160)\ntime.sleep(99)\n",
            "it slept or blocked for 1.5 s, the time limit, and had done 5 of 50 "
            "steps; remove time.sleep, input and other calls that wait, or set a "
            "longer limit with --seconds",
        ),
    ],
)
def test_a_program_that_takes_too_long(tdac, there, lines, said):
    """The reason says whether it made steps, which limit applies, what to do."""
    (there / "slow.py").write_text(STARTS + lines)
    words = [there / "slow.py", there / "bare.wbt", "--steps", 50, "--seconds", 1.5]
    code, run = record(tdac("webots", "run", *words, "--json"))
    assert (code, run["outcome"], run["error"]) == (1, "error", said)
    assert run["why_not"] == f"the controller failed: {said}"


def test_a_program_that_ends_without_a_step(tdac, there):
    """It has not passed, even in a world without a goal."""
    (there / "short.py").write_text(STARTS)
    code, run = record(
        tdac("webots", "run", there / "short.py", there / "bare.wbt", "--json")
    )
    assert (code, run["outcome"]) == (1, "controller ended")
    assert run["why_not"] == "it ended without a call of robot.step()"


def test_errors_are_one_line(tdac, there):
    """Whatever the text of the exception; the text of `sys.exit` is printed."""
    (there / "many.py").write_text(f"{STARTS}raise ValueError('one\\n  two\\n')\n")
    (there / "ends.py").write_text(f"{STARTS}import sys; sys.exit('please install')\n")
    words = [there / "bare.wbt", "--json"]
    _, run = record(tdac("webots", "run", there / "many.py", *words))
    assert run["error"] == "ValueError at the run (line 3): one two"
    _, run = record(tdac("webots", "run", there / "ends.py", *words))
    assert (run["error"], run["output"]) == (None, "please install\n")


def test_a_module_beside_the_folder(tdac, there):
    """It is not copied; the error says so, and does not advise to install it."""
    for folder in ("mine", "shared"):
        (there / folder).mkdir()
    (there / "mine" / "mine.py").write_text("import shared.things\n")
    words = [there / "mine" / "mine.py", there / "bare.wbt", "--json"]
    _, run = record(tdac("webots", "run", *words))
    assert (
        "tdac copies only the controller's own folder: put a copy of shared"
        in (run["error"])
    )
    assert "pip" not in run["error"]


def test_the_robot_with_the_controller_is_driven(tdac, there):
    """Of several e-pucks; else the first one."""
    other = OPEN + epuck("-0.4 0.3 0").replace('"mine"', '"second"')
    (there / "two.wbt").write_text(other)
    for name, y in (("second", 0.3), ("mine", 0.0), ("third", 0.0)):
        (there / f"{name}.py").write_text(f"{STARTS}robot.step(32)\n")
        words = ["webots", "run", there / f"{name}.py", there / "two.wbt", "--json"]
        _, run = record(tdac(*words))
        assert run["start"] == pytest.approx([-0.4, y, 0.0])
        told = "of 2 e-pucks, 'e-puck' is driven: it has the controller 'second'"
        assert (told in run["notes"]) == (name == "second")


def test_a_line_that_repeats_is_shown_once(rejected, there):
    """With how often it came; a contact is a reason, with its place."""
    program = there / "loud.py"
    program.write_text(
        "from controller import Robot\n"
        "robot = Robot()\n"
        "for side in ('left', 'right'):\n"
        "    motor = robot.getDevice(f'{side} wheel motor')\n"
        "    motor.setPosition(float('inf'))\n"
        "    motor.setVelocity(6.0)\n"
        "print('once')\n"
        "while robot.step(32) != -1:\n"
        "    print('again')\n"
    )
    out = rejected(
        "webots", "run", program, there / "blocked.wbt", "--steps", 200
    )  # fmt: skip
    assert out.count("again") == 1
    assert "again  (×" in out
    assert "once\n" in out
    assert "steps with a contact, the first in step" in out
    assert "the goal was not reached" in out
