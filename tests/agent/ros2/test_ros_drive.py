"""An exported package drives the simulated robot over DDS, whatever goes wrong."""

import dataclasses
import gc
import itertools
import marshal
import math
import os
import py_compile
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from floor_task import Ready, forward, write_task

pytest.importorskip("cyclonedds", reason="no wheel of Cyclone DDS")

from tdac_agent.errors import RunError
from tdac_agent.ros2 import messages as msg
from tdac_agent.ros2.dds import Bus, time_of
from tdac_agent.ros2.drive import Node, open_package
from tdac_agent.ros2.export import core_settings
from tdac_agent.ros2.faults import STOPPING, Fault, drawn_faults, read_fault
from tdac_agent.ros2.package import worker
from tdac_agent.ros2.robot import Robot
from tdac_agent.ros2.simulator import Simulator
from tdac_envs.core.errors import TaskError

DOMAINS = (20 + (os.getpid() + number) % 80 for number in itertools.count())


@pytest.fixture
def domain():
    """A domain that no other test uses."""
    return next(DOMAINS)


@pytest.fixture
def stated(settings):
    """The stated distances to standstill."""
    return core_settings(settings, dead_man=0.3).stops_within()


class NodeProcess:
    """`tdac ros drive` in a process of its own."""

    def __init__(self, package, domain, *flags):
        command = [sys.executable, "-m", "tdac_agent", "ros", "drive", str(package)]
        self.process = subprocess.Popen(
            [*command, "--domain", str(domain), *flags],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()

    def output(self):
        """What it printed, after its end."""
        return self.process.communicate(timeout=60)[0]


def robot_of(task, settings):
    """The robot at its start."""
    return Robot(task, settings, dead_man=0.3)


@pytest.mark.slow
def test_as_many_commands_as_verified(task, settings, package, steps, domain):
    """In simulated time, a drive has the steps of the verified episode."""
    with NodeProcess(package, domain) as node:
        simulator = Simulator(robot_of(task, settings), Bus(domain), patience=30.0)
        report = simulator.run(60.0)
        printed = node.output()
    assert report.outcome == "reached"
    assert report.commands == report.steps
    assert report.steps == steps
    assert report.stops == 0
    assert "reached: the goal" in printed
    assert node.process.returncode == 0


@pytest.mark.slow
def test_the_pose_from_odometry(task, settings, package, steps, domain):
    """With the declared origin of /odom, and with stamped commands, it is the same."""
    origin = [str(value) for value in settings["start"]]
    flags = ["--origin", *origin, "--stamped"]
    with NodeProcess(package, domain, *flags):
        bus = Bus(domain, stamped=True)
        report = Simulator(robot_of(task, settings), bus, patience=30.0).run(60.0)
    assert report.outcome == "reached"
    assert report.steps == steps


def test_a_simulation_says_what_it_waits_for(task, settings, domain):
    """In one line, while there is no node, and again when its node has gone."""
    said, sent, moved = [], Bus(domain).writer("cmd_vel"), threading.Event()
    simulator = Simulator(
        robot_of(task, settings),
        Bus(domain),
        patience=0.5,
        watch=lambda _: moved.set(),
        say=said.append,
    )

    def move():
        while not moved.wait(0.05):
            if said:
                sent.write(msg.Twist(msg.Vector3(0.05)))

    mover = threading.Thread(target=move, daemon=True)
    mover.start()
    report = simulator.run(4.0)
    moved.set()
    mover.join()
    assert report.outcome == "out of time"
    waits, lost = said
    assert waits.endswith("it waits at most 60 s for a node, such as tdac ros drive")
    assert lost.endswith("waits for another node if its own has ended; Ctrl-C ends it")


@pytest.mark.slow
def test_the_command_says_it_on_stderr(run, domain):
    """Beside --json, too, whose output stays that of a record."""
    command = [sys.executable, "-m", "tdac_agent", "ros", "sim", str(run), "--json"]
    with subprocess.Popen(
        [*command, "--domain", str(domain)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert "it waits for /cmd_vel" in process.stderr.readline()
        assert process.stderr.readline().startswith("no command on /cmd_vel for ")
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=60)[0] == ""


@pytest.mark.slow
def test_in_real_time(task, settings, package, domain):
    """It reaches the goal without a contact; stops are allowed."""
    with NodeProcess(package, domain, "--real-time", "--recover"):
        report = Simulator(robot_of(task, settings), Bus(domain), real_time=True).run(
            120.0
        )
    assert (report.outcome, report.contact) == ("reached", "")


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("kind", STOPPING)
def test_each_fault_stops_it_in_time(task, settings, package, stated, domain, kind):
    """The robot stands after the stated distance, and goes on after the fault."""
    fault = Fault(kind, 2.0, 2.0)
    with NodeProcess(package, domain, "--recover"):
        simulator = Simulator(
            robot_of(task, settings), Bus(domain), faults=(fault,), patience=30.0
        )
        report = simulator.run(60.0)
    assert report.outcome == "reached"
    assert report.faults[0]["stood"]
    assert report.faults[0]["way"] <= stated[STOPPING[kind]]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["some-nan", "second-publisher"])
def test_no_fault_leads_to_a_contact(task, settings, package, domain, kind):
    """Missing ranges, a second publisher: the goal without a contact."""
    with NodeProcess(package, domain, "--recover"):
        simulator = Simulator(
            robot_of(task, settings),
            Bus(domain),
            faults=(Fault(kind, 2.0, 2.0),),
            patience=30.0,
        )
        report = simulator.run(60.0)
    assert report.outcome == "reached"
    assert report.faults[0]["stood"] == (kind == "second-publisher")


def signalled(number, process, after):
    """A watch that signals a process once, after so many seconds of the drive."""
    state = {"way": None, "stood": None}

    def watch(robot):
        if state["way"] is None and robot.time >= after:
            process().send_signal(number)
            if number == signal.SIGKILL:
                process().wait()
            state["way"] = robot.way
        elif state["way"] is not None and state["stood"] is None and robot.stands:
            state["stood"] = robot.way - state["way"]

    return state, watch


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM])
def test_a_node_that_ends_or_freezes(task, settings, package, stated, domain, number):
    """The robot stands within the stated distance; a new node finishes the drive."""
    nodes = [NodeProcess(package, domain)]
    state, watch = signalled(number, lambda: nodes[0].process, 2.0)
    robot, limit = robot_of(task, settings), 5.0
    with nodes[0]:
        simulator = Simulator(robot, Bus(domain), watch=watch, patience=3.0)
        report = simulator.run(limit)
    assert report.outcome == "out of time"
    assert state["stood"] is not None
    assert state["stood"] <= stated["the node is killed, frozen or unreachable"]
    with NodeProcess(package, domain, "--any-start"):
        again = Simulator(robot, Bus(domain), patience=30.0).run(60.0)
    assert (again.outcome, again.contact) == ("reached", "")


@pytest.mark.slow
def test_a_slow_node(task, settings, package, stated, domain, here):
    """A controller that needs more than its period stops the robot, and no more."""
    opened = open_package(package)
    policy = opened.worker.Worker(package / "controller", settings["controller_sha256"])

    class Slow:
        """The controller, which is slow for a second."""

        count = 0

        def ask(self, observation):
            self.count += 1
            self.after = time.monotonic() + (0.2 if 20 < self.count < 24 else 0.0)
            policy.ask(observation)

        def answer(self, wait):
            rest = self.after - time.monotonic()
            if rest > wait:
                time.sleep(wait)
                return None
            time.sleep(max(rest, 0.0))
            return policy.answer(max(wait, 0.01))

    node = Node(
        opened, Bus(domain), dead_man=0.3, sim_time=False, policy=Slow(), recover=True
    )
    thread = threading.Thread(target=node.run, args=(100.0,), daemon=True)
    thread.start()
    report = Simulator(robot_of(task, settings), Bus(domain), real_time=True).run(100.0)
    thread.join(30.0)
    assert report.outcome == "reached"


@pytest.mark.slow
def test_a_simulation_that_ends(task, settings, package, domain):
    """When the clock stands still, the node ends by itself, with zero."""
    # It still takes commands, which the robot does not obey any more.
    simulator = Simulator(robot_of(task, settings), Bus(domain), patience=30.0)
    with NodeProcess(package, domain, "--recover") as node:
        simulator.run(1.0)
        printed = node.output()
    assert "ended: the clock stands still" in printed
    assert node.process.returncode == 1


@pytest.mark.slow
def test_an_interrupted_simulation_keeps_its_recording(tmp_path, domain):
    """Ctrl-C while it waits for a node: what it published is in the file."""
    reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
    task, file = write_task(tmp_path), tmp_path / "drive.mcap"
    command = [sys.executable, "-m", "tdac_agent", "ros", "sim", "--task", task]
    process = subprocess.Popen(
        [*map(str, command), "--mcap", str(file), "--domain", str(domain)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline().startswith("floor: a robot on domain")
    time.sleep(2.0)
    process.send_signal(signal.SIGINT)
    printed = process.communicate(timeout=60)[0]
    assert process.returncode == 130
    assert "wrote" in printed
    with file.open("rb") as bag:
        assert reader.make_reader(bag).get_summary().statistics.message_count > 0


class Gone(Exception):
    """The simulation ends at once."""


@pytest.mark.slow
def test_a_robot_that_takes_no_commands_any_more(task, settings, package, domain):
    """Its driver has ended: the node ends, too, and says why."""

    def watch(robot):
        if robot.time >= 1.0:
            raise Gone

    with NodeProcess(package, domain) as node:
        bus = Bus(domain)
        simulator = Simulator(robot_of(task, settings), bus, patience=30.0, watch=watch)
        with pytest.raises(Gone):
            simulator.run(60.0)
        clock, now = bus.writer("clock"), simulator._clock
        del simulator
        gc.collect()
        end = time.monotonic() + 30.0
        while node.process.poll() is None and time.monotonic() < end:
            now += 0.1
            clock.write(msg.Clock(time_of(now)))
            time.sleep(0.1)
        printed = " ".join(node.output().split())
    assert "ended: nobody takes the commands" in printed
    assert node.process.returncode == 1


@pytest.mark.slow
def test_a_simulation_that_begins_again(task, settings, package, domain):
    """Its clock goes back: the node ends, and does not drive on in the new one."""
    with NodeProcess(package, domain, "--recover") as node:
        bus = Bus(domain)
        simulator = Simulator(robot_of(task, settings), bus, patience=30.0)
        simulator.run(1.0)
        clock = bus.writer("clock")
        end = time.monotonic() + 30.0
        while node.process.poll() is None and time.monotonic() < end:
            clock.write(msg.Clock(time_of(1.0)))
            time.sleep(0.02)
        printed = node.output()
    assert "failed: the clock went back by" in printed
    assert node.process.returncode == 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_random_faults(task, settings, package, stated, steps, domain, seed):
    """Four faults in a drive: no contact, each stop within its stated distance."""
    faults = drawn_faults(seed, 4, 0.1 * steps)
    with NodeProcess(package, domain, "--recover"):
        simulator = Simulator(
            robot_of(task, settings), Bus(domain), faults=faults, patience=30.0
        )
        report = simulator.run(120.0)
    assert report.contact == ""
    for course in report.faults:
        if course["kind"] in STOPPING:
            assert course["way"] <= stated[STOPPING[course["kind"]]]


def test_a_changed_package_needs_trust(package, tmp_path):
    """Code that this installation did not export runs only if the user says so."""
    for place in ("floor/core.py", "controller/sensors.py", "controller/heapq.py"):
        copy = tmp_path / place.replace("/", "-")
        shutil.copytree(package, copy)
        file = copy / place.replace("floor", "tdac_floor")
        file.write_text((file.read_text() if file.is_file() else "") + "\n")
        with pytest.raises(RunError, match="give --trust"):
            open_package(copy)
    with pytest.raises(RunError, match="is not a package of tdac export ros2"):
        open_package(tmp_path)


@pytest.mark.parametrize("place", ["__init__.py", "core.abi3.so", "core.pyc"])
def test_nothing_else_in_the_folder_runs(package, tmp_path, place):
    """A package that comes back with more files than it had runs none of them."""
    copy = tmp_path / "copy"
    shutil.copytree(package, copy)
    modules, mark = copy / "tdac_floor", tmp_path / "ran"
    evil = f"open({str(mark)!r}, 'w').close()\n"
    if place == "core.pyc":
        source = modules / "core.py"
        made = py_compile.compile(str(source), doraise=True)
        code = Path(made).read_bytes()[:16] + marshal.dumps(compile(evil, "x", "exec"))
        Path(made).write_bytes(code)
    else:
        (modules / place).write_text(evil)
    opened = open_package(copy)
    assert opened.core.Core.__module__ == "tdac_agent.ros2.package.core"
    assert not mark.exists()


def test_a_second_signal_ends_it_at_once(package, domain, here):
    """The first one sends the last zero several times; the second one, once more."""
    said, bus = [], Bus(domain)
    reader = bus.reader("cmd_vel")

    def say(text):
        said.append(text)
        signal.raise_signal(signal.SIGINT)

    node = Node(open_package(package), bus, dead_man=0.3, sim_time=False, say=say)
    with pytest.raises(KeyboardInterrupt):
        node.run()
    assert said == ["waiting", "ended: the node was told to end"]
    found, end = [], time.monotonic() + 10.0
    while len(found) < 3 and time.monotonic() < end:
        found += reader.take()
    assert [(each.linear.x, each.angular.z) for each in found] == [(0.0, 0.0)] * 3


def hostile_messages():
    """Messages of the right types with values that no robot has."""
    for value in (math.nan, math.inf, -math.inf, 1e308, -1.0):
        point, turn = (
            msg.Point(value, value),
            msg.Quaternion(value, value, value, value),
        )
        body = msg.PoseWithCovariance(msg.Pose(point, turn), [value] * 36)
        for seconds in (-(2**31), 0, 2**31 - 1):
            header = msg.Header(msg.Time(seconds, 2**32 - 1), "x" * 5000)
            yield "odom", msg.Odometry(header, "base_link", body)
            yield "amcl_pose", msg.PoseWithCovarianceStamped(header, body)
            place = msg.Transform(msg.Vector3(value, value), turn)
            for parent, child in (("map", "odom"), ("odom", "base_link")):
                own = msg.Header(header.stamp, parent)
                moved = msg.TransformStamped(own, child, place)
                yield "tf", msg.TFMessage([moved])
            ranges = [max(min(value, 3e38), -3e38)] * 60
            fields = [max(min(value, 3e38), -3e38)] * 7
            yield "scan", msg.LaserScan(header, *fields, ranges)
            yield "scan", msg.LaserScan(header, *fields, [])
            yield "clock", msg.Clock(header.stamp)
    frames = [msg.TransformStamped(msg.Header(), f"f{i}") for i in range(500)]
    yield "tf", msg.TFMessage(frames)


@pytest.mark.parametrize("origin", [None, (0.0, 0.0, 0.0)])
def test_messages_of_strangers_move_nothing(package, domain, here, origin):
    """Whatever numbers arrive, the node goes on and sends only zeros."""
    bus, opened, sent = Bus(domain), open_package(package), []
    node = Node(
        opened, bus, dead_man=0.3, sim_time=False, any_start=True, origin=origin
    )
    writers = {name: bus.writer(name) for name in ("scan", "odom", "tf", "clock")}
    writers["amcl_pose"] = bus.writer("amcl_pose")
    for name, message in hostile_messages():
        writers[name].write(message)
        node._hear()
        sent.append(node.core.tick(time.time(), 0.0))
    assert {(each.v, each.omega) for each in sent} == {(0.0, 0.0)}
    assert len(node._frames) <= 100


class Listening:
    """A node of this process, to which a test sends what it likes.

    Attributes:
        core: Its core, with a policy that drives straight ahead.
    """

    def __init__(self, package, domain, **flags):
        bus = Bus(domain)
        names = ("scan", "odom", "tf", "tf_static", "map", "amcl_pose")
        self._out = {name: bus.writer(name) for name in names}
        flags = {"dead_man": 0.3, "policy": Ready(forward), **flags}
        self._node = Node(open_package(package), bus, sim_time=True, **flags)
        self.core = self._node.core

    def hear(self, *messages):
        """Sends messages, as (topic, message), one after the other."""
        for name, message in messages:
            self._out[name].write(message)
            time.sleep(0.02)
            self._node._hear()

    def moves(self, now):
        """Whether the command of a time is a motion."""
        return self.core.tick(now, 0.0).v > 0.0


def placed(stamp, parent, child, pose):
    """A transform on /tf, or on /tf_static if it has no time."""
    x, y, yaw = pose
    turn = msg.Quaternion(0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
    move = msg.Transform(msg.Vector3(x, y), turn)
    header = msg.Header(time_of(stamp or 0.0), parent)
    own = msg.TFMessage([msg.TransformStamped(header, child, move)])
    return ("tf_static" if stamp is None else "tf"), own


def scanned(stamp, ranges, first=0.0):
    """A scan of a whole turn."""
    header = msg.Header(time_of(stamp), "base_scan")
    step, last = math.tau / len(ranges), first + math.tau
    angles = first, last, step
    return "scan", msg.LaserScan(header, *angles, 0.0, 0.1, 0.1, 3.0, list(ranges))


SCANNER = placed(None, "base_link", "base_scan", (-0.03, 0.0, 0.0))
FREE = [2.0] * 60


def test_a_pose_through_the_frames_of_a_turtlebot(package, settings, domain, here):
    """Its odometry moves base_footprint, and base_link stands on it, in /tf_static."""
    node = Listening(package, domain)
    start = tuple(settings["start"])
    node.hear(
        SCANNER,
        placed(None, "base_footprint", "base_link", (0.0, 0.0, 0.0)),
        placed(2.0, "map", "odom", start),
        placed(1.0, "odom", "base_footprint", (0.0, 0.0, 0.0)),
        scanned(1.0, FREE),
    )
    assert node.moves(1.0)


@pytest.mark.parametrize(
    ("ahead", "last_tick", "why"),
    [
        (1.0, 14, "the localiser sent nothing new for 1 s"),
        (9.0, 14, "the localiser sent nothing new for 1 s"),
        (0.25, 9, "the last pose is older than 0.3 s"),
    ],
)
def test_a_localiser_that_is_silent(
    package, settings, domain, here, ahead, last_tick, why
):
    """It is noticed within a second, however new the odometry is."""
    node = Listening(package, domain, any_start=True)
    node.core._policy.policy = lambda _: ("action", (0.2, -0.2))
    for tick in range(20):
        now = 1.0 + 0.1 * tick
        still = placed(now, "odom", "base_link", (0.0, 0.0, 0.0))
        if tick in (0, 2, 4):  # with the scans of a scanner of 5 Hz
            localised = placed(now + ahead, "map", "odom", settings["start"])
            node.hear(SCANNER, localised)
        node.hear(still, scanned(now, FREE))
        last = node.core.tick(now, 0.0)
        node.core.drove(0.0, 0.0)
        assert (last.state == "driving") == (tick <= last_tick), (tick, last)
        assert tick != last_tick + 1 or last.reason.startswith(why)


@pytest.mark.slow
def test_a_latched_stop_ends_the_drive(task, settings, package, domain):
    """Over DDS no service starts it again: one line, exit code 1."""
    fault = Fault("second-publisher", 2.0, 2.0)
    with NodeProcess(package, domain) as node:
        robot = robot_of(task, settings)
        Simulator(robot, Bus(domain), faults=(fault,), patience=30.0).run(5.0)
        printed = node.output()
    last = "ended: 2 publishers of the commands: end the others (--recover drives on)"
    assert last in printed.replace("\n", " ")
    assert node.process.returncode == 1
    assert robot.stands


@pytest.mark.slow
@pytest.mark.parametrize("recovers", [False, True])
def test_a_robot_that_has_gone(task, settings, package, domain, recovers):
    """In real time, a node whose robot has gone ends by itself."""
    flags = ["--recover"] if recovers else []
    with NodeProcess(package, domain, "--real-time", *flags) as node:
        robot = robot_of(task, settings)
        Simulator(robot, Bus(domain), real_time=True).run(1.0)
        printed = " ".join(node.output().split())
    gone = "ended: no scan for 10 s: the robot has gone"
    assert gone in printed if recovers else "ended: " in printed, printed
    assert node.process.returncode == 1


def test_a_changed_file_of_the_controller_is_refused(package, tmp_path, here):
    """Each file of its folder counts, and none may be added."""
    for place, text in {
        "occupancy.npy": "",
        "settings.json": "{}",
        "sensors.py": "x",
        "heapq.py": "x",
        "params.json": None,
    }.items():
        copy = tmp_path / place
        shutil.copytree(package, copy)
        worker.check_files(copy / "controller")
        file = copy / "controller" / place
        file.unlink() if text is None else file.write_text(text)
        with pytest.raises(ValueError, match=rf"{place} is not as exported"):
            worker.check_files(copy / "controller")
    shutil.copytree(package, tmp_path / "copy")
    (tmp_path / "copy" / "controller" / "occupancy.npy").write_bytes(b"")
    opened = open_package(tmp_path / "copy", trust=True)
    with pytest.raises(RunError, match=r"occupancy.npy is not as exported"):
        Node(opened, Bus(domain=0), dead_man=0.3, sim_time=True)


def test_a_scanner_that_looks_back_is_turned(package, settings, domain, here):
    """A mounting that tf does not know counts as none; a wrong place ends the drive."""
    node = Listening(package, domain)
    wall = [0.2 if min(i, 60 - i) <= 4 else 2.0 for i in range(60)]
    back = placed(None, "base_link", "base_scan", (-0.03, 0.0, math.pi))
    node.hear(
        placed(1.0, "map", "odom", settings["start"]),
        placed(1.0, "odom", "base_link", (0.0, 0.0, 0.0)),
        scanned(1.0, wall, first=-math.pi),
    )
    reason = node.core.tick(1.0, 0.0).reason
    assert reason == "no scan yet: tf does not know where base_scan is on base_link"
    node.hear(back, scanned(1.0, wall, first=-math.pi))
    assert "something is ahead" in node.core.tick(1.0, 0.0).reason
    seen = node.core.observation()["ranges"]
    assert np.allclose(seen, wall)
    elsewhere = placed(None, "base_link", "base_scan", (0.03, 0.0, math.pi))
    node.hear(elsewhere, scanned(1.1, wall, first=-math.pi))
    assert node.core.final.reason.startswith("the scanner is at (0.030, 0.000) m")


def test_a_localiser_with_another_map(package, settings, task, domain, here):
    """The map of the simulated robot is taken, the one of another place is not."""
    node = Listening(package, domain)
    own = Simulator(robot_of(task, settings), Bus(domain))._map()
    node.hear(("map", own))
    assert node.core.final is None
    own.info.width += 1
    node.hear(("map", own))
    assert "has another map: 61 x 40 cells of 0.05 m" in node.core.final.reason
    other = Listening(package, domain, any_map=True)
    other.hear(("map", own))
    assert other.core.final is None


@pytest.mark.parametrize("resample", [False, True])
def test_scans_with_other_numbers_of_rays(package, settings, domain, here, resample):
    """Such as those of the LDS-02: they need `resample_scan`."""
    node = Listening(package, domain, resample_scan=resample)
    node.hear(
        SCANNER,
        placed(1.0, "map", "odom", settings["start"]),
        placed(1.0, "odom", "base_link", (0.0, 0.0, 0.0)),
        scanned(1.0, [2.0] * 55, first=0.05),
    )
    assert node.moves(1.0) == resample
    node.hear(scanned(1.1, [2.0] * 63, first=0.02))
    last = node.core.tick(1.1, 0.0)
    assert (last.state == "driving") == resample
    assert resample or "set resample_scan if only the number" in last.reason


class Varying(Robot):
    """A robot whose scans have another number of rays each time."""

    count = 60

    def step(self):
        super().step()
        self.count = 57 + (self.count * 7) % 11

    @property
    def layout(self):
        own = super().layout
        return dataclasses.replace(own, count=self.count, step=math.tau / self.count)

    def read(self):
        reading = super().read()
        nearest = np.round(np.arange(self.count) * 60 / self.count).astype(int) % 60
        return dataclasses.replace(reading, ranges=reading.ranges[nearest])


@pytest.mark.slow
def test_a_drive_with_scans_of_varying_size(task, settings, package, domain):
    """`tdac ros drive --resample-scan` reaches the goal with them."""
    with NodeProcess(package, domain, "--resample-scan") as node:
        robot = Varying(task, settings, dead_man=0.3)
        report = Simulator(robot, Bus(domain), patience=30.0).run(60.0)
        printed = node.output()
    assert (report.outcome, report.contact) == ("reached", ""), printed


@pytest.mark.parametrize(
    "text", ["nan", "nan-scans@1", "nan-scan@1+2", "no-scans@-1+2"]
)
def test_faults_that_are_none(text):
    """One line says how they are written, or which kinds there are."""
    with pytest.raises(TaskError, match="expected"):
        read_fault(text)
    assert str(read_fault("nan-scans@1+2.5")) == "nan-scans@1+2.5"
