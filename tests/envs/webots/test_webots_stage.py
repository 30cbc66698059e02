"""Stages: what a world file becomes for a controller, without running one."""

import math

import numpy as np
import pytest

from tdac_envs import bundled_worlds
from tdac_envs.core.errors import WorldError
from tdac_envs.webots.controller import Robot
from tdac_envs.webots.motors import MotorState
from tdac_envs.webots.server import StepServer
from tdac_envs.webots.stage import open_stage
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.wbt.fields import numbers
from tdac_envs.worlds.wbt.frames import axis_angle

ODD = """#VRML_SIM R2025a utf8
Pose { translation 0.1 0.2 0 rotation 0 0 1 0.5 children [
  E-puck { translation 0.2 0 0 rotation 0 0 1 0.25 supervisor TRUE
    turretSlot [ GPS { name "my gps" translation 0.01 0 0 } Lidar { name "scan" } ] }
] }
Rock { translation 0.8 0.5 0 scale 1.5 }
Dragon { translation 1 2 scale "big" }
"""


@pytest.mark.parametrize("name", bundled_worlds())
def test_the_start_is_as_the_file_says(name):
    """Pose in the file's coordinates, whatever its version: as it is written."""
    stage = open_stage(world_file(name))
    assert stage.has_goal
    x, y, heading = stage.world.robot.pose
    node = stage.robot
    written = numbers(node, "translation", (0.0, 0.0, 0.0))
    assert stage.frame.point(x, y) == pytest.approx(written, abs=1e-6)
    turn = axis_angle(*numbers(node, "rotation", (0.0, 0.0, 1.0, 0.0)))
    assert np.allclose(stage.frame.rotation(heading), turn, atol=1e-6)
    assert np.allclose(axis_angle(*stage.frame.axis_angle(heading)), turn, atol=1e-6)
    assert len(stage.scene.nodes) > len(stage.world.obstacles)


def test_things_that_can_be_pushed_have_their_nodes():
    """As many as the environment has, each where its node is."""
    stage = open_stage(world_file("crates"))
    env = stage.make_env()
    env.reset(seed=0)
    things = env.things()
    assert len(stage.movables) == len(things) > 0
    for movable, (x, y, turn) in zip(stage.movables, things.tolist(), strict=True):
        assert movable.place(x, y, turn) is None
        at, rotation = movable.place(x + 0.1, y, 0.2)
        node = stage.scene.nodes[stage.scene.number(movable.node)]
        fields = {name: value for name, _, value in node.fields}
        assert at == pytest.approx(np.add(fields["translation"], (0.1, 0, 0)), abs=1e-3)
        turned = axis_angle(0, 0, 1, 0.2) @ axis_angle(*fields["rotation"])
        assert np.allclose(axis_angle(*rotation), turned, atol=1e-6)


def test_odd_worlds(tmp_path):
    """Nested robots, fields of other types than usual, devices without a model."""
    file = tmp_path / "odd.wbt"
    file.write_text(ODD)
    stage = open_stage(file, ignore=["Dragon"])
    assert not stage.has_goal
    x, y, heading = stage.world.robot.pose
    assert heading == pytest.approx(0.75)
    assert stage.frame.point(x, y) == pytest.approx(
        (0.1 + 0.2 * math.cos(0.5), 0.2 + 0.2 * math.sin(0.5), 0.0)
    )
    gps = [device for device in stage.devices if device.kind == "GPS"]
    assert [(d.name, d.offset) for d in gps] == [
        ("my gps", (pytest.approx(0.0005), 0.0, 0.0486))
    ]
    assert [scanner.name for scanner in stage.scanners] == ["scan"]
    types = {node.kind: node.base for node in stage.scene.nodes}
    assert types["Rock"] == "Solid"
    assert types["Dragon"] == "Dragon"


def test_the_farthest_place_stands_for_a_goal(tmp_path):
    """In a world without one it is far away and free; none is reached there."""
    file = tmp_path / "bare.wbt"
    file.write_text(
        "#VRML_SIM R2025a utf8\nRectangleArena { floorSize 2 0.2 }\n"
        "E-puck { translation -0.9 0 0 }\n"
    )
    stage = open_stage(file)
    assert not stage.has_goal
    assert stage.world.goal[0] > 0.9
    assert stage.make_env().nominal.shortest > 1.8


def test_there_has_to_be_a_robot(tmp_path):
    """A world without an e-puck is refused."""
    file = tmp_path / "empty.wbt"
    file.write_text("#VRML_SIM R2025a utf8\n")
    with pytest.raises(WorldError, match="there is no e-puck in it"):
        open_stage(file)


def test_the_package_needs_a_simulation():
    """Outside of a run a robot says how to get one."""
    with pytest.raises(RuntimeError, match="run this controller with `tdac"):
        Robot()


class TestMotor:
    def test_full_gains(self):
        """Proportional, integral and derivative parts, against their definition."""
        motor = MotorState(limit=100.0, pid=(3.0, 2.0, 0.1))
        motor.set_position(1.0)
        angle, total, before, dt = 0.0, 0.0, 0.0, 0.016
        for _ in range(50):
            error = 1.0 - angle
            total += error * dt
            wanted = 3.0 * error + 2.0 * total + 0.1 * (error - before) / dt
            before = error
            speed = motor.next_speed(angle, dt)
            assert speed == pytest.approx(wanted)
            angle += speed * dt

    def test_direction_comes_from_the_target(self):
        """In position control the velocity is a bound, whatever its sign was."""
        motor = MotorState(limit=6.28)
        motor.set_position(math.inf)
        assert motor.set_velocity(-2.0) is None
        assert motor.next_speed(0.0, 0.032) == -2.0
        motor.set_position(5.0)
        assert motor.next_speed(0.0, 0.032) == 2.0
        assert motor.next_speed(9.0, 0.032) == -2.0


def test_renamed_motors(tmp_path):
    """A Robot may call its wheel motors otherwise; each drives its wheel."""
    joints = " ".join(
        f'HingeJoint {{ device [ RotationalMotor {{ name "{side}_motor" }} ] }}'
        for side in ("left", "right")
    )
    file = tmp_path / "w.wbt"
    robot = f'Robot {{ model "e-puck" children [ {joints} ] }}'
    file.write_text(f"#VRML_SIM R2025a utf8\nFloor {{ }}\n{robot}\n")
    stage = open_stage(file)
    server = StepServer(stage.make_env(steps=50), stage)
    facts = {device["name"]: device for device in server.reset()["devices"]}
    assert facts["left_motor"]["sensor"] == "left wheel sensor"
    speeds = ("left_motor", 1.0), ("right_motor", 3.0)
    commands = [(name, "position", math.inf) for name, _ in speeds]
    commands += [(name, "velocity", speed) for name, speed in speeds]
    server.step((320, commands, None))
    x, _, heading = server.log.poses[-1]
    assert heading == pytest.approx(2.0 * 0.02 / 0.057 * 0.32, rel=1e-5)
    assert x > 0.01


MISSING = """#VRML_SIM R2025a utf8
RectangleArena { floorSize 2 2 }
E-puck {
  gpsSlot [ GPS { } ]
  turretSlot [
    TouchSensor { name "bumper" boundingObject Box { size 0.1 0.1 0.1 } }
    Hokuyo { }
    GPS { }
    Pose { children [ Microphone { } Display { name "screen" } ] }
  ]
  groundSensorsSlot [ E-puckGroundSensors { } TouchSensor { } ]
}
"""


def test_missing_devices_are_named_before_the_run(tmp_path):
    """One line for those without data, and one for each node that is not read."""
    file = tmp_path / "w.wbt"
    file.write_text(MISSING)
    stage = open_stage(file)
    slot, silent, unknown = stage.notes
    assert slot.startswith("line 4: field 'gpsSlot' of E-puck is not used")
    for name in ("TouchSensor 'bumper'", "Microphone 'microphone'", "Display 'screen'",
                 "TouchSensor 'touch sensor'"):  # fmt: skip
        assert name in silent
    assert "GPS" not in silent
    assert unknown.startswith("not modelled on the robot: Hokuyo;")


def test_a_thousand_missing_devices_are_two_lines(tmp_path):
    """Of many, the first ones are named."""
    many = " ".join(f'Pen {{ name "{k}" }} Odd{k} {{ }}' for k in range(999))
    file = tmp_path / "w.wbt"
    file.write_text(MISSING.replace("Hokuyo { }", many))
    notes = open_stage(file).notes[1:]
    assert len(notes) == 2
    assert all(len(note) < 800 and " more; getDevice" in note for note in notes)


@pytest.mark.parametrize("name", bundled_worlds())
def test_nothing_is_missing_in_bundled_worlds(name):
    """The standard devices of an e-puck need no note."""
    stage = open_stage(world_file(name))
    assert not any("not modelled:" in note or "line " in note for note in stage.notes)
