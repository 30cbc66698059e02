"""`tdac verify --recorded` finds what a recorded drive did otherwise, and how near."""

import dataclasses
import math
import os

import numpy as np
import pytest

pytest.importorskip("mcap", reason="mcap is not installed")
pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from tdac_agent.cli.main import main
from tdac_agent.cli.play import drive
from tdac_agent.errors import RunError
from tdac_agent.ros2.bag import Bag, write_bag
from tdac_agent.ros2.export import core_settings
from tdac_agent.ros2.faults import Fault
from tdac_agent.ros2.package.core import Core
from tdac_agent.ros2.package.scans import Layout
from tdac_agent.ros2.package.worker import Worker
from tdac_agent.ros2.read_bag import TWIST, read_bag
from tdac_agent.ros2.recorded import compare
from tdac_agent.ros2.robot import Robot

TYPES = get_typestore(Stores.ROS2_JAZZY)


@pytest.fixture(scope="module")
def source(run):
    """The controller."""
    return (run / "controller.py").read_bytes()


@pytest.fixture(scope="module")
def rollout(task, source):
    """The nominal episode."""
    return drive(task, source, "nominal", "auto")


@pytest.fixture(scope="module")
def bag(task, rollout, tmp_path_factory):
    """Its bag."""
    path = tmp_path_factory.mktemp("bag") / "drive.mcap"
    write_bag(path, task, rollout)
    return path


def rewritten(bag, path, change=lambda each: each):
    """The bag with changed messages; those that are None are left out."""
    out = Bag()
    for each in read_bag(bag):
        changed = change(each)
        if changed is not None:
            data = TYPES.serialize_cdr(changed.message, changed.kind)
            out.write_data(changed.topic, changed.time, changed.kind, data)
    path.write_bytes(out.finish())
    return path


def test_a_drive_of_its_controller(bag, source, task, rollout, steps):
    """All commands are the controller's; the gap is that of the judge."""
    report = compare(bag, source, task)
    assert (report.commands, report.same) == (steps + 1, steps + 1)
    assert report.passed
    assert report.outcome == "reached: the goal"
    assert (report.stops, report.stopped) == (0, 0.0)
    # Exact along the arcs there, at the poses here.
    gap = rollout.smallest_gap.gap * 0.05
    assert gap - 1e-6 <= report.map_gap <= gap + 0.015
    assert abs(report.scan_gap - report.map_gap) < 0.03
    places = rollout.trajectory.poses[:, :2]
    way = sum(map(math.dist, places, places[1:]))
    assert math.isclose(report.way, 0.05 * way, abs_tol=1e-3)


def test_other_commands_are_named(bag, source, task, tmp_path):
    """A changed command is found at its time; a zero one is told apart."""
    count = 0

    def change(each):
        nonlocal count
        if each.kind != TWIST:
            return each
        count += 1
        if count == 30:
            each.message.linear.x += 0.05
        if count == 40:
            each.message.linear.x = each.message.angular.z = 0.0
        return each

    report = compare(rewritten(bag, tmp_path / "x.mcap", change), source, task)
    assert report.different >= 1
    first = report.differences[0]
    assert math.isclose(first.time, 2.9, abs_tol=1e-6)
    assert math.isclose(first.recorded[0] - first.replayed[0], 0.05, abs_tol=1e-4)
    assert report.stood == 1
    assert report.stops == 1
    assert not report.passed


def test_a_drive_with_scans_of_varying_size(
    package, settings, task, source, robot, tmp_path, here
):
    """Those of an LDS-02 are resampled, as by the node that drove."""
    worker = Worker(package / "controller", settings["controller_sha256"])
    own = core_settings(settings, dead_man=0.3, resample_scan=True)
    core, bag = Core(own, worker), Bag()
    bag.transform("/tf_static", 1.0, ("base_link", "base_scan"), (-0.03, 0.0, 0.0))
    for step in range(400):
        now, reading = 1.0 + 0.1 * step, robot.read()
        count = 57 + step % 7
        turn = float(np.float32(math.tau / count))
        ranges = reading.ranges[np.arange(count) * 60 // count]
        bag.moment(now, reading.pose.tolist())
        empty = np.zeros(0, np.float32)
        fields = 0.0, 6.2, turn, 0.0, 0.1, float(np.float32(0.1)), 3.0, ranges, empty
        header = bag.header(now, "base_scan")
        bag.add("/scan", now, "sensor_msgs/msg/LaserScan", header, *fields)
        core.pose(now, *reading.pose)
        core.scan(now, Layout(count, 0.0, turn, fields[5], 3.0), ranges)
        command = core.tick(now, 60.0)
        bag.twist("/cmd_vel", now, command.v, command.omega)
        if command.state == "reached":
            break
        robot.obey(command.v, command.omega)
        robot.step()
    assert command.state == "reached", command
    (tmp_path / "x.mcap").write_bytes(bag.finish())
    report = compare(tmp_path / "x.mcap", source, task)
    assert (report.same, report.commands) == (step + 1, step + 1)
    assert report.passed


@pytest.mark.parametrize("plugin", StoragePlugin)
def test_folders_of_rosbag2(bag, source, task, steps, tmp_path, plugin):
    """What `ros2 bag record` writes, in both storages, is read likewise."""
    folder, connections = tmp_path / "bag", {}
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        for each in read_bag(bag):
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(
                    each.topic, each.kind, typestore=TYPES
                )
            data = TYPES.serialize_cdr(each.message, each.kind)
            writer.write(connections[each.topic], round(each.time * 1e9), data)
    report = compare(folder, source, task)
    assert (report.same, report.passed) == (steps + 1, True)


def test_a_pose_topic_without_tf(bag, source, task, steps, tmp_path):
    """Without tf, a topic of poses on the map is used."""

    def change(each):
        return None if each.topic.startswith("/tf") else each

    path = rewritten(bag, tmp_path / "x.mcap", change)
    report = compare(path, source, task)
    assert (report.same, report.passed) == (steps + 1, True)


@pytest.mark.parametrize(
    ("without", "why"),
    [
        (("/tf", "/tf_static", "/pose"), "has no pose: record /tf"),
        (("/scan",), "has no sensor_msgs/LaserScan"),
        (("/cmd_vel",), "has no geometry_msgs/Twist"),
    ],
)
def test_what_a_bag_lacks_is_named(bag, source, task, tmp_path, without, why):
    """One line, which says what to record."""

    def change(each):
        return None if each.topic in without else each

    path = rewritten(bag, tmp_path / "x.mcap", change)
    with pytest.raises(RunError, match=why):
        compare(path, source, task)


def test_two_scanners_are_not_guessed(bag, source, task, tmp_path):
    """Several scans: the user records one of them."""
    out = Bag()
    for each in read_bag(bag):
        data = TYPES.serialize_cdr(each.message, each.kind)
        for topic in {each.topic, each.topic.replace("/scan", "/rear/scan")}:
            out.write_data(topic, each.time, each.kind, data)
    (tmp_path / "x.mcap").write_bytes(out.finish())
    with pytest.raises(RunError, match="has several scans: /rear/scan, /scan"):
        compare(tmp_path / "x.mcap", source, task)


def test_the_time_from_the_last_command_to_the_stop(bag, source, task, tmp_path):
    """Of a node that was killed: what `dead_man` must cover; else there is none."""
    assert compare(bag, source, task).rolled is None
    commands = [each.time for each in read_bag(bag) if each.topic == "/cmd_vel"]
    killed, kept = commands[len(commands) // 2], []

    def change(each):
        if each.topic.startswith("/tf") or each.topic == "/cmd_vel":
            return each if each.topic == "/cmd_vel" and each.time <= killed else None
        if each.topic == "/pose":
            if each.time <= killed + 0.25:
                kept.append(each.message.pose)
            each.message.pose = kept[-1]
        return each

    path = rewritten(bag, tmp_path / "killed.mcap", change)
    assert compare(path, source, task).rolled == pytest.approx(0.2, abs=0.051)


def test_what_is_no_bag(tmp_path, bag):
    """A missing, a torn and an unknown file, and a folder without metadata."""
    (tmp_path / "torn.mcap").write_bytes(bag.read_bytes()[:5000])
    (tmp_path / "none.mcap").write_bytes(b"nothing")
    (tmp_path / "x.txt").write_text("")
    for name, why in {
        "torn.mcap": "is not a readable bag",
        "none.mcap": "is not a readable bag",
        "x.txt": "is not a bag",
        ".": "is not a bag: metadata.yaml: No such file or directory; expected",
        "gone": "no such file or folder",
    }.items():
        with pytest.raises(RunError, match=why):
            list(read_bag(tmp_path / name))


def test_the_command(bag, run, monkeypatch, capsys):
    """`tdac verify RUN --recorded BAG` prints it; other flags are refused."""

    def tdac(*words):
        monkeypatch.setattr("sys.argv", ["tdac", *map(str, words)])
        with pytest.raises(SystemExit) as done:
            main()
        return done.value.code, capsys.readouterr()

    code, printed = tdac("verify", run, "--recorded", bag)
    assert code == 0
    assert "as the controller: no other command" in printed.out
    code, printed = tdac("verify", run, "--recorded", bag, "--paper")
    assert code == 2
    assert printed.err == "error: --recorded runs no test: leave out --paper\n"


@pytest.mark.slow
def test_a_recorded_simulation(source, task, settings, package, tmp_path):
    """A drive over DDS with a fault is replayed to the last command, with its stop."""
    pytest.importorskip("cyclonedds", reason="no wheel of Cyclone DDS")
    from test_ros_drive import NodeProcess

    from tdac_agent.ros2.dds import Bus
    from tdac_agent.ros2.simulator import Simulator

    domain, bag = 10 + os.getpid() % 9, Bag()
    with NodeProcess(package, domain):
        simulator = Simulator(
            Robot(task, settings, dead_man=0.3),
            Bus(domain),
            faults=(Fault("nan-scans", 2.0, 1.5),),
            patience=30.0,
            bag=bag,
        )
        drove = simulator.run(60.0)
    (tmp_path / "sim.mcap").write_bytes(bag.finish())
    report = compare(tmp_path / "sim.mcap", source, task)
    assert drove.outcome == "reached"
    assert report.same == report.commands
    assert report.stops == drove.stops == 1
    assert 1.0 < report.stopped < 1.6
    assert dataclasses.asdict(report)["different"] == 0
