"""Promises of the frames of a batch: they are those of single robots."""

import pickle

import cv2
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.wrappers.vector import RecordVideo

import tdac_envs  # noqa: F401 - registers the envs

IDS = ["TDAC-Map2D-v0", "TDAC-EPuck-v0"]
every_env = pytest.mark.parametrize("name", IDS)
DRAWN = {"render_mode": "rgb_array"}
AHEAD = np.ones((1, 2), np.float32)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@every_env
def test_a_robot_is_drawn_as_it_is_alone(name, mode):
    """With trail and outcome, and with a new trail in the next episode."""
    options = {"variation": "jitter", "horizon": 4, **DRAWN}
    batch = gym.make_vec(name, 1, autoreset_mode=mode, **options)
    single = gym.make(name, **options)
    batch.reset(seed=3)
    single.reset(seed=3)
    np.testing.assert_array_equal(batch.render()[0], single.render())
    over = False
    for _ in range(8):
        _, _, *ends, _ = batch.step(AHEAD)
        if over and mode == "NextStep":
            single.reset()
            over = False
        else:
            _, _, terminated, truncated, _ = single.step(AHEAD[0])
            over = terminated or truncated
            assert over == np.any(ends)
        if over and mode == "SameStep":
            single.reset()
        np.testing.assert_array_equal(batch.render()[0], single.render())
    batch.close()


def test_frames_of_several_maps_have_one_even_size():
    """So that they can be tiled and recorded, however many there are."""
    each = [{"map": "maze"}, {"map": "office"}, {"map": "spiral"}]
    batch = gym.make_vec(IDS[0], 5, each=each, **DRAWN)
    batch.reset(seed=0)
    frames = batch.render()
    rows, columns = frames[0].shape[:2]
    assert {frame.shape for frame in frames} == {(rows, columns, 3)}
    assert {frame.dtype for frame in frames} == {np.dtype(np.uint8)}
    assert rows % 2 == columns % 2 == 0
    assert max(rows, columns) <= 1280 // 3
    np.testing.assert_array_equal(frames[0], frames[3])
    assert (frames[0] != frames[1]).any()


@every_env
def test_a_masked_reset_begins_only_these_trails(name):
    """The other robots keep theirs."""
    batch = gym.make_vec(name, 2, **DRAWN)
    batch.reset(seed=0)
    first = batch.render()
    for _ in range(5):
        batch.step(np.ones((2, 2), np.float32))
    driven = batch.render()
    assert (driven[1] != first[1]).any()
    batch.reset(options={"reset_mask": np.array([True, False])})
    begun = batch.render()
    np.testing.assert_array_equal(begun[0], first[0])
    np.testing.assert_array_equal(begun[1], driven[1])


@every_env
def test_a_pickle_is_drawn_alike(name):
    """Also after further steps."""
    batch = gym.make_vec(name, 2, variation="jitter", **DRAWN)
    batch.reset(seed=0)
    twin = pickle.loads(pickle.dumps(batch))
    for envs in (batch, twin):
        envs.step(np.ones((2, 2), np.float32))
    np.testing.assert_array_equal(batch.render(), twin.render())


def test_without_a_render_mode_a_warning_says_how():
    """As single environments do."""
    batch = gym.make_vec(IDS[0], 2)
    with pytest.warns(UserWarning, match="render_mode='rgb_array'"):
        assert batch.render() is None
    with pytest.raises(ResetNeeded, match=r"reset\(\) of all robots before render"):
        gym.make_vec(IDS[0], 2, **DRAWN).render()


@pytest.mark.filterwarnings("default")
def test_gymnasium_records_a_batch(tmp_path):
    """All robots in one video."""
    pytest.importorskip("moviepy")
    batch = gym.make_vec(IDS[0], 4, horizon=6, **DRAWN)
    folder = str(tmp_path / "films")
    batch = RecordVideo(batch, folder, episode_trigger=lambda k: k == 0)
    batch.reset(seed=0)
    for _ in range(7):
        batch.step(np.ones((4, 2), np.float32))
    batch.close()
    (video,) = tmp_path.glob("films/*.mp4")
    film = cv2.VideoCapture(str(video))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 7
    assert film.get(cv2.CAP_PROP_FRAME_WIDTH) > 1000
