"""Distance and light sensors of a robot, textured floors, and usable worlds."""

import math

import cv2
import numpy as np
import pytest

from tdac_envs.core.errors import WorldError
from tdac_envs.webots.instruments import Readings
from tdac_envs.webots.stage import open_stage

HEAD = "#VRML_SIM R2025a utf8\nWorldInfo { }\n"
ARENA = "RectangleArena { floorSize 2 1 }\n"
PICTURE = """RectangleArena {
  floorSize 2 1 floorTileSize 2 1
  floorAppearance PBRAppearance {
    baseColorMap ImageTexture { url "textures/halves.png" } roughness 1
  }
}
"""
SLOT = "groundSensorsSlot [ E-puckGroundSensors { } ]"


@pytest.fixture
def stage_of(tmp_path):
    """A function of the text of a world; gives its stage and its readings."""
    halves = np.zeros((20, 40, 3), np.uint8)
    halves[:, 20:] = 255
    (tmp_path / "textures").mkdir()
    cv2.imwrite(str(tmp_path / "textures" / "halves.png"), halves)

    def make(*nodes, ignore=()):
        file = tmp_path / "w.wbt"
        file.write_text(HEAD + "".join(nodes))
        stage = open_stage(file, ignore=ignore)
        return stage, Readings(stage.instruments, stage.make_env(steps=9))

    return make


def grounded(distance, factor):
    """Reading of a ground sensor."""
    return 1000.0 - 700.0 * min(distance / factor, 0.016) / 0.016


def test_the_picture_of_a_floor(stage_of):
    """Its left half is black, its right half is white, as the file maps it."""
    stage, readings = stage_of(PICTURE, f"E-puck {{ {SLOT} }}\n")
    assert stage.notes == ()
    for x, factor in ((-0.5, 0.2), (0.5, 0.2 + 0.8 * 0.5)):
        for k in range(3):
            found = readings.distance(f"gs{k}", (x, 0.2, 1.0))
            assert found == pytest.approx(grounded(0.003, factor))


def test_a_picture_that_is_not_here(stage_of):
    """Nothing is fetched: the floor is plain, and a note names the file."""
    away = PICTURE.replace("textures/halves.png", "https://example.org/a/line.png")
    stage, readings = stage_of(away, f"E-puck {{ {SLOT} }}\n")
    (note,) = stage.notes
    assert "line.png; tdac downloads nothing" in note
    assert readings.distance("gs0", (0.0, 0.0, 0.0)) == pytest.approx(
        grounded(0.003, 1.0)
    )
    near = PICTURE.replace("textures/halves.png", "C:/Users/me/halves.png")
    assert stage_of(near, f"E-puck {{ {SLOT} }}\n")[0].notes == ()


def test_a_painted_board(stage_of):
    """A flat Solid with a dark material is dark for sensors that look down."""
    board = """Solid { children [ Shape {
      appearance PBRAppearance { baseColor 0 0 0 roughness 1 }
      geometry Box { size 0.2 0.2 0.001 } } ] }
"""
    _, readings = stage_of(ARENA, board, f"E-puck {{ {SLOT} translation 0 0 0 }}\n")
    there = readings.distance("gs1", (0.0, 0.0, 0.0))
    assert there == pytest.approx(grounded(0.003 - 0.0005, 0.2))
    away = readings.distance("gs1", (0.5, 0.0, 0.0))
    assert away == pytest.approx(grounded(0.003, 1.0))


def test_a_distance_sensor_in_any_slot(stage_of):
    """Its place, direction, table and type are those of the file."""
    sensor = """turretSlot [ Pose { translation 0.01 0 0 children [ DistanceSensor {
      name "left" rotation 0 0 1 1.5708 type "laser"
      lookupTable [ 0 0 0, 3 3000 0 ] } ] } ]"""
    stage, readings = stage_of(ARENA, f"E-puck {{ {sensor} }}\n")
    (device,) = [d for d in stage.devices if d.name == "left"]
    assert device.plain()["type"] == 3
    # At heading 0 it is at y = 0 and sees the wall at y = 0.5, 1 cm more if turned.
    assert readings.distance("left", (0.2, 0.1, 0.0)) == pytest.approx(400.0, abs=0.1)
    turned = readings.distance("left", (0.0, 0.0, -math.pi / 2))
    assert turned == pytest.approx(1000.0, abs=0.1)


def test_a_reading_beyond_the_table(stage_of):
    """A sensor that meets nothing reads the last value of its table."""
    sensor = 'turretSlot [ DistanceSensor { name "short" } ]'
    _, readings = stage_of(ARENA, f"E-puck {{ {sensor} }}\n")
    assert readings.distance("short", (0.0, 0.0, 0.0)) == 1000.0
    assert readings.distance("short", (0.94, 0.0, 0.0)) < 1000.0


def test_a_goal_out_of_reach_is_not_used(stage_of):
    """The world has no goal then, which a note explains; so driving on is right."""
    walled = "WoodenBox { size 0.1 1 0.2 translation 0.3 0 0.1 }\n"
    goal = "DEF GOAL Pose { translation 0.7 0 0 }"
    stage, _ = stage_of(ARENA, walled, "E-puck { translation -0.5 0 0 }\n", goal)
    assert not stage.has_goal
    assert not stage.make_env().ends
    assert "the file's GOAL is not used: no free path" in stage.notes[0]


def test_a_robot_that_touches_a_wall(stage_of):
    """It starts just beside its place in the file; deeper inside it is refused."""
    stage, _ = stage_of(ARENA, "E-puck { translation 0.9638 0 0 }\n")
    assert stage.world.robot.x < 0.9631
    assert "where it overlaps an obstacle by 0.8 mm" in stage.notes[0]
    with pytest.raises(Exception, match="too near for a body of 37 mm radius"):
        stage_of(ARENA, "E-puck { translation 0.98 0 0 }\n")


def test_unknown_nodes_behind_the_walls(stage_of):
    """They need no --ignore, but a note; inside the walls they need it."""
    robot = "E-puck { }\n"
    stage, _ = stage_of(ARENA, robot, 'Dragon { translation 3 0 0 name "far" }')
    assert stage.notes == ("not modelled, but outside the arena's walls: far",)
    with pytest.raises(WorldError, match="1 node may be solid but is not modelled"):
        stage_of(ARENA, robot, "Dragon { translation 0.8 0 0 }")
