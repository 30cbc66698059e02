"""A user id that the system does not know, without a home: as in many containers."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from tdac_agent.models.prices import SHIPPED

# A user namespace makes one of whoever runs the tests; else root can become one.
WAYS = (
    ["unshare", "--user", "--map-user=12345", "--map-group=12345"],
    ["setpriv", "--reuid=12345", "--regid=12345", "--clear-groups"],
)
HOMES = (
    *("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_STATE_HOME"),
    *("MPLCONFIGDIR", "TDAC_PRICES"),
)

NO_SECRET = "tdac: cannot store a secret (there is no home folder)"


def call(way, *words, **options):
    """Runs Python's words in one of the ways, without what names a home."""
    return subprocess.run(
        [*way, sys.executable, *map(str, words)],
        env={name: os.environ[name] for name in os.environ if name not in HOMES},
        capture_output=True,
        text=True,
        check=False,
        **options,
    )


def works(way):
    """Whether this way leads to a user without a home, who can use the package."""
    code = "import pathlib, tdac_agent.models.prices; pathlib.Path.home()"
    try:
        return "Could not determine home" in call(way, "-c", code).stderr
    except OSError:
        return False


@pytest.fixture(scope="module")
def homeless():
    """Runs Python's words as such a user."""
    way = next((way for way in WAYS if works(way)), None)
    if way is None:
        pytest.skip("no user namespaces here, and not root: nobody else can be played")
    return lambda *words, **options: call(way, *words, **options)


@pytest.fixture
def place():
    """A folder that others can get to, as pytest's own are not."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def test_prices_are_the_shipped_ones(homeless):
    """No home, no file of the user's, no error."""
    done = homeless("-c", "from tdac_agent.models.prices import *; print(price_file())")
    assert (done.stdout, done.stderr) == (f"{SHIPPED}\n", "")


@pytest.mark.slow
def test_a_run_is_made_verified_and_reported(homeless, place):
    """Nothing is asked of a home; said of it is that no secret can be stored there."""
    place.chmod(0o777)
    for words, told, secrets in (
        (["synth"], "✔ verified: ", 1),
        (["verify", "runs/maze-1"], "verified: 41 of 41", 1),
        (["report", "runs"], "1 verified", 0),
    ):
        done = homeless("-m", "tdac_agent", *words, cwd=place)
        lines = done.stderr.splitlines()
        others = [line for line in lines if not line.startswith("tdac: compiling")]
        assert done.returncode == 0, words
        assert [NO_SECRET in line for line in others] == [True] * secrets, words
        assert told in done.stdout


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_to_is_one_line(homeless, place):
    """Where a container is started, say."""
    place.chmod(0o555)
    done = homeless("-m", "tdac_agent", "synth", cwd=place)
    assert done.returncode == 2
    *others, line = done.stderr.splitlines()
    assert line.startswith("error: cannot write to runs/maze-1: ")
    assert [NO_SECRET in other for other in others] == [True]
