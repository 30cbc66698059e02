"""A small task, a controller that solves it, and what must be gone afterwards."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from few_worlds import KNOWN, write_set, write_short_set
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from small import QUICK, write_small_task

from tdac_agent import load_task
from tdac_agent.cli.main import main
from tdac_agent.environments.epuck import builtin as epuck
from tdac_agent.environments.map2d.builtin import MapParameters, template_for
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs import load_set


@pytest.fixture(scope="session")
def small_task(tmp_path_factory):
    """A task that a verification needs little time for."""
    return load_task(write_small_task(tmp_path_factory.mktemp("small")))


@pytest.fixture(scope="session")
def policy_task(tmp_path_factory):
    """The small task in the profile `policy`."""
    folder = tmp_path_factory.mktemp("policy")
    return load_task(write_small_task(folder, profile="policy"))


@pytest.fixture(scope="session")
def good_source(small_task):
    """A controller that is verified on the small task."""
    task = small_task
    return template_for(task.params.robot, task.nominal.dt).render(MapParameters())


@pytest.fixture(scope="session")
def crates():
    """A rectangular world for the e-puck that is soon crossed."""
    return load_task("epuck-crates")


@pytest.fixture(scope="session")
def crates_source(crates):
    """A controller that is verified there."""
    return epuck.template_for(crates.nominal).render(epuck.EPuckParameters())


@pytest.fixture(scope="session")
def warm():
    """A judge that is ready, for tests that need nothing special of it."""
    with WarmJudge() as judge:
        yield judge


@pytest.fixture
def few(tmp_path):
    """A set that `known.py` solves."""
    return load_set(write_set(tmp_path / "few.yaml"))


@pytest.fixture(scope="session")
def solver():
    """The source of a controller that reaches all goals of `few`."""
    return KNOWN.read_text()


@pytest.fixture
def level(tmp_path):
    """The file of a set of short episodes, in which nothing arrives."""
    return write_short_set(tmp_path / "few.yaml")


@pytest.fixture
def out(tmp_path):
    """The folder of a run that is not there yet."""
    return tmp_path / "run"


@pytest.fixture
def crowd():
    """A CPU for which others compete all the time."""
    cpu = min(os.sched_getaffinity(0))
    command = [sys.executable, "-c", "print(flush=True)\nwhile True: pass"]
    others = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(3)]
    for other in others:
        other.stdout.readline()  # it is at work
        os.sched_setaffinity(other.pid, {cpu})
    yield cpu
    for other in others:
        other.kill()
        other.communicate()


@pytest.fixture
def browser(chromium):
    """Chromium with an empty page: that of the test before complains no more."""
    chromium.get("about:blank")
    chromium.get_log("browser")
    return chromium


@pytest.fixture(scope="session")
def chromium(tmp_path_factory):
    """Chromium without a window; use `browser`."""
    program = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if not program or not driver:
        pytest.skip("needs chromium and chromedriver: apt-get install chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for flag in (
        *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"),
        # A page that still scrolls smoothly moves away from under a click.
        "--force-prefers-reduced-motion",
        f"--user-data-dir={tmp_path_factory.mktemp('profile')}",
    ):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(options=options, service=Service(driver))
    yield opened
    opened.quit()


def _is_told(line):
    """Whether a line of stderr has to do with a command.

    On a busy machine, compiling takes long enough to be announced.
    """
    return not line.startswith("tdac: compiling")


@pytest.fixture
def tdac(monkeypatch, capsys, tmp_path):
    """Runs a command in an empty folder; gives exit code, stdout and stderr."""
    place = tmp_path / "here"
    place.mkdir()
    monkeypatch.chdir(place)
    monkeypatch.setenv("COLUMNS", "200")
    handlers = {n: signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGHUP)}

    def run(*words):
        monkeypatch.setattr("sys.argv", ["tdac", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        return ended.value.code, out, "".join(filter(_is_told, err.splitlines(True)))

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture
def done(tdac):
    """Runs a command that succeeds; gives its stdout."""

    def run(*words):
        code, out, err = tdac(*words)
        assert code == 0, err
        return out

    return run


@pytest.fixture
def rejected(tdac):
    """Runs a command whose verdict is no, which is exit code 1; gives its stdout."""

    def run(*words):
        code, out, err = tdac(*words)
        assert code == 1, err
        return out

    return run


@pytest.fixture
def refused(tdac):
    """Runs a command that is a mistake; gives the one line on stderr."""

    def run(*words):
        code, out, err = tdac(*words)
        assert (code, out, err.count("\n")) == (2, "", 1), err
        return err

    return run


@pytest.fixture
def good(tmp_path, good_source):
    """A folder with the small task and a controller that solves it."""
    folder = write_small_task(tmp_path / "task")
    (folder / "controller.py").write_text(good_source)
    return folder


@pytest.fixture
def quick():
    """Limits with which a controller that hangs is soon given up."""
    return QUICK


@pytest.fixture
def alarm():
    """Interrupts the test so many seconds after it is called; 0 for never."""

    def late(number, frame):
        raise TimeoutError("still at work")

    before = signal.signal(signal.SIGALRM, late)
    yield signal.alarm
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def mentioning(text: str) -> list[int]:
    """Running processes with a text in their command line, environment or folder."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
            about = (folder / "cmdline").read_bytes() + (
                folder / "environ"
            ).read_bytes()
            about += os.fsencode(os.readlink(folder / "cwd"))
        except OSError:
            continue
        mine = int(folder.name) == os.getpid()
        if state not in "ZX" and not mine and os.fsencode(text) in about:
            found.append(int(folder.name))
    return found


def left_running(folder: Path) -> list[int]:
    """Processes that mention a folder after they had five seconds to end."""
    deadline = time.monotonic() + 5.0
    while (left := mentioning(str(folder))) and time.monotonic() < deadline:
        os.sched_yield()
    return left


@pytest.fixture(name="left_running")
def _left_running():
    """The function of that name."""
    return left_running


@pytest.fixture
def no_traces(tmp_path, monkeypatch):
    """After the test nothing runs that it started, and no temporary file is left."""
    base = tmp_path / "temporary"
    base.mkdir()
    monkeypatch.setenv("TMPDIR", str(base))
    monkeypatch.setattr("tempfile.tempdir", str(base))
    yield base
    assert left_running(base) == []
    assert list(base.iterdir()) == []
