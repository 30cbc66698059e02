"""The speed of videos: real time where they are short, and whatever is asked for."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tdac_agent.cli.film import LONGEST_SECONDS, MOST_FPS, film_of


@pytest.mark.parametrize(
    ("steps", "dt", "speed", "told"),
    [
        (800, 0.05, None, "in real time, 40 s"),
        (1200, 0.05, None, "in real time, 60 s"),
        (1201, 0.05, None, "at 2 times real time, 30 s"),
        (6000, 0.032, None, "at 4 times real time, 48 s"),
        (6000, 0.032, 1.0, "in real time, 192 s"),
        (800, 0.05, 2.0, "at 2 times real time, 20 s"),
        (100, 0.05, 0.5, "at 0.5 times real time, 10 s"),
        (0, 0.05, None, "in real time, 0 s"),
    ],
)
def test_the_speed_is_told(steps, dt, speed, told):
    """With the playing time, in the words that the commands print."""
    assert str(film_of(steps, dt, speed)) == told


@given(
    st.integers(0, 100_000),
    st.floats(0.001, 1.0),
    st.one_of(st.none(), st.floats(0.01, 1000.0)),
)
def test_frames_and_rate_agree(steps, dt, speed):
    """A frame stands for `stride` steps at this speed; never faster than `MOST_FPS`."""
    film = film_of(steps, dt, speed)
    assert film.stride * dt * film.fps == pytest.approx(film.speed)
    assert film.fps <= MOST_FPS * 1.001
    if speed is None:
        assert film.seconds <= LONGEST_SECONDS * 1.001
        assert film.speed == 1.0 or steps * dt > LONGEST_SECONDS


def test_a_gif_has_at_most_ten_frames_per_second():
    """Its size grows with the frames; its speed is that of an MP4."""
    for dt, speed in ((0.05, 1.0), (0.016, 1.0), (0.05, 3.0)):
        film = film_of(400, dt, speed, Path("film.gif"))
        assert film.fps <= 10.0
        assert film.speed == speed
        assert film.fps == pytest.approx(speed / (dt * film.stride))
        assert film_of(400, dt, speed, Path("film.mp4")).fps > film.fps
