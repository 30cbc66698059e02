"""`frame="metres"`: the same simulation, read in metres of the map's frame."""

import math
import pickle

import cv2
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tdac_envs
from tdac_envs.grid.map_units import MapFrame, MapUnits
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.metric_view import MetricView
from tdac_envs.map2d.observed import observation_space
from tdac_envs.map2d.vector import Map2DVectorEnv


def small_cells():
    """A room of 160 x 120 px with a block in it, True = occupied."""
    cells = np.zeros((120, 160), np.bool_)
    cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = True
    cells[50:70, 60:100] = True
    return cells


TASK = {"start": (30.5, 28.0, 0.4), "goal": (130.0, 29.5), "robot_radius": 6}
"""In px, on the small map of 160 x 120 px."""
YAWS = (0.0, 0.7)
SPEEDS = np.float32([[0.5, 0.45], [0.2, 0.6], [1.0, 0.9]])


@pytest.fixture(params=YAWS)
def plan(request, tmp_path):
    """The small map with a `map.yaml`, whose frame may be rotated."""
    cv2.imwrite(str(tmp_path / "p.png"), np.where(small_cells(), 0, 254).astype("u1"))
    origin = [-2.0, -3.0, request.param]
    (tmp_path / "p.yaml").write_text(f"image: p.png\nresolution: 0.1\norigin: {origin}")
    units = MapUnits(MapFrame(small_cells().shape[0], 0.1, tuple(origin)))
    return tmp_path / "p.yaml", units


def in_metres(units, **more):
    """The arguments of `TASK` in metres."""
    x, y, heading = TASK["start"]
    return {
        "start": (*units.coordinates(x, y), units.heading(heading)),
        "goal": units.coordinates(*TASK["goal"]),
        "robot_radius": TASK["robot_radius"] * 0.1,
        "frame": "metres",
        **more,
    }


def test_the_simulation_is_the_same_to_the_bit(plan):
    """Odometry, movers and noise included; what is observed is converted."""
    file, units = plan
    mover = {"kind": "route", "speed": 20.0, "radius": 4.0}
    points = [(60.0, 90.0), (90.0, 90.0)]
    pixels = Map2DEnv(
        file, **TASK, odometry=True, range_noise=0.05, wheel_slip=0.1,
        movers=[{**mover, "points": points}],
    )  # fmt: skip
    own = {
        "speed": 2.0,
        "radius": 0.4,
        "points": [units.coordinates(*p) for p in points],
    }
    metres = Map2DEnv(
        file, **in_metres(units), odometry=True, range_noise=0.05, wheel_slip=0.1,
        movers=[{**mover, **own}],
    )  # fmt: skip
    seen = pixels.reset(seed=3), metres.reset(seed=3)
    for k in range(40):
        (a, told), (b, said) = seen
        assert np.array_equal(pixels.pose(), metres.pose())
        assert np.array_equal(pixels.discs(), metres.discs())
        assert metres.observation_space.contains(b)
        x, y, heading = a["pose"].tolist()
        assert b["pose"][:2] == pytest.approx(units.coordinates(x, y), abs=1e-5)
        turn = math.remainder(b["pose"][2] - units.heading(heading), math.tau)
        assert turn == pytest.approx(0.0, abs=1e-6)
        assert b["goal"] == pytest.approx(units.coordinates(*TASK["goal"]), abs=1e-5)
        assert b["ranges"] == pytest.approx(a["ranges"] * 0.1, abs=1e-5)
        assert b["odometry"] == pytest.approx(a["odometry"] * [0.1, -1.0], abs=1e-6)
        for key in ("distance_to_goal", "path_distance", "clearance"):
            assert said.pop(key) == pytest.approx(told.pop(key) * 0.1)
        assert said == told
        action = SPEEDS[k % len(SPEEDS)]
        seen = [env.step(action)[::4] for env in (pixels, metres)]


def test_left_is_left(plan):
    """The right wheel faster: the heading grows, as it is counter-clockwise."""
    file, units = plan
    env = Map2DEnv(file, **in_metres(units))
    before = env.reset(seed=0)[0]
    after = env.step(np.float32([-1.0, 1.0]))[0]
    turn = math.remainder(float(after["pose"][2] - before["pose"][2]), math.tau)
    assert turn > 0.01
    pixels = Map2DEnv(file, **TASK).reset(seed=0)[0]
    assert (before["ranges"] * 10) == pytest.approx(pixels["ranges"], abs=1e-3)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_batch_observes_what_its_robots_do(plan, mode):
    """Bit for bit, at the ends of episodes, too."""
    file, units = plan
    options = in_metres(units, horizon=6, odometry=True, map=file)
    batch = Map2DVectorEnv(3, autoreset_mode=mode, variation="jitter", **options)
    make = [lambda: Map2DEnv(variation="jitter", **options)] * 3
    alone = gym.vector.SyncVectorEnv(make, autoreset_mode=batch.autoreset_mode)
    pair = [env.reset(seed=5) for env in (batch, alone)]
    for _ in range(15):
        for a, b in zip(*(flat(one) for one in pair), strict=True):
            assert np.array_equal(a, b)
        pair = [env.step(SPEEDS) for env in (batch, alone)]


def flat(result):
    """All arrays of observations and infos, by their keys, also those of `final_*`."""
    values = []
    for part in (result[0], result[-1]):
        for key in sorted(part):
            value = part[key]
            if key in ("final_info", "_final_info") or key.startswith("_"):
                continue
            if key == "final_obs":
                value = [one[k] for one in value if one for k in sorted(one)]
                values += value
            elif value.dtype != object:
                values.append(value)
    return values


def test_the_final_infos_are_in_metres(plan):
    file, units = plan
    options = in_metres(units, horizon=2, map=file)
    batch = Map2DVectorEnv(1, autoreset_mode="SameStep", **options)
    _, first = batch.reset(seed=0)
    batch.step(np.zeros((1, 2)))
    *_, infos = batch.step(np.zeros((1, 2)))
    final = infos["final_info"]["distance_to_goal"]
    assert final == pytest.approx(first["distance_to_goal"])


def test_check_env_pickle_and_options(plan):
    file, units = plan
    env = gym.make("TDAC-Map2D-v0", map=str(file), **in_metres(units))
    check_env(env.unwrapped, skip_render_check=True)
    copy = pickle.loads(pickle.dumps(env.unwrapped))
    start = (*units.coordinates(40, 90), 0.0)
    options = {"start": start, "goal": units.coordinates(120, 90)}
    for one in (env.unwrapped, copy):
        seen, _ = one.reset(options=options)
        assert seen["pose"][:2] == pytest.approx(start[:2], abs=1e-5)
        assert seen["goal"] == pytest.approx(options["goal"], abs=1e-5)
    assert gym.spec(env.spec.id) is not None
    assert "metres" in env.spec.to_json()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"map": "maze"}, "the bundled map maze has no scale; give pixels"),
        ({"map": small_cells()}, "an array has no scale"),
        ({"frame": "meters"}, "frame"),
        ({"robot_radius": -1}, "robot_radius"),
        ({"start": (1, 2, 3, 4)}, "start"),
        ({"goal": (90.0, 6.0)}, "goal"),
    ],
)
def test_what_is_refused(plan, options, reason):
    file, units = plan
    with pytest.raises(tdac_envs.TdacError, match=reason):
        Map2DEnv(**{"map": file, **in_metres(units), **options})


def test_mixed_frames(plan):
    file, units = plan
    each = [{"map": file, **TASK}, {"map": file, **in_metres(units)}]
    with pytest.raises(tdac_envs.TaskError, match="the same frame"):
        Map2DVectorEnv(2, each=each)


@pytest.mark.parametrize("many", [False, True])
def test_a_learner_sees_the_same(plan, many):
    """The wrappers for RL make metres and pixels alike."""
    file, units = plan
    seen = []
    for options in (TASK, in_metres(units)):
        env = (
            Map2DVectorEnv(2, map=file, **options)
            if many
            else gym.make("TDAC-Map2D-v0", map=str(file), **options)
        )
        wrapped = tdac_envs.wrap_for_rl(env)
        first, _ = wrapped.reset(seed=0)
        second = wrapped.step(SPEEDS[:2] if many else SPEEDS[0])[0]
        seen.append(np.stack([first, second]))
    assert seen[0] == pytest.approx(seen[1], abs=1e-5)


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi / 2, math.pi])
@pytest.mark.parametrize("corner", [0.0, -3.0])
def test_bounds_are_sensible_numbers(yaw, corner):
    """No bound is a denormal number next to 0, and every place of the rim is within."""
    height, width = small_cells().shape
    view = MetricView(MapFrame(height, 0.1, (corner, corner, yaw)))
    space = view.space(observation_space(Map2DEnv(small_cells(), **TASK).task))
    for box in space.values():
        bounds = np.abs(np.concatenate([box.low.ravel(), box.high.ravel()]))
        assert (bounds[bounds > 0] >= 1e-7).all()
    random = np.random.default_rng(0)
    for x, y in random.uniform(-0.5, (width - 0.5, height - 0.5), (50, 2)):
        for place in ((x, -0.5), (x, height - 0.5), (-0.5, y), (width - 0.5, y)):
            seen = view.seen(
                {key: np.zeros(box.shape, np.float32) for key, box in space.items()}
                | {"goal": np.float32(place)}
            )
            assert space["goal"].contains(seen["goal"])
