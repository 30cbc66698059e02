"""`tdac play --mcap` writes what two independent readers read."""

import math

import numpy as np
import pytest
from floor_task import write_task

pytest.importorskip("mcap", reason="mcap is not installed")
pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tdac_agent import load_task
from tdac_agent.cli.play import drive
from tdac_agent.ros2.bag import check_bag, write_bag
from tdac_agent.ros2.package.motion import yaw_of
from tdac_envs.core.errors import TaskError

TOPICS = {
    "/cmd_vel": "geometry_msgs/msg/Twist",
    "/goal": "geometry_msgs/msg/PoseStamped",
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/path": "nav_msgs/msg/Path",
    "/plan": "nav_msgs/msg/Path",
    "/pose": "geometry_msgs/msg/PoseStamped",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
}


@pytest.fixture(scope="module")
def rollout(task, run):
    """The nominal episode."""
    return drive(task, (run / "controller.py").read_bytes(), "nominal", "auto")


@pytest.fixture(scope="module")
def bag(task, rollout, tmp_path_factory):
    """Its file."""
    path = tmp_path_factory.mktemp("bag") / "drive.mcap"
    write_bag(path, task, rollout)
    return path


@pytest.fixture(scope="module")
def read(bag):
    """The messages of each topic, as mcap-ros2-support decodes them."""
    found = {}
    with bag.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, message, own in reader.iter_decoded_messages():
            assert TOPICS[channel.topic] == schema.name
            found.setdefault(channel.topic, []).append((message.log_time * 1e-9, own))
    return found


def test_topics_and_counts(read, steps):
    """A pose, a scan and a transform for each moment; a command for each step."""
    assert read.keys() == TOPICS.keys()
    counts = {topic: len(each) for topic, each in read.items()}
    for topic in ("/pose", "/scan", "/tf", "/cmd_vel"):
        assert counts[topic] == steps + 1
    for topic in ("/map", "/goal", "/plan", "/path", "/tf_static"):
        assert counts[topic] == 1
    assert math.isclose(read["/pose"][-1][0], 1.0 + 0.1 * steps)


def test_poses_are_those_of_the_episode(read, rollout, task):
    """Places in metres of the map's frame, headings counter-clockwise."""
    seen = [task.setting.view._poses(pose) for pose in rollout.trajectory.poses]
    for (_, own), expected in zip(read["/pose"], seen, strict=True):
        place, turn = own.pose.position, own.pose.orientation
        assert np.allclose((place.x, place.y), expected[:2], atol=1e-5)
        yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
        assert math.isclose(math.cos(yaw - expected[2]), 1.0, abs_tol=1e-6)
    way = [(p.pose.position.x, p.pose.position.y) for p in read["/path"][0][1].poses]
    assert np.allclose(way, [pose[:2] for pose in seen], atol=1e-5)


def test_scans_end_at_walls(read, task):
    """Each range, from the scanner's place on the map, ends at an occupied cell."""
    grid = task.setting.nominal.terrain.grid
    (_, world) = read["/map"][0]
    cells = np.array(world.data, np.int8).reshape(world.info.height, world.info.width)
    assert np.array_equal(cells[::-1] == 100, grid.cells)
    mount = read["/tf_static"][0][1].transforms[0].transform.translation
    assert math.isclose(mount.x, -0.03)
    corner, size = world.info.origin.position, world.info.resolution
    for (_, scan), (_, pose) in zip(
        read["/scan"][::20], read["/pose"][::20], strict=True
    ):
        turn = pose.pose.orientation
        yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
        x = pose.pose.position.x + mount.x * math.cos(yaw)
        y = pose.pose.position.y + mount.x * math.sin(yaw)
        hits = 0
        for i, length in enumerate(scan.ranges):
            if not scan.range_min < length < scan.range_max:
                continue
            angle = yaw + scan.angle_min + i * scan.angle_increment
            column = (x + (length + 0.002) * math.cos(angle) - corner.x) / size
            row = (y + (length + 0.002) * math.sin(angle) - corner.y) / size
            near = cells[max(int(row - 0.1), 0) : int(row + 0.1) + 1]
            near = near[:, max(int(column - 0.1), 0) : int(column + 0.1) + 1]
            assert near.max() == 100
            hits += 1
        assert hits > 30


def test_commands_drive_the_same_way(read, steps):
    """The commands, integrated as arcs, lead from each pose to the next."""
    poses = [own.pose for _, own in read["/pose"]]
    for step in range(steps):
        _, command = read["/cmd_vel"][step]
        v, omega = command.linear.x, command.angular.z
        before, after = poses[step], poses[step + 1]
        turn = before.orientation
        yaw = yaw_of(turn.x, turn.y, turn.z, turn.w) + 0.05 * omega
        chord = 0.1 * v * np.sinc(0.05 * omega / math.pi)
        x = before.position.x + chord * math.cos(yaw)
        y = before.position.y + chord * math.sin(yaw)
        assert math.dist((x, y), (after.position.x, after.position.y)) < 2e-5
    last = read["/cmd_vel"][-1][1]
    assert (last.linear.x, last.angular.z) == (0.0, 0.0)


@pytest.mark.parametrize("store", [Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY])
def test_rosbags_reads_the_same(bag, read, store):
    """Its messages, with the definitions of Humble, of Jazzy, and of the file."""
    types, count = get_typestore(store), 0
    with bag.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            own = types.deserialize_cdr(message.data, schema.name)
            if channel.topic == "/scan":
                _, expected = read["/scan"][count]
                assert own.ranges.tolist() == list(expected.ranges)
                count += 1
            fields = get_types_from_msg(schema.data.decode(), schema.name)
            assert fields[schema.name][1] == types.fielddefs[schema.name][1]
    assert count == len(read["/scan"])


def test_what_has_no_metres_is_refused(tmp_path, task):
    """One line, before anything is driven."""
    with pytest.raises(TaskError, match=r"must end in \.mcap"):
        check_bag(task, tmp_path / "drive.bag")
    with pytest.raises(TaskError, match="maze has no metres"):
        check_bag(load_task("maze"), tmp_path / "drive.mcap")
    with pytest.raises(TaskError, match="has no metres"):
        check_bag(load_task("epuck-crates"), tmp_path / "drive.mcap")


def test_movers_and_contacts(tmp_path):
    """A drive into a wall has a contact; movers are written where they are."""
    spec = {"movers": [{"kind": "bounce", "count": 2, "speed": 0.1, "radius": 0.1}]}
    task = load_task(write_task(tmp_path, **spec))
    source = b"def policy(obs):\n    return 1.0, 1.0\n"
    rollout = drive(task, source, "nominal", "auto")
    assert rollout.outcome == "collision"
    write_bag(tmp_path / "x.mcap", task, rollout)
    counts = {}
    with (tmp_path / "x.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, own in reader.iter_decoded_messages():
            counts.setdefault(channel.topic, []).append(own)
    assert len(counts["/contacts"]) == 1
    assert len(counts["/movers"]) == rollout.trajectory.steps + 1
    assert all(len(own.poses) == 2 for own in counts["/movers"])
