"""Planted failures of an e-puck are told as what they are: m, mm, and by name."""

import itertools
import math
import re

import numpy as np
import pytest
from driving import always, judged, pattern

from tdac_agent.tasks.units import METRES, PIXELS
from tdac_agent.verification.diagnosis.surroundings import surroundings_of
from tdac_envs.drive.task import Pose
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.worlds.footprint import Disc, Rectangle
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, World

REACH = 0.037 + 0.02


def env_with(*shapes, start=(0.0, 0.0, 0.0), goal=(0.7, 0.2), names=(), **arguments):
    """An e-puck in a room of 2 m x 1.2 m with posts and boxes."""
    things = tuple(
        Obstacle(name, "Solid", s.x, s.y, (Part(s, 0.0, 0.1),), (Part(s, 0.0, 0.1),))
        for s, name in itertools.zip_longest(shapes, names, fillvalue="")
    )
    world = World(
        robots=(EPuck("e-puck", *start),),
        goal=goal,
        arenas=(Arena(Rectangle(0.0, 0.0, 0.0, 2.0, 1.2), 0.01, 0.1),),
        obstacles=things,
    )
    return EPuckEnv(world, **arguments)


@pytest.mark.parametrize(
    ("heading", "wheel", "bearing", "side"),
    [
        (0.0, 1.0, 0.0, "front"),
        (0.0, 1.0, 0.7, "front left"),
        (0.0, 1.0, -0.7, "front right"),
        (0.0, 1.0, 1.3, "left"),
        (0.0, 1.0, -1.3, "right"),
        (0.0, -1.0, math.pi, "rear"),
        (0.0, -1.0, 2.4, "rear left"),
        (0.0, -1.0, -2.4, "rear right"),
        (2.0, 1.0, 0.7, "front left"),
        (-2.8, 1.0, -0.7, "front right"),
        (math.pi, -1.0, 2.4, "rear left"),
    ],
)
def test_collision_side(heading, wheel, bearing, side):
    """The side is the one that a person would name, and the post is told by name."""
    way = math.copysign(0.05, wheel)
    x = REACH * math.cos(heading + bearing) + way * math.cos(heading)
    y = REACH * math.sin(heading + bearing) + way * math.sin(heading)
    post = Disc(x, y, 0.02)
    env = env_with(post, start=(0.0, 0.0, heading), names=("the post",))
    rollout, found = judged(env, always(wheel, wheel))
    assert (found.cause, found.side) == ("collision", side)
    assert found.thing == "Solid 'the post'"
    assert found.step == rollout.trajectory.steps
    # Of a step's length the robot is nearer.
    assert math.dist((found.x, found.y), (x, y)) == pytest.approx(REACH, abs=1e-3)
    assert math.dist(found.wall, (x, y)) == pytest.approx(0.02, abs=1e-3)
    assert f"the {side} of the body touched the Solid 'the post'" in found.text


def test_figures_of_a_collision():
    """Places are m, lengths mm, headings as in the environment."""
    box = Rectangle(0.3, 0.0, 0.0, 0.1, 0.4)
    rollout, found = judged(env_with(box), always(1.0, 1.0))
    assert found.wall == pytest.approx((0.25, 0.0), abs=1e-3)
    assert (found.x, found.y) == pytest.approx((0.213, 0.0), abs=1e-3)
    distances = rollout.trajectory.path_distances
    assert found.d0 == pytest.approx(distances[0], abs=1e-4)
    assert found.d_min == pytest.approx(distances.min(), abs=1e-4)
    assert 0.7 < found.d0 < 0.9
    assert "at (0.213, 0.000), heading 0°, speed 126 mm/s" in found.text
    assert f"Path left: {1e3 * found.d0:.1f} mm at the start" in found.text
    assert re.search(r"ps[07] read \d+, the sensor on that side", found.text)
    assert "A wheel was at its limit in 100 % of the steps" in found.text


def test_a_corner_is_told():
    """Of a box the corner that was hit is named, of a post there is none."""
    box = Rectangle(0.4, 0.13, 0.0, 0.2, 0.2)
    _, found = judged(env_with(box), always(1.0, 1.0))
    assert found.corner == (0.3, 0.03)
    assert "at the corner at (0.300, 0.030)" in found.text
    _, found = judged(env_with(Disc(0.3, 0.05, 0.04)), always(1.0, 1.0))
    assert found.corner is None
    turned = Rectangle(0.3, 0.0, math.pi / 4, 0.1, 0.1)
    _, found = judged(env_with(turned, start=(0.0, 0.03, 0.0)), always(1.0, 1.0))
    assert found.corner == pytest.approx((0.3 - 0.1 * math.sqrt(0.5), 0.0), abs=1e-3)
    assert re.search(r"\d mm (past|before|beside) the corner", found.text)


def test_headings_and_turns_are_as_in_the_world():
    """A goal to the left is told as left, and so is the course to it."""
    env = env_with(Disc(0.3, 0.0, 0.05), goal=(0.3, 0.5))
    _, found = judged(env, always(1.0, 1.0))
    assert found.heading_error < 0.0
    assert re.search(r"the shortest path is \d+° to the left", found.text)
    assert re.search(r"the goal itself \d+° to the left", found.text)


def test_turning_away_is_noticed():
    """Who turns right though path and goal lie to the left is told so."""
    env = env_with(Disc(0.2, -0.25, 0.05), goal=(0.1, 0.5))
    away, towards = always(0.9, 0.6), always(0.6, 0.9)
    assert "turned away from both" in judged(env, away, steps=60)[1].text
    assert "turned away" not in judged(env, towards, steps=60)[1].text


def test_the_wall_of_the_arena_and_the_fence_have_names():
    """A wall is told as the arena's; where there is none, the fence is."""
    _, found = judged(env_with(start=(0.7, 0.3, 0.0)), always(1.0, 1.0))
    assert found.thing == "wall of the arena"
    assert found.wall == pytest.approx((1.0, 0.3), abs=1e-3)
    bare = EPuckEnv(World(robots=(EPuck("e-puck", 0.0, 0.0, 0.0),), goal=(0.3, 0.1)))
    _, found = judged(bare, always(1.0, 1.0))
    assert found.thing == "fence around the world"


ODDLY = {
    "no motion": always(0.0, 0.0),
    "spinning": always(0.5, -0.5),
    "oscillating": pattern((3, 0.4, -0.4), (3, -0.4, 0.4)),
    "stuck": pattern((20, 0.5, 0.5), (5000, 0.0, 0.0)),
    "too slow": always(0.05, 0.05),
}


@pytest.mark.parametrize("cause", ODDLY)
def test_what_made_no_progress(cause):
    """Standing, spinning, trembling and creeping are told apart."""
    env = env_with(goal=(0.9, 0.0), horizon=1500)
    rollout, found = judged(env, ODDLY[cause])
    assert rollout.outcome == "out of time"
    assert found.cause == cause
    assert "px" not in found.text


def test_a_spin_has_a_direction():
    """With the right wheel faster it turns to the left."""
    assert "to the left" in judged(env_with(), always(-0.5, 0.5), steps=600)[1].text
    assert "to the right" in judged(env_with(), always(0.5, -0.5), steps=600)[1].text


def test_a_goal_with_a_wrong_sign():
    """Who drives to where the goal is with a mistake in it is told the mistake."""
    env = env_with(start=(0.0, 0.0, 0.0), goal=(0.4, 0.3))

    def to(x, y):
        def act(obs):
            px, py, heading = obs["pose"].tolist()
            if math.hypot(x - px, y - py) < 0.01:
                return 0.0, 0.0
            error = math.remainder(math.atan2(y - py, x - px) - heading, math.tau)
            turn = max(min(error, 0.5), -0.5)
            drive = 0.5 if abs(error) < 0.3 else 0.0
            return drive - turn, drive + turn

        return act

    for place, mistake in (
        ((0.4, -0.3), "the sign of y wrong"),
        ((-0.4, 0.3), "the sign of x wrong"),
        ((0.3, 0.4), "x and y swapped"),
    ):
        _, found = judged(env, to(*place), steps=800)
        assert found.cause == "wrong goal"
        told = f"({place[0]:.3f}, {place[1]:.3f}), which is the goal (0.400, 0.300)"
        assert told in found.text
        assert mistake in found.text


def test_held_out_tells_nothing():
    """Of a start that is held out there are no figures."""
    _, found = judged(env_with(), always(0.0, 0.0), steps=20, held_out=True)
    assert (found.cause, found.x, found.d0) == ("held out", None, None)


def test_the_nearest_thing_is_the_nearest():
    """Gap and place of what is near agree with the ground, everywhere."""
    shapes = (Disc(0.4, 0.1, 0.1), Rectangle(-0.3, 0.2, 0.7, 0.3, 0.1))
    env = env_with(*shapes, start=(-0.7, -0.4, 0.0), names=("post", "box"))
    around, ground = surroundings_of(env.nominal), env.nominal.ground
    random = np.random.default_rng(0)
    for x, y in random.uniform((-0.9, -0.5), (0.9, 0.5), (200, 2)):
        gap = ground.gap(x, y)
        if gap <= 0.0:
            continue
        (pose,) = METRES.on_screen([(x, y, 0.3)]).tolist()
        touch = around.touch(Pose(*pose), 5000.0)
        assert touch.gap == pytest.approx(max(1e3 * gap - 37.0, 0.0), abs=1e-6)
        place = METRES.place_of(*touch.wall)
        assert math.dist(place, (x, y)) == pytest.approx(gap)
        assert abs(ground.gap(*place)) < 1e-9
        # To the left is negative on the screen.
        to = math.atan2(place[1] - y, place[0] - x)
        assert math.remainder(to - 0.3 + touch.bearing, math.tau) == pytest.approx(
            0.0, abs=1e-9
        )


def test_units_go_there_and_back():
    """What is put on the screen and back is the same; words are rounded."""
    poses = np.array([(0.1, -0.2, 0.3), (1.5, 2.5, -3.0)])
    for units in (METRES, PIXELS):
        screen = units.on_screen(poses)
        for (x, y, heading), (u, v, turned) in zip(poses, screen, strict=True):
            assert units.place_of(u, v) == pytest.approx((x, y))
            assert units.heading_of(turned) == pytest.approx(heading)
    assert METRES.point(213.4, 100.0) == "(0.213, -0.100)"
    assert PIXELS.point(213.44, 100.0) == "(213.4, 100.0)"
    low, high = np.array([10.0, -50.0]), np.array([20.0, 30.0])
    assert METRES.box(low, high) == "x 0.010 to 0.020, y -0.030 to 0.050"
    assert PIXELS.box(low, high, less=1) == "x 10 to 20, y -50 to 30"
    assert METRES.length_text(1.2345) == "1234 mm"
