"""write_video: a whole film, or none."""

import re
import subprocess

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo
from imageio_ffmpeg import get_ffmpeg_exe

from tdac_envs.drawing.video import VideoError, write_video

COLOURS = [(250, 249, 245), (56, 65, 81), (208, 38, 52), (14, 140, 92), (0, 128, 190)]


def frames(count=12, shape=(48, 64)):
    for k in range(count):
        frame = np.full((*shape, 3), COLOURS[k % len(COLOURS)], np.uint8)
        frame[:8, : 4 * k + 4] = (88, 72, 198)
        yield frame


def decode(path):
    """What ffmpeg says about the picture, and all frames."""
    command = [get_ffmpeg_exe(), "-hide_banner", "-i", str(path)]
    raw = ["-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command + raw, capture_output=True, check=True)
    about = re.search(r"Video: .*", done.stderr.decode()).group()
    width, height = map(int, re.search(r" (\d{2,})x(\d{2,})\b", about).groups())
    return about, np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3)


@pytest.mark.parametrize("name", ["film.mp4", "film.gif", "FILM.MP4"])
def test_every_frame_comes_back_in_its_colours(tmp_path, name):
    write_video(frames(), tmp_path / name, fps=20)
    about, film = decode(tmp_path / name)
    assert " 20 fps" in about
    assert len(film) == 12
    for k, (ours, theirs) in enumerate(zip(frames(), film, strict=True)):
        off = np.abs(ours[20, 32].astype(int) - theirs[20, 32]).max()
        assert off <= 12, k


def test_mp4_plays_in_browsers(tmp_path):
    """H.264 in yuv420p, index first."""
    write_video(frames(), tmp_path / "film.mp4", fps=20)
    about, _ = decode(tmp_path / "film.mp4")
    assert re.search(r"h264 .*yuv420p", about)
    data = (tmp_path / "film.mp4").read_bytes()
    assert 0 < data.find(b"moov") < data.find(b"mdat")


def test_odd_sides_lose_one_pixel_in_mp4_and_none_in_gif(tmp_path):
    for name, shape in (("film.mp4", (48, 64, 3)), ("film.gif", (49, 65, 3))):
        write_video(frames(shape=(49, 65)), tmp_path / name, fps=10)
        assert decode(tmp_path / name)[1].shape[1:] == shape


def test_frames_are_taken_one_by_one(tmp_path):
    """A long episode never sits in memory: a used-up frame may be overwritten."""
    frame = np.zeros((48, 64, 3), np.uint8)

    def reused():
        for k in range(5):
            frame[:] = COLOURS[k]
            yield frame

    write_video(reused(), tmp_path / "film.gif", fps=10)
    film = decode(tmp_path / "film.gif")[1]
    for found, colour in zip(film, COLOURS, strict=True):
        assert np.abs(found[9, 9].astype(int) - colour).max() <= 4


def test_other_suffixes_are_refused_with_the_two_that_are_not(tmp_path):
    with pytest.raises(VideoError, match=r"end in \.mp4 or \.gif, got 'film\.avi'"):
        write_video(frames(), tmp_path / "film.avi", fps=10)


def test_no_frames_is_an_error_and_leaves_nothing(tmp_path):
    with pytest.raises(VideoError, match="at least one frame"):
        write_video([], tmp_path / "film.mp4", fps=10)
    assert not list(tmp_path.iterdir())


def test_frames_of_another_size_are_refused(tmp_path):
    mixed = [*frames(2), *frames(1, shape=(20, 20))]
    with pytest.raises(
        VideoError, match=r"shape \(48, 64, 3\), got uint8 \(20, 20, 3\)"
    ):
        write_video(mixed, tmp_path / "film.mp4", fps=10)
    assert not list(tmp_path.iterdir())


def test_a_failure_half_way_keeps_the_old_film(tmp_path):
    def broken():
        yield from frames(3)
        raise RuntimeError("the episode broke")

    (tmp_path / "film.mp4").write_bytes(b"old")
    with pytest.raises(RuntimeError, match="the episode broke"):
        write_video(broken(), tmp_path / "film.mp4", fps=10)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"old"]


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(VideoError, match=r"cannot write .*No such file or directory"):
        write_video(frames(), tmp_path / "nowhere" / "film.mp4", fps=10)


def test_what_ffmpeg_says_is_passed_on(tmp_path):
    with pytest.raises(VideoError, match="ffmpeg failed: "):
        write_video(frames(), tmp_path / "film.mp4", fps=-1)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["TDAC-Map2D-v0", "TDAC-EPuck-v0"])
def test_gymnasium_records_films(tmp_path, name):
    """With the extra `video`, a whole episode; each frame has the robot elsewhere."""
    env = gym.make(f"tdac_envs:{name}", render_mode="rgb_array", horizon=5)
    with RecordVideo(env, str(tmp_path / "films")) as recorded:
        recorded.reset(seed=0)
        truncated = False
        while not truncated:
            truncated = recorded.step(np.ones(2, np.float32))[3]
        shape = recorded.render().shape
    film = decode(tmp_path / "films" / "rl-video-episode-0.mp4")[1]
    assert film.shape == (6, *(side - side % 2 for side in shape[:2]), 3)
    assert (film[0] != film[-1]).any()
