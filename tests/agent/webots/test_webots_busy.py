"""A machine that is busy with other work makes no verdict on a Webots controller."""

import os
from pathlib import Path

import pytest

WORLD = """#VRML_SIM R2025a utf8
WorldInfo { basicTimeStep 16 }
RectangleArena { floorSize 2 2 }
E-puck { }
"""
WORKING = """
import time
from controller import Robot

robot = Robot()
while robot.step(16) != -1:
    end = time.process_time() + 0.003
    while time.process_time() < end:
        pass
"""


@pytest.mark.slow
@pytest.mark.skipif(
    not Path("/proc/self/schedstat").exists(), reason="the kernel does not tell"
)
def test_waiting_for_a_cpu_is_not_the_controllers_time(tdac, crowd):
    """1.2 s of work in small pieces are within 2.5 s, however long they take."""
    Path("w.wbt").write_text(WORLD)
    Path("working.py").write_text(WORKING)
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {crowd})
    try:
        words = ("working.py", "w.wbt", "--steps", 400, "--seconds", 2.5)
        code, out, err = tdac("webots", "run", *words)
    finally:
        os.sched_setaffinity(0, before)
    assert code == 0, out + err
