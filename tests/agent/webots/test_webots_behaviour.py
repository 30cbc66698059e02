"""The `controller` package behaves as Webots does, call by call."""

import math
from dataclasses import replace

import numpy as np
import pytest
from worlds_for_controllers import BLOCKED, HEAD, NUE, OPEN, PLAIN

from tdac_envs.epuck.infrared import TABLE
from tdac_envs.webots.controller.pose import rotation_matrix
from tdac_envs.worlds.world import AXLE_LENGTH

BEGIN = """
import math
from controller import Robot, Supervisor, Motor, DistanceSensor, Field, Node
robot = Supervisor()
left, right = (robot.getDevice(f"{s} wheel motor") for s in ("left", "right"))
"""
FREE = """
for motor in (left, right):
    motor.setPosition(math.inf)
    motor.setVelocity(0.0)
"""


@pytest.fixture
def printed(drive):
    """Runs lines after a usual beginning; gives what they print, line by line."""

    def run(lines, world=OPEN, begin=BEGIN, **more):
        report = drive(begin + lines, world, **{"steps": 200, **more}).report
        assert report.error is None, (report.error, report.traceback, report.output)
        return report.output.splitlines()

    return run


class TestDevices:
    def test_unknown_device(self, printed):
        """It is None, and the console says which was not found on which robot."""
        out = printed('print(robot.getDevice("nose"))\n')
        assert out == ['Device "nose" was not found on robot "e-puck"', "None"]

    def test_device_without_a_model(self, printed):
        """It is there; each of its calls is said once and returns nothing."""
        world = OPEN.replace("turretSlot [", 'turretSlot [ Pen { name "ink" }')
        out = printed(
            'pen = robot.getDevice("ink")\n'
            "print([pen.write(True) for _ in range(3)], pen.getName())\n",
            world,
        )
        assert out == [
            "tdac: ink.write() is not supported; it has no effect",
            "[None, None, None] ink",
        ]

    def test_time_of_flight(self, printed):
        """An e-puck 2 measures the distance ahead, in mm, up to 2 m."""
        world = OPEN.replace("supervisor TRUE", 'supervisor TRUE version "2"')
        out = printed(
            'tof = robot.getDevice("tof"); tof.enable(32); robot.step(32)\n'
            "print(tof.getValue(), tof.getType() == tof.GENERIC, "
            "left.getMaxVelocity())\n",
            world,
        )
        reading, *rest = out[-1].split()
        # The wall is at x = 0.7, the sensor 34 mm ahead of x = -0.4.
        table = (0.5, 1.0), (531.9, 1052.0), (1.0, 1.7), (1052.0, 1780.5)
        expected = np.interp(1.066, table[2], table[3])
        assert float(reading) == pytest.approx(expected, abs=0.1)
        assert rest == ["True", "7.536"]

    def test_devices_that_give_nothing(self, printed):
        """Radio and speaker are there and mute, each said once."""
        out = printed(
            'radio = robot.getDevice("receiver")\n'
            "radio.enable(64); radio.enable(32)\n"
            'robot.getDevice("emitter").send("hello")\n'
            'robot.getDevice("speaker").speak("hello", 1.0)\n'
            "print(radio.getQueueLength(), radio.getSamplingPeriod())\n"
        )
        assert out == [
            "tdac: receiver is not modelled; it returns no data",
            "tdac: Emitter.send() is not supported; it has no effect",
            "tdac: Speaker.speak() is not supported; it has no effect",
            "0 32",
        ]

    def test_calls_without_effect_give_neutral_values(self, printed):
        """Calls of Webots' API that are not modelled exist, and return nothing."""
        out = printed(
            'radio, speaker, camera = map(robot.getDevice, ("receiver", "speaker", '
            '"camera"))\n'
            "print(radio.getFloats(), radio.getEmitterDirection(), "
            'speaker.setEngine("pico"), camera.enableRecognitionSegmentation(),\n'
            "      camera.getRecognitionSegmentationImage(), "
            "camera.getRecognitionSamplingPeriod())\n"
        )
        calls = (
            "Receiver.getFloats", "Receiver.getEmitterDirection", "Speaker.setEngine",
            "Camera.enableRecognitionSegmentation",
            "Camera.getRecognitionSegmentationImage",
            "Camera.getRecognitionSamplingPeriod",
        )  # fmt: skip
        said = [f"tdac: {call}() is not supported; it has no effect" for call in calls]
        assert out == [*said, "None (nan, nan, nan) False None None 0"]

    def test_all_devices_can_be_counted(self, printed):
        """By index, in one order, with their names and types."""
        out = printed(
            "n = robot.getNumberOfDevices()\n"
            "names = [robot.getDeviceByIndex(k).getName() for k in range(n)]\n"
            "print(n, len(set(names)), names[0], sorted(robot.devices) == "
            "sorted(names))\n"
            "print(left.getNodeType() == Node.ROTATIONAL_MOTOR, "
            'robot.getDevice("ps0").getNodeType() == Node.DISTANCE_SENSOR)\n'
        )
        assert out == ["42 42 left wheel motor True", "True True"]

    def test_devices_made_by_their_classes(self, printed):
        """The old way: by name, a sensor with its period."""
        out = printed(
            "from controller import GPS\n"
            's = DistanceSensor("ps0", 32); g = GPS("gps")\n'
            "g.sampling_period = 32\n"
            'print(Motor("left wheel motor") is left, s.sampling_period)\n'
            "robot.step(32); print(s.value > 67, g.values[2] > 0.04)\n"
            'print(Motor("nose").getVelocity())\n'
        )
        assert out[:2] == ["True 32", "True True"]
        assert out[2:] == ['Device "nose" was not found on robot "e-puck"', "nan"]

    def test_deprecated_getters(self, printed):
        """They work, with the warning, each time."""
        out = printed('print(robot.getMotor("left wheel motor") is left)\n')
        assert out == [
            "DEPRECATION: Robot.getMotor is deprecated, please use Robot.getDevice "
            "instead.",
            "True",
        ]

    def test_turret_devices_are_there_only_if_the_world_has_them(self, printed):
        """An e-puck without slots has no GPS, compass, inertial or ground sensor."""
        bare = HEAD + "Floor { size 2 2 }\nE-puck { supervisor TRUE }\n"
        names = '("gps", "compass", "inertial unit", "gs0")'
        line = f"print([robot.getDevice(n) is None for n in {names}])\n"
        assert printed(line, bare)[-1] == "[True, True, True, True]"
        assert printed(line)[-1] == "[False, False, False, False]"

    def test_second_robot(self, printed):
        """It complains, has no devices, and steps all the same."""
        out = printed(
            "other = Robot()\n"
            'print(hasattr(other, "devices"), other.getBasicTimeStep(), '
            "other.step(32), other.getTime(), robot.getTime())\n"
        )
        assert out == [
            "Error: only one Robot instance can be created per controller process.",
            "False 32.0 0 0.032 0.032",
        ]


class TestSteps:
    @pytest.mark.slow_after(3)
    @pytest.mark.parametrize(
        ("call", "steps"),
        [
            ("32", 1),
            ("", 1),
            ("64", 2),
            ("2000", 63),
            ("3 * int(robot.getBasicTimeStep())", 3),
            ("50", 2),
            ("1", 1),
            ("0", 0),
        ],
    )
    def test_durations_are_rounded_up_to_steps_of_the_world(self, drive, call, steps):
        """A multiple of basicTimeStep takes that long, others up to the next one."""
        run = drive(f"{BEGIN}print(robot.step({call}), robot.getTime())\n", OPEN)
        assert run.log.steps == steps
        assert run.report.output.splitlines()[-1] == f"0 {0.032 * steps}"
        warned = "is not a multiple of WorldInfo.basicTimeStep" in run.report.output
        assert warned == (call in ("50", "1", "2000"))

    def test_a_basic_step_that_is_no_whole_number(self, drive):
        """Multiples of 0.1 ms are taken for what they are."""
        world = OPEN.replace("basicTimeStep 32", "basicTimeStep 0.1")
        run = drive(f"{BEGIN}robot.step(3); print(robot.step())\n", world, steps=99)
        assert run.log.steps == 30
        assert run.report.output == "0\n"

    def test_a_float_is_no_duration(self, drive):
        """As in Webots, `step(32.0)` and `enable(32.0)` raise."""
        for call in ("robot.step(32.0)", 'robot.getDevice("ps0").enable(32.0)'):
            report = drive(f"{BEGIN}{call}\n", OPEN).report
            assert report.outcome == "error"
            assert "ArgumentError" in report.error
            assert "line 6" in report.error

    def test_the_end_is_minus_one(self, printed):
        """The last step returns -1, and so do those after it."""
        out = printed(
            "count = 0\n"
            "while robot.step(32) != -1:\n    count += 1\n"
            "print(count, robot.step(32), robot.step(32))\n",
            steps=7,
        )
        assert out == ["6 -1 -1"]

    @pytest.mark.parametrize("more", ["robot.step(32)", "pass"])
    def test_who_does_not_leave_is_ended(self, drive, more):
        """A loop that never ends does not hold up the judge, nor change the verdict."""
        report = drive(f"{BEGIN}while True:\n    robot.step(32)\nwhile 1: {more}\n",
                       OPEN, steps=20).report  # fmt: skip
        assert (report.outcome, report.steps, report.error) == ("out of time", 20, None)

    def test_a_program_that_ends_by_itself(self, drive):
        """Neither its end nor `sys.exit` is an error; the goal is not reached."""
        for end in ("", "import sys; sys.exit(0)"):
            report = drive(f"{BEGIN}robot.step(320)\n{end}\n", OPEN).report
            assert report.outcome == "controller ended"
            assert report.why_not == "the goal was not reached (controller ended)"
            assert report.steps == 10

    def test_an_exception_is_told_with_its_line(self, drive):
        """The verdict names type, text and line."""
        report = drive(f"{BEGIN}robot.step(32)\nprint(1 / 0)\n", OPEN).report
        assert report.outcome == "error"
        assert report.error == "ZeroDivisionError at the run (line 7): division by zero"
        assert "print(1 / 0)" in report.traceback


class TestMotors:
    def test_position_control_is_the_beginning(self, drive):
        """Without setPosition(inf) a motor holds 0: a velocity moves nothing."""
        code = (
            f"{BEGIN}left.setVelocity(3.0); right.setVelocity(3.0)\nrobot.step(960)\n"
        )
        report = drive(code, OPEN).report
        assert report.way == 0.0
        assert report.steps == 30

    def test_negative_velocity_in_position_control(self, printed):
        """It is refused with a message, and the velocity stays."""
        out = printed("left.setVelocity(-2.0)\nprint(left.getVelocity())\n")
        assert out == [
            "Error: wb_motor_set_velocity() called with negative 'velocity' argument "
            "in position control mode (0).",
            "6.28",
        ]

    def test_infinite_position_alone_is_full_speed(self, drive):
        """The velocity of a motor is its highest until another is set."""
        code = f"{BEGIN}left.setPosition(math.inf); right.setPosition(math.inf)\n"
        report = drive(code + "robot.step(320)\n", OPEN).report
        assert report.way == pytest.approx(6.28 * 0.02 * 0.32, abs=1e-6)

    def test_nan_is_refused(self, printed):
        """For position and velocity, with the message; nothing changes."""
        out = printed(
            f"{FREE}left.setVelocity(math.nan); left.setPosition(math.nan)\n"
            "print(left.getVelocity(), left.getTargetPosition())\n"
        )
        assert "invalid 'velocity' argument (NaN)" in out[0]
        assert "invalid 'position' argument (NaN)" in out[1]
        assert out[2] == "0.0 inf"

    @pytest.mark.parametrize(("wanted", "got"), [(10.0, 6.28), (-10.0, -6.28)])
    def test_too_fast(self, drive, wanted, got):
        """It is cut to the highest speed, with the warning; the getter keeps it."""
        code = (
            f"{BEGIN}{FREE}left.setVelocity({wanted}); right.setVelocity({wanted})\n"
            "robot.step(64); print(left.getVelocity())\n"
        )
        run = drive(code, OPEN)
        assert (
            f"The requested velocity {wanted:g} exceeds 'maxVelocity' = 6.28."
            in run.report.output
        )
        assert run.report.output.splitlines()[-1] == f"{wanted}"
        assert np.array(run.log.actions) * 6.28 == pytest.approx(got)

    def test_position_control_follows_its_law(self, drive):
        """Each step the speed is 10 times the error, at most the velocity."""
        code = (
            f"{BEGIN}left.setVelocity(4.0); left.setPosition(1.5)\nrobot.step(1600)\n"
        )
        run = drive(code, OPEN)
        angle = 0.0
        for action in run.log.actions:
            speed = min(10.0 * (1.5 - angle), 4.0)
            assert action[0] * 6.28 == pytest.approx(speed, abs=1e-5)
            assert action[1] == 0.0
            angle += speed * 0.032
        assert angle == pytest.approx(1.5, abs=1e-4)

    def test_acceleration(self, drive):
        """The speed changes by no more than it allows."""
        code = f"{BEGIN}{FREE}left.setAcceleration(10.0); left.setVelocity(2.0)\n"
        run = drive(code + "robot.step(320)\n", OPEN)
        speeds = [6.28 * action[0] for action in run.log.actions]
        wanted = [min(0.32 * k, 2.0) for k in range(1, 11)]
        assert speeds == pytest.approx(wanted, abs=1e-6)

    def test_getters(self, printed):
        """Limits, the sensor beside it, and Python's properties."""
        out = printed(
            f"{FREE}left.target_velocity = 1.5\n"
            "print(left.getMaxVelocity(), left.getVelocity(), left.target_position,\n"
            "      left.getAvailableTorque(), left.getMinPosition(), left.getType())\n"
            "print(left.getPositionSensor().getName(), "
            "left.getPositionSensor().getMotor() is left)\n"
            "left.setTorque(0.1); left.setTorque(0.1)\n"
        )
        assert out[0] == "6.28 1.5 inf 10.0 0.0 0"
        assert out[1] == "left wheel sensor True"
        assert out[2:] == ["tdac: Motor.setTorque() is not supported; it has no effect"]


class TestSensors:
    def test_nan_until_the_first_sample(self, printed):
        """Which comes one period after the sensor was enabled."""
        out = printed(
            'a, b = robot.getDevice("ps0"), robot.getDevice("ps1")\n'
            "a.enable(32); b.enable(64)\n"
            "for _ in range(4):\n"
            "    print(math.isnan(a.getValue()), math.isnan(b.getValue()))\n"
            "    robot.step(32)\n"
        )
        assert out == ["True True", "False True", "False False", "False False"]

    def test_a_sample_is_held_between_periods(self, printed):
        """With a period of three steps the value changes at every third."""
        out = printed(
            f"{FREE}right.setVelocity(1.0)\n"
            's = robot.getDevice("right wheel sensor"); s.enable(96)\n'
            "for _ in range(9):\n    robot.step(32); print(s.getValue())\n"
        )
        values = list(map(float, out))
        assert all(map(math.isnan, values[:2]))
        assert values[2] == values[3] == values[4] != values[5]
        assert values[5] == values[6] == values[7] != values[8]

    def test_never_enabled(self, printed):
        """An error, and NaN; the same after disable."""
        out = printed(
            's = robot.getDevice("ps0"); print(s.getValue(), s.getSamplingPeriod())\n'
            "s.enable(32); robot.step(64); print(s.getValue(), s.getSamplingPeriod())\n"
            "s.disable(); robot.step(64); print(s.getValue(), s.getSamplingPeriod())\n"
        )
        error = (
            "Error: wb_distance_sensor_get_value() called for a disabled device! "
            "Please use: wb_distance_sensor_enable()."
        )
        assert out[:2] == [error, "nan 0"]
        assert out[2].startswith("67.19")
        assert out[2].endswith(" 32")
        assert out[3:] == [error, "nan 0"]

    def test_a_long_step_samples_on_its_way(self, printed):
        """After step(2000) a sensor of 500 ms has its fourth or last due sample."""
        out = printed(
            f"{FREE}right.setVelocity(1.0)\n"
            's = robot.getDevice("right wheel sensor"); s.enable(500)\n'
            "robot.step(2000); print(s.getValue())\n"
        )
        # Samples at 512, 1024, 1536 ms; the fourth is due at 2048.
        assert float(out[-1]) == pytest.approx(1.536, abs=0.00628)

    def test_facts_of_distance_sensors(self, printed):
        """Table, limits, aperture and type are those of the e-puck's file."""
        out = printed(
            's = robot.getDevice("ps3")\n'
            "print(s.getMaxValue(), s.getMinValue(), s.getAperture(), "
            "s.getType() == DistanceSensor.INFRA_RED)\n"
            "print(s.getLookupTable())\n"
        )
        assert out[0] == "4095.0 67.19 0.1 True"
        assert eval(out[1]) == pytest.approx(TABLE.ravel().tolist())

    def test_encoders_have_steps(self, printed):
        """Of 0.00628 rad."""
        out = printed(
            f"{FREE}right.setVelocity(1.0)\n"
            's = robot.getDevice("right wheel sensor"); s.enable(32)\n'
            "for _ in range(20):\n    robot.step(32); print(s.getValue())\n"
        )
        for k, value in enumerate(map(float, out), start=1):
            assert value / 0.00628 == pytest.approx(round(value / 0.00628), abs=1e-6)
            assert value == pytest.approx(0.032 * k, abs=0.0032)

    def test_light_sensors(self, printed):
        """Dark without a light; a light in front lowers the reading of the front."""
        lines = (
            'a, b = robot.getDevice("ls0"), robot.getDevice("ls4")\n'
            "a.enable(32); b.enable(32); robot.step(32)\n"
            "print(a.getValue(), b.value)\n"
        )
        assert printed(lines) == ["4095.0 4095.0"]
        lamp = "PointLight { location 10 0 0.0329 intensity 2 }\n"
        (line,) = printed(lines, OPEN + lamp)
        front, back = map(float, line.split())
        # 2 cos(0.3008) of irradiance, mapped from [1, 2] to [4095, 0].
        assert front == pytest.approx(4095.0 * (2.0 - 2.0 * math.cos(0.3008)), abs=5)
        assert back == 4095.0

    def test_accelerometer_and_gyro(self, drive):
        """Gravity at rest, the change of the velocity, and the rate of turn."""
        code = (
            f"{BEGIN}{FREE}"
            "a, g = robot.getDevice('accelerometer'), robot.getDevice('gyro')\n"
            "a.enable(32); g.enable(32); robot.step(32)\n"
            "print([a.getValues(), g.getValues(), g.getLookupTable()[3:5]])\n"
            "left.setAcceleration(10.0); right.setAcceleration(10.0)\n"
            "left.setVelocity(6.0); right.setVelocity(6.0); robot.step(160)\n"
            "print([a.getValues(), g.getValues()])\n"
            "left.setAcceleration(-1); left.setVelocity(-6.0); robot.step(1600)\n"
            "print([a.getValues(), g.getValues()])\n"
        )
        lines = drive(code, OPEN).report.output.splitlines()
        rest, ahead, turning = map(eval, lines)
        assert rest == [[0.0, 0.0, 9.81], [0.0, 0.0, 0.0], [13.3158, 100000.0]]
        assert ahead[0] == pytest.approx([0.2, 0.0, 9.81], abs=1e-3)
        assert ahead[1] == pytest.approx([0.0, 0.0, 0.0], abs=1.0)
        rate = turning[1][2] * 13.3158 / 100000.0
        assert rate == pytest.approx(12.0 * 0.02 / AXLE_LENGTH, rel=1e-3)
        assert turning[0][2] == pytest.approx(9.81)

    def test_where_it_is_in_a_z_up_world(self, drive):
        """GPS (on its turret), inertial unit and compass agree with the judge."""
        code = (
            f"{BEGIN}{FREE}left.setVelocity(2.0); right.setVelocity(3.0)\n"
            "devices = [robot.getDevice(n) for n in ('gps', 'inertial unit',"
            " 'compass')]\n"
            "for d in devices: d.enable(32)\n"
            "g, i, c = devices\n"
            "print(g.getValues(), i.getRollPitchYaw(), g.getSpeed())\n"
            "robot.step(1600)\n"
            "print([*g.getValues(), *i.getRollPitchYaw(), *i.getQuaternion(), "
            "*c.getValues(), g.getSpeed()])\n"
        )
        run = drive(code, OPEN)
        first, last = run.report.output.splitlines()
        assert first == "[nan, nan, nan] [nan, nan, nan] nan"
        x, y, heading = run.log.poses[-1]
        gx, gy, gz, roll, pitch, yaw, qx, qy, qz, qw, cx, cy, cz, speed = eval(last)
        cos, sin = math.cos(heading), math.sin(heading)
        assert (gx, gy) == pytest.approx((x - 0.0095 * cos, y - 0.0095 * sin))
        assert gz == pytest.approx(0.0486)
        assert (roll, pitch, yaw) == pytest.approx((0, 0, heading), abs=1e-9)
        quaternion = (0, 0, math.sin(heading / 2), math.cos(heading / 2))
        assert (qx, qy, qz, qw) == pytest.approx(quaternion, abs=1e-9)
        assert (cx, cy, cz) == pytest.approx((sin, cos, 0), abs=1e-9)
        assert speed == pytest.approx(2.5 * 0.02, rel=1e-3)

    def test_where_it_is_in_a_y_up_world(self, drive):
        """A NUE file has its own coordinates: y is up, and driving on moves there."""
        code = (
            f"{BEGIN}{FREE}left.setVelocity(4.0); right.setVelocity(5.0)\n"
            "g = robot.getDevice('gps'); g.enable(16); me = robot.getSelf()\n"
            "i = robot.getDevice('inertial unit'); i.enable(16)\n"
            "turn = me.getOrientation()\n"
            "robot.step(1600)\n"
            "print([turn, me.getPosition(), me.getOrientation(), g.getValues(), "
            "i.getRollPitchYaw(), me.getField('rotation').getSFRotation()])\n"
        )
        run = drive(code, NUE)
        turn, end, after, gps, angles, rotation = eval(run.report.output)
        spin = 1.6 * 1.0 * 0.02 / AXLE_LENGTH
        radius = 4.5 * AXLE_LENGTH
        ahead, left = radius * math.sin(spin), radius * (1.0 - math.cos(spin))
        assert end == pytest.approx([0.1 + ahead, 0.0, 0.3 - left], abs=1e-6)
        cos, sin = math.cos(spin), math.sin(spin)
        about_y = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
        wanted = about_y @ np.array(turn).reshape(3, 3)
        assert after == pytest.approx(wanted.ravel().tolist(), abs=1e-6)
        offset = wanted @ (-0.0095, 0.0, 0.0486)
        assert gps == pytest.approx(np.add(end, offset).tolist(), abs=1e-6)
        assert gps[1] == pytest.approx(0.0486)
        # Webots' angles for y up are those of axes that look up along y, too.
        assert angles == pytest.approx([-math.pi / 2, 0.0, spin], abs=1e-6)
        assert np.allclose(rotation_matrix(rotation), wanted, atol=1e-6)


class TestSupervisor:
    def test_unknown_names_are_none(self, printed):
        """A DEF name, and a field, that is not there."""
        out = printed(
            'print(robot.getFromDef("NOBODY"), robot.getSelf().getField("wings"), '
            "robot.getFromId(10**6), robot.getFromDef('E-puck'))\n"
        )
        assert out == ["None None None None"]

    def test_root_has_the_nodes_in_their_order(self, printed):
        """Types, base types, DEF names and parents as the file has them."""
        out = printed(
            'children = robot.getRoot().getField("children")\n'
            "nodes = [children.getMFNode(k) for k in range(children.getCount())]\n"
            "print([(n.getTypeName(), n.getBaseTypeName(), n.getDef()) "
            "for n in nodes])\n"
            "print(nodes[3].getType() == Node.ROBOT, nodes[4].getType() == Node.SOLID, "
            "nodes[4].getParentNode().getType() == Node.GROUP, "
            "robot.getFromId(nodes[4].getId()) == nodes[4], nodes[3].isProto(), "
            "nodes[0].getType() == Node.WORLD_INFO, [n.getType() for n in (nodes[3], "
            "nodes[4], robot.getRoot())] == [34, 80, 14])\n",
            BLOCKED,
        )
        assert eval(out[0]) == [
            ("WorldInfo", "WorldInfo", ""),
            ("Viewpoint", "Viewpoint", ""),
            ("RectangleArena", "Solid", ""),
            ("E-puck", "Robot", "EPUCK"),
            ("Solid", "Solid", "GOAL"),
            ("WoodenBox", "Solid", "BOX"),
        ]
        assert out[1] == "True True True True True True True"

    def test_fields(self, printed):
        """Types and values of what is written, and of what is not."""
        out = printed(
            'box = robot.getFromDef("BOX"); me = robot.getSelf()\n'
            'for name in ("translation", "rotation", "size", "name"):\n'
            "    f = box.getField(name); print(f.getTypeName(), f.value, f.getName())\n"
            'f = me.getField("controller"); print(f.getType() == Field.SF_STRING, '
            'f.getSFString(), me.getField("supervisor").getSFBool())\n'
            'print(me.getField("customData").getSFString() == "", '
            'me.getField("turretSlot").getCount(), '
            'me.getField("turretSlot").getMFNode(0).getTypeName())\n'
            "print(type(box.getField('translation').getSFVec3f()), "
            "box.getField('size').getSFVec3f() is box.getField('size').getSFVec3f())\n",
            BLOCKED,
        )
        assert out == [
            "SFVec3f [0.0, 0.0, 0.05] translation",
            "SFRotation [0.0, 0.0, 1.0, 0.3] rotation",
            "SFVec3f [0.1, 0.2, 0.1] size",
            "SFString box name",
            "True mine True",
            "True 3 GPS",
            "<class 'list'> False",
        ]

    def test_poses(self, printed):
        """Position, orientation and pose of robot and things, as they are now."""
        out = printed(
            f"{FREE}left.setVelocity(2.0); right.setVelocity(2.5)\nrobot.step(640)\n"
            'me, box = robot.getSelf(), robot.getFromDef("BOX")\n'
            "print([me.getPosition(), me.getOrientation(), me.getVelocity(), "
            "box.getOrientation(), box.getPose(me), "
            'me.getField("translation").getSFVec3f(), '
            'me.getField("rotation").getSFRotation()])\n',
            BLOCKED,
        )
        at, turn, speed, own, seen, field, rotation = eval(out[-1])
        heading = 0.64 * 0.5 * 0.02 / AXLE_LENGTH
        assert math.atan2(turn[3], turn[0]) == pytest.approx(heading, abs=1e-6)
        assert speed[5] == pytest.approx(0.5 * 0.02 / AXLE_LENGTH, abs=1e-5)
        assert math.hypot(*speed[:2]) == pytest.approx(0.045, rel=1e-3)
        assert own[:2] == pytest.approx([math.cos(0.3), -math.sin(0.3)])
        assert field == at
        assert rotation == pytest.approx([0, 0, 1, heading], abs=1e-6)
        cos, sin = math.cos(heading), math.sin(heading)
        off = np.array([[cos, sin], [-sin, cos]]) @ np.subtract((0.0, 0.0), at[:2])
        assert (seen[3], seen[7], seen[11]) == pytest.approx((*off, 0.05), abs=1e-6)
        assert seen[12:] == [0, 0, 0, 1]

    @pytest.mark.slow
    def test_things_that_are_pushed(self, drive):
        """A supervisor sees them where they are now: ahead of the hull, as pushed."""
        world = BLOCKED.replace("0 0 1 0.3", "0 0 1 0").replace(
            'name "box"', 'name "box"\n  mass 0.02'
        )
        code = (
            f"{BEGIN}{FREE}left.setVelocity(4.0); right.setVelocity(4.0)\n"
            'me, box = robot.getSelf(), robot.getFromDef("BOX")\n'
            "at = box.getField('translation')\n"
            "print([at.getSFVec3f(), box.getPosition()])\n"
            "robot.step(6400)\n"
            "print([at.getSFVec3f(), box.getPosition(), box.getOrientation()[0], "
            "me.getPosition()])\n"
        )
        report = drive(code, world, steps=400, goal=(0.6, 0.3)).report
        first, last = map(eval, report.output.splitlines())
        assert first == [[0.0, 0.0, 0.05]] * 2
        field, place, cos, robot = last
        assert field == place
        assert place[0] - 0.05 == pytest.approx(robot[0] + 0.037, abs=2e-3)
        assert place[0] > 0.05
        assert cos == pytest.approx(1.0, abs=0.02)
        assert report.collisions > 0

    @pytest.mark.parametrize(
        ("field", "call", "said"),
        [
            ("translation", "setSFVec3f((0, 0, 0))", "wrong type or length"),
            ("translation", "setSFVec3f(array)", "wrong type or length"),
            ("translation", "setSFVec3f([0, 0])", "length of 'value' argument"),
            ("rotation", "setSFRotation((0, 0, 1, 0))", "wrong type or length"),
            ("controller", "setSFFloat(1.0)", "wrong type or length"),
            ("customData", "setSFString(5)", "wrong type or length"),
        ],
    )
    def test_setters_are_strict(self, drive, field, call, said):
        """Only a list is stored; else an error is printed, and nothing was written."""
        code = (
            f"{BEGIN}import numpy; array = numpy.zeros(3)\n"
            f'f = robot.getSelf().getField("{field}"); old = f.value\n'
            f"f.{call}\nprint(f.value == old)\nrobot.step(64)\n"
        )
        report = drive(code, OPEN).report
        assert report.teleport is None
        assert report.steps == 2
        error, same = report.output.splitlines()
        assert error.startswith("Error: ")
        assert said in error
        assert same == "True"

    def test_a_float_field_takes_no_int(self, drive):
        """setSFFloat(1) is refused, setSFFloat(1.0) is not."""
        code = (
            f'{BEGIN}f = robot.getRoot().getField("children").getMFNode(0)'
            '.getField("basicTimeStep")\n'
            "f.setSFFloat(1); print(f.getSFFloat())\n"
            "f.setSFFloat(1.0); print(f.getSFFloat(), robot.getBasicTimeStep())\n"
        )
        out = drive(code, OPEN).report.output.splitlines()
        assert out == [
            "Error: new field value has wrong type or length.",
            "32.0",
            "1.0 32.0",
        ]

    def test_harmless_writes(self, drive):
        """A robot's customData, colours and labels are nobody's business."""
        code = (
            f'{BEGIN}f = robot.getSelf().getField("customData")\n'
            'f.setSFString("a"); robot.setCustomData("b"); robot.step(64)\n'
            "print(f.getSFString(), robot.getCustomData(), robot.simulationGetMode())\n"
            'robot.setLabel(0, "x", 0, 0, 0.1, 0xFF0000)\n'
        )
        report = drive(code, OPEN).report
        assert report.teleport is None
        assert report.steps == 2
        assert report.output.splitlines() == [
            "a b 2",
            "tdac: Supervisor.setLabel() is not supported; it has no effect",
        ]

    def test_only_for_supervisors(self, printed):
        """Without `supervisor TRUE` each call prints an error and gives None."""
        out = printed(
            "print(robot.getSelf(), robot.getFromDef('GOAL'), robot.getRoot())\n"
            "robot.simulationReset(); print(robot.getSupervisor(), robot.step(32))\n",
            PLAIN,
        )
        assert out[0] == (
            "Error: ignoring illegal call to wb_supervisor_node_get_self() in a "
            "'Robot' controller."
        )
        assert out[6] == "None None None"
        assert out[-1] == "False 0"

    def test_unsupported_calls_say_so_once(self, printed):
        """And return what means nothing."""
        out = printed(
            "for _ in range(3):\n"
            "    x = robot.getSelf().getContactPoints(), "
            "robot.batterySensorGetValue()\n"
            "    y = robot.movieIsReady(), robot.wwiReceiveText()\n"
            "print(x, y)\n"
        )
        assert len(out) == 5
        assert out[-1] == "((), nan) (True, None)"


class TestFolder:
    def test_arguments_files_and_scratch(self, drive):
        """It starts among its files, with controllerArgs, and may write there."""
        world = OPEN.replace("supervisor TRUE", 'controllerArgs ["a" "b c"]')
        code = (
            "import os, sys, helper\n"
            "from controller import Robot\n"
            "robot = Robot()\n"
            'open("log.csv", "w").write("1,2")\n'
            'print(sys.argv[1:], helper.NAME, open("log.csv").read(), '
            "os.path.exists(robot.getWorldPath()), __name__)\n"
        )
        report = drive(code, world, files={"helper.py": "NAME = 'me'\n"}).report
        assert report.output == "['a', 'b c'] me 1,2 True __main__\n"

    def test_the_world_of_the_judge_is_closed(self, drive):
        """Talking past the package changes nothing: requests are checked."""
        code = (
            f"{BEGIN}from controller.connection import connection\n"
            "world = connection._world\n"
            "bad = [None, 5, (1,), (-1, [], None), (True, [], None), (32, [1], None),\n"
            "       (32, [('left wheel motor', 'velocity', math.nan)], None),\n"
            "       (32, [('left wheel motor', 'pid', [1, 'x', 2])], None),\n"
            "       (32, [('ps0', 'enable', 1.5)], None),\n"
            "       (32, [('nose', 'enable', 32)], None),\n"
            "       (0, [], ('value', 10**9, 'translation')),\n"
            "       (0, [], ('value', 1, 'wings')), (0, [], ('fly', 1, '')),\n"
            "       (0, [], 'simulationQuit'),\n"
            "       (10**12, [], None), object()]\n"
            "for request in bad:\n"
            "    try:\n        world.step(request); print('taken', request)\n"
            "    except RuntimeError as error:\n        print('refused', error)\n"
            "try:\n    world.reset(); print('taken')\n"
            "except RuntimeError as error:\n    print('refused', error)\n"
            "robot.step(32)\n"
        )
        report = drive(code, OPEN).report
        assert report.error is None, report.error
        assert report.output.count("refused") == 17
        assert "taken" not in report.output
        assert report.steps == 1
        assert report.teleport is None

    def test_other_files_and_sockets_are_closed(self, drive):
        """It is in the same sandbox as every controller."""
        code = (
            "import os, socket\n"
            "for what in (lambda: open('/etc/passwd'), socket.socket, os.fork):\n"
            "    try:\n        what(); print('open')\n"
            "    except OSError:\n        print('closed')\n"
        )
        run = drive(code, OPEN)
        if run.report.sandbox == "rlimits":
            pytest.skip("rlimits promises nothing")
        assert run.report.output == "closed\nclosed\nclosed\n"

    @pytest.mark.slow
    def test_processor_time_is_bounded(self, drive, quick):
        """A controller that only computes is ended, and has failed."""
        limits = replace(quick, cpu_seconds=1)
        report = drive("while True:\n    pass\n", OPEN, steps=1, limits=limits).report
        assert report.outcome == "error"
        assert "the run" in report.error


class TestTeleports:
    @pytest.mark.slow_after(3)
    @pytest.mark.parametrize(
        ("call", "told"),
        [
            (
                'me.getField("translation").setSFVec3f([0.4, 0, 0])',
                "a write on the translation of DEF EPUCK E-puck",
            ),
            (
                'me.getField("rotation").setSFRotation([0, 0, 1, 1])',
                "a write on the rotation of DEF EPUCK E-puck",
            ),
            (
                'goal.getField("translation").setSFVec3f([-0.4, 0, 0])',
                "a write on the translation of DEF GOAL Solid",
            ),
            (
                'box.getField("translation").value = [0.0, 0.4, 0.0]',
                "a write on the translation of DEF BOX WoodenBox",
            ),
            (
                'box.getField("size").setSFVec3f([0.01, 0.01, 0.01])',
                "a write on the size of DEF BOX WoodenBox",
            ),
            ("box.remove()", "remove() on DEF BOX WoodenBox"),
            (
                'robot.getRoot().getField("children").removeMF(5)',
                "removeMF() on the children of Group",
            ),
            (
                "me.setVelocity([0.1, 0, 0, 0, 0, 0])",
                "setVelocity() on DEF EPUCK E-puck",
            ),
            ("me.resetPhysics()", "resetPhysics() on DEF EPUCK E-puck"),
            ("me.addForce([1, 0, 0], False)", "addForce() on DEF EPUCK E-puck"),
            ("robot.simulationReset()", "simulationReset()"),
            ("robot.simulationResetPhysics()", "simulationResetPhysics()"),
            ("robot.worldReload()", "worldReload()"),
        ],
    )
    def test_are_failures_by_name(self, drive, call, told):
        """The run ends there; nothing was moved, and the verdict names the call."""
        code = (
            f"{BEGIN}me, goal, box = (robot.getFromDef(n) for n in "
            "('EPUCK', 'GOAL', 'BOX'))\n"
            f"robot.step(320)\n{call}\nprint(robot.step(32), me.getPosition()[0])\n"
        )
        report = drive(code, BLOCKED).report
        assert report.outcome == "teleport"
        assert not report.passed
        assert report.teleport == f"{told} at step 10"
        assert report.why_not == f"teleport: {told} at step 10"
        assert report.end == (-0.4, 0.0, 0.0)
        assert report.output == "-1 -0.4\n"

    def test_quitting_is_no_teleport(self, drive):
        """simulationQuit ends the run, and the goal is not reached."""
        code = (
            f"{BEGIN}robot.step(64)\nrobot.simulationQuit(0)\nprint(robot.step(32))\n"
        )
        report = drive(code, OPEN).report
        assert (report.outcome, report.output) == ("quit", "-1\n")
        assert not report.passed
