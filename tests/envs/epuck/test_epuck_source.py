"""An e-puck whose episodes are in different worlds."""

import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.vector import EPuckVectorEnv
from tdac_envs.ladder.plate_worlds import PlatesSpec, make_plates
from tdac_envs.ladder.random_stream import world_key
from tdac_envs.worlds.materials import Contact

OPTIONS = {
    "goal_tolerance": 0.08,
    "dt": 0.1,
    "horizon": 25,
    "wheel_slip": 0.02,
    "wheel_gains": 0.01,
    "axle_error": 0.01,
    "sensor_noise": 1.0,
    "encoders": True,
    "ground_sensors": True,
}


def world(index):
    """A generated world; their sizes, frictions and axles differ."""
    key = world_key(b"source", "0" * 64, "test", index, "world")
    made = make_plates(PlatesSpec(), key).world
    robot = replace(made.robot, kinematic=index == 2)
    contact = Contact(friction=0.5 + 0.1 * index)
    return replace(made, robots=(robot,), contacts=(contact,))


def alone(index):
    """The environment of one world."""
    return EPuckEnv(world(index), **OPTIONS)


class Source:
    """The tasks of three worlds; seeds of disturbances are the world's number."""

    def __init__(self):
        self.tasks = [alone(index).nominal for index in range(3)]
        self.drawn = 0

    def draw(self, options, random):
        """The world of the option, or each in turn."""
        index = options.get("index", self.drawn % 3)
        self.drawn += 1
        return self.tasks[index], np.random.default_rng(index)


def drawing():
    """An environment that draws its worlds."""
    first = alone(0)
    setup = replace(first.setup, source=Source())
    return EPuckEnv.of(setup, first.sensor_noise, first.further)


def actions(count=30):
    """Wheel speeds that turn and drive."""
    return np.random.default_rng(5).uniform(0.2, 1, (count, 2)).astype(np.float32)


def driven(env, **reset):
    """All that an episode gives."""
    seen = [env.reset(**reset)]
    for action in actions():
        seen.append(env.step(action))
        if seen[-1][2] or seen[-1][3]:
            break
    return seen


def flat(value):
    """Nested values as bytes and plain values."""
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, dict):
        return {key: flat(each) for key, each in value.items()}
    return [flat(each) for each in value] if isinstance(value, list | tuple) else value


def expected(index):
    """The episode of one world, with the same random numbers."""
    env = alone(index)
    env.np_random = np.random.default_rng(index)
    return driven(env)


def test_episodes_are_those_of_each_world():
    """To the bit, in any order, also after it was pickled."""
    env = drawing()
    for index in (0, 2, 1, 1, 0):
        assert flat(driven(env, options={"index": index})) == flat(expected(index))
    env = pickle.loads(pickle.dumps(env))
    assert flat(driven(env, options={"index": 2})) == flat(expected(2))


def test_a_picture_shows_the_world_of_the_episode():
    """And not the nominal one."""
    first = alone(0)
    setup = replace(first.setup, source=Source())
    env = EPuckEnv.of(setup, render_mode="rgb_array")
    env.reset(options={"index": 2})
    other = EPuckEnv(world(2), **OPTIONS, render_mode="rgb_array")
    other.np_random = np.random.default_rng(2)
    other.reset()
    np.testing.assert_array_equal(env.render(), other.render())


class Drawing(EPuckVectorEnv):
    """A batch of environments that draw their worlds."""

    make = staticmethod(drawing)


@pytest.mark.parametrize("mode", list(gym.vector.AutoresetMode)[:2])
def test_a_batch_does_as_single_environments(mode):
    """Worlds in turn, over several episodes of each robot."""
    batch = Drawing(2, each=({}, {}), autoreset_mode=mode)
    singles = gym.vector.SyncVectorEnv([drawing, drawing], autoreset_mode=mode)
    got, wanted = batch.reset(seed=3), singles.reset(seed=3)
    for action in np.tile(actions(), (3, 1)):
        for key in wanted[0]:
            assert got[0][key].tobytes() == wanted[0][key].tobytes(), key
        for one, other in zip(got[1:-1], wanted[1:-1], strict=True):
            np.testing.assert_array_equal(one, other)
        both = np.stack([action, action[::-1]])
        got, wanted = batch.step(both), singles.step(both)
    drawn = [setup.source.drawn for setup in batch.setups]
    assert drawn == [env.setup.source.drawn for env in singles.envs]
    assert min(drawn) >= 3
