"""Drives an exported ROS 2 package many times over DDS, with faults and under load.

    python -m benchmarks.ros_drives runs/depot-1 depot_drive --drives 200 --real 20

Each drive with faults draws two of the robot and its sensors, and one of the node:
none, killed and started again, frozen for a second, or ended and started again.
Each drive in real time runs next to four busy loops. It prints a line per drive, and
ends with 1 if the robot touched anything, or went on farther than is stated.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np

from tdac_agent.ros2.dds import Bus
from tdac_agent.ros2.export import core_settings, settings_of
from tdac_agent.ros2.faults import STOPPING, drawn_faults
from tdac_agent.ros2.robot import Robot
from tdac_agent.ros2.simulator import Simulator
from tdac_agent.runs.ownership import load_task

NODE_FAULTS = ("none", "killed", "frozen", "ended")
FORKS = multiprocessing.get_context("forkserver")
PATIENCE = 3.0
"""Longest wait for a command in simulated time, s."""
AWAY = 1.0
"""Time for which a node is gone or frozen, s of the drive."""


class NodeFault:
    """A fault of the node's process, as a watch of the simulator."""

    def __init__(self, kind, begin, start):
        self.kind, self.begin, self._start = kind, begin, start
        self.process = start()
        self.way, self.stood, self._over = None, None, kind == "none"

    def __call__(self, robot):
        if self._over:
            return
        if self.way is None and robot.time >= self.begin:
            numbers = {"killed": signal.SIGKILL, "frozen": signal.SIGSTOP}
            self.process.send_signal(numbers.get(self.kind, signal.SIGTERM))
            if self.kind != "frozen":
                self.process.wait()
            self.way = robot.way
        elif self.way is not None:
            if self.stood is None and robot.stands:
                self.stood = robot.way - self.way
            if robot.time >= self.begin + AWAY:
                self._over = True
                if self.kind == "frozen":
                    self.process.send_signal(signal.SIGCONT)
                else:
                    self.process = self._start(any_start=True)

    def end(self):
        """Ends the process."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()


class NodeProcess:
    """A node in a process of its own, forked from one that has all imports."""

    def __init__(self, package, domain, *, real_time=False, any_start=False):
        how = {"sim_time": not real_time, "any_start": any_start, "recover": True}
        self._process = FORKS.Process(target=run_node, args=(package, domain, how))
        self._process.start()

    def send_signal(self, number):
        """Sends a signal, unless it has ended."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._process.pid, number)

    def wait(self):
        """Waits for its end."""
        self._process.join()


def run_node(package, domain, how):
    """Drives, as `tdac ros drive` does."""
    from tdac_agent.ros2.drive import Node, open_package

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    opened = open_package(package)
    dead_man = 3 * opened.settings["dt"]
    with contextlib.suppress(KeyboardInterrupt):
        Node(opened, Bus(domain), dead_man=dead_man, **how).run(600.0)


@contextlib.contextmanager
def busy_loops(count):
    """Processes that need a CPU all the time."""
    command = [sys.executable, "-c", "while True: pass"]
    own = [subprocess.Popen(command) for _ in range(count)]
    try:
        yield
    finally:
        for each in own:
            each.kill()
            each.wait()


def fault_drive(task, settings, package, seed, bus, domain):
    """A drive with faults; returns its report and what went too far."""
    random = np.random.default_rng(seed)
    kind = NODE_FAULTS[int(random.integers(len(NODE_FAULTS)))]
    seconds = float(random.uniform(2.0, 12.0))
    node = NodeFault(kind, seconds, partial(NodeProcess, package, domain))
    robot = Robot(task, settings, dead_man=3 * settings["dt"])
    try:
        simulator = Simulator(
            robot,
            bus,
            faults=drawn_faults(seed, 2, 15.0),
            watch=node,
            patience=PATIENCE,
        )
        report = simulator.run(600.0)
    finally:
        node.end()
    stated = core_settings(settings, dead_man=3 * settings["dt"]).stops_within()
    gone = stated["the node is killed, frozen or unreachable"]
    far = [
        str(course)
        for course in report.faults
        if course["kind"] in STOPPING
        and course["way"] > stated[STOPPING[course["kind"]]]
    ]
    if node.stood is not None and node.stood > gone:
        far.append(f"{kind}: {node.stood:.3f} m")
    return kind, report, far


def real_drive(task, settings, package, bus, domain):
    """A drive in real time next to busy loops."""
    node = NodeProcess(package, domain, real_time=True)
    robot = Robot(task, settings, dead_man=3 * settings["dt"])
    try:
        with busy_loops(4):
            return Simulator(robot, bus, real_time=True).run(600.0)
    finally:
        node.send_signal(signal.SIGKILL)
        node.wait()


def main():
    """Drives, and prints what happened."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("package", type=Path)
    parser.add_argument("--drives", type=int, default=200)
    parser.add_argument("--real", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    options = parser.parse_args()
    FORKS.set_forkserver_preload(["tdac_agent.ros2.drive"])
    task, domain = load_task(options.run), 10 + os.getpid() % 80
    settings, bus = settings_of(task), Bus(domain)
    outcomes, wrong, smallest = Counter(), 0, 9.0
    for seed in range(options.first, options.first + options.drives):
        began = time.monotonic()
        kind, report, far = fault_drive(
            task, settings, options.package, seed, bus, domain
        )
        outcomes[f"faults: {report.outcome}"] += 1
        smallest = min(smallest, report.smallest_gap)
        wrong += bool(report.contact or far)
        faults = " ".join(
            f"{c['kind']}@{c['begin']:g}+{c['lasts']:g}:{c['way']:.3f}"
            for c in report.faults
        )
        print(
            f"seed {seed}: {report.outcome}, {report.stops} stops, gap "
            f"{1000 * report.smallest_gap:.0f} mm, node {kind}, {faults}, "
            f"{time.monotonic() - began:.0f} s {' '.join(far)}",
            flush=True,
        )
    for number in range(options.real):
        report = real_drive(task, settings, options.package, bus, domain)
        outcomes[f"real time: {report.outcome}"] += 1
        smallest = min(smallest, report.smallest_gap)
        wrong += bool(report.contact)
        print(
            f"real time {number}: {report.outcome}, {report.stops} stops, gap "
            f"{1000 * report.smallest_gap:.0f} mm",
            flush=True,
        )
    print(json.dumps({**outcomes, "wrong": wrong, "smallest_gap": smallest}))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
