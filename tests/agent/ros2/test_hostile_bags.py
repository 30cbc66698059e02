"""A bag of a stranger costs one line: no hang, no full memory, no other file."""

import contextlib
import dataclasses
import math
import os
import sqlite3
import struct

import numpy as np
import pytest

pytest.importorskip("mcap", reason="mcap is not installed")
pytest.importorskip("rosbags", reason="rosbags is not installed")

import lz4.frame
import zstandard
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from tdac_agent.cli.play import drive
from tdac_agent.errors import RunError
from tdac_agent.ros2.bag import Bag, write_bag
from tdac_agent.ros2.read_bag import SCAN, read_bag
from tdac_agent.ros2.recorded import compare

TYPES = get_typestore(Stores.ROS2_JAZZY)
ZEROS, TIMES, MOST = bytes(1_000_000), 1500, 700_000_000
"""A bomb unpacks to 1.5 GB; 0.7 GB are allowed."""


@pytest.fixture(scope="module")
def bag(run, task, tmp_path_factory):
    """The bag of the nominal episode."""
    source = (run / "controller.py").read_bytes()
    path = tmp_path_factory.mktemp("bag") / "drive.mcap"
    write_bag(path, task, drive(task, source, "nominal", "auto"))
    return path


def folder_of(bag, folder, plugin=StoragePlugin.SQLITE3, mode=None):
    """The bag as a folder of rosbag2."""
    connections = {}
    writer = Writer(folder, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        for each in read_bag(bag)[:200]:
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(
                    each.topic, each.kind, typestore=TYPES
                )
            data = TYPES.serialize_cdr(each.message, each.kind)
            writer.write(connections[each.topic], round(each.time * 1e9), data)
    return folder


def refused(path, why, most=MOST):
    """It costs one line."""
    with pytest.raises(RunError, match=why) as caught:
        read_bag(path, most)
    assert "\n" not in str(caught.value)


def chunk(compression, packed, size):
    """An MCAP file with one chunk."""
    name = compression.encode()
    body = struct.pack("<QQQI", 0, 1, size, 0) + struct.pack("<I", len(name)) + name
    body += struct.pack("<Q", len(packed)) + packed
    magic = b"\x89MCAP0\r\n"
    header = struct.pack("<I", 4) + b"ros2" + struct.pack("<I", 0)
    footer = struct.pack("<QQI", 0, 0, 0)
    records = ((1, header), (6, body), (2, footer))
    data = b"".join(struct.pack("<BQ", op, len(part)) + part for op, part in records)
    return magic + data + magic


def packed_zeros(kind):
    """Zeros that unpack to 1.5 GB, as Zstandard or LZ4."""
    if kind == "zstd":
        packer = zstandard.ZstdCompressor().compressobj(size=len(ZEROS) * TIMES)
        parts = [packer.compress(ZEROS) for _ in range(TIMES)]
        return b"".join([*parts, packer.flush()])
    packer = lz4.frame.LZ4FrameCompressor()
    parts = [packer.begin()] + [packer.compress(ZEROS) for _ in range(TIMES)]
    return b"".join([*parts, packer.flush()])


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="no limit here")
@pytest.mark.parametrize("kind", ["zstd", "lz4"])
def test_a_chunk_that_unpacks_to_much(tmp_path, kind):
    """Some MB that would need more memory than is allowed."""
    path = tmp_path / "bomb.mcap"
    path.write_bytes(chunk(kind, packed_zeros(kind), len(ZEROS) * TIMES))
    assert path.stat().st_size < 10_000_000
    refused(path, "needs more than 0.7 GB of memory|Failed to resize buffer")


def test_a_chunk_that_declares_much(tmp_path):
    """A size in a header is not believed."""
    path = tmp_path / "bomb.mcap"
    path.write_bytes(chunk("zstd", zstandard.compress(b"x"), 2**50))
    refused(path, "needs more than|is not a readable bag")


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="no limit here")
def test_a_folder_that_unpacks_to_much(bag, tmp_path):
    """A file that is packed as a whole is unpacked only up to the limit."""
    folder = folder_of(bag, tmp_path / "bag", mode=CompressionMode.FILE)
    assert len(read_bag(folder)) > 100
    file = next(folder.glob("*.zstd"))
    file.write_bytes(packed_zeros("zstd"))
    refused(folder, "is not a readable bag|needs more than")


@pytest.mark.parametrize("kind", ["pipe", "link", "device", "gone", "folder"])
def test_files_that_are_none(bag, tmp_path, kind):
    """Nothing is read that is not a regular file of the folder, so nothing blocks."""
    folder = folder_of(bag, tmp_path / "bag")
    file = next(folder.glob("*.db3"))
    if kind == "link":
        file.rename(tmp_path / "elsewhere.db3")
        file.symlink_to(tmp_path / "elsewhere.db3")
    else:
        file.unlink()
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "folder":
        file.mkdir()
    refused(folder, "is not a regular file")


@pytest.mark.parametrize("kind", ["pipe", "link", "huge", "bomb", "list", "empty"])
def test_metadata_that_is_none(bag, tmp_path, kind):
    """So is its metadata."""
    folder = folder_of(bag, tmp_path / "bag")
    file = folder / "metadata.yaml"
    file.unlink()
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "link":
        file.symlink_to("/dev/zero")
    elif kind == "huge":
        with file.open("wb") as empty:
            empty.truncate(10**9)
    else:
        nested = "".join(
            f"a{i + 1}: &a{i + 1} [" + ", ".join([f"*a{i}"] * 9) + "]\n"
            for i in range(9)
        )
        text = {"bomb": f"a0: &a0 [x]\n{nested}", "list": "[1, 2]\n", "empty": ""}
        file.write_text(text[kind])
    refused(folder, "is not a bag: metadata.yaml")
    pipe = tmp_path / "pipe.mcap"
    os.mkfifo(pipe)
    refused(pipe, "not a regular file")


def test_a_database_with_rows_without_end(bag, tmp_path):
    """A view instead of a table could have them."""
    folder = folder_of(bag, tmp_path / "bag")
    file = next(folder.glob("*.db3"))
    with sqlite3.connect(file) as database:
        database.execute("ALTER TABLE messages RENAME TO old")
        database.execute(
            "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT "
            "i + 1 FROM n) SELECT i AS id, 1 AS topic_id, i AS timestamp, x'' AS data "
            "FROM n"
        )
    database.close()
    refused(folder, "has no tables messages and topics")


def test_a_message_of_another_type(tmp_path):
    """Bytes that are not what their topic says."""
    out = Bag()
    out.write_data("/scan", 1.0, SCAN, b"\0\1\0\0" + bytes(7))
    (tmp_path / "x.mcap").write_bytes(out.finish())
    refused(tmp_path / "x.mcap", "is not a readable bag")


def test_any_damage_costs_one_line(bag, tmp_path):
    """Random changes: the messages, or the error of a bag that is none."""
    random, data = np.random.default_rng(0), bag.read_bytes()
    path = tmp_path / "x.mcap"
    for _ in range(20):
        changed = bytearray(data[: random.integers(8, len(data))])
        if random.random() < 0.7:
            changed = bytearray(data)
        for at in random.integers(0, len(changed), 6):
            changed[at] = random.integers(256)
        path.write_bytes(changed)
        with contextlib.suppress(RunError):
            read_bag(path, 4_000_000_000)


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e308])
def test_numbers_that_are_none(bag, run, task, tmp_path, value):
    """Poses, commands and ranges that are not finite, or huge: finite figures."""

    def change(number, each):
        message = each.message
        if number % 7 == 0 and each.topic == "/cmd_vel":
            message.linear.x = value
        elif number % 7 == 1 and each.topic == "/tf":
            message.transforms[0].transform.translation.x = value
        elif number % 7 == 2 and each.topic == "/scan":
            ranges = [max(min(value, 3e38), -3e38)] * len(message.ranges)
            message.ranges = np.array(ranges, np.float32)
        elif number % 7 == 3 and each.topic == "/tf":
            message.transforms[0].transform.rotation.w = value

    out = Bag()
    for number, each in enumerate(read_bag(bag)):
        change(number, each)
        data = TYPES.serialize_cdr(each.message, each.kind)
        out.write_data(each.topic, each.time, each.kind, data)
    (tmp_path / "x.mcap").write_bytes(out.finish())
    report = compare(tmp_path / "x.mcap", (run / "controller.py").read_bytes(), task)
    figures = dataclasses.asdict(report)
    assert report.different > 0
    for name in ("seconds", "stopped", "way", "map_gap", "scan_gap"):
        assert figures[name] is None or math.isfinite(figures[name]), name
