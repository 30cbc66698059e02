"""Promises of the progress of episodes."""

import pytest

from tdac_agent.cli.console import Console
from tdac_agent.cli.driving_bar import DrivingBar


def driving(cut, drives, error):
    """Some drives, and then an error."""
    with DrivingBar(Console(), 93, "blind drives", is_long=True, cut=cut) as bar:
        for drive in drives:
            bar.show(*drive)
        raise error


@pytest.mark.parametrize(
    ("cut", "drives", "text"),
    [
        (
            "not verified",
            [(1, 1), (40, 39)],
            "interrupted after 40 of 93 blind drives, 1 failed; not verified\n",
        ),
        (
            "no success rate computed",
            [],
            "interrupted after 0 of 93 blind drives, 0 failed; "
            "no success rate computed\n",
        ),
        (None, [(40, 39)], ""),
    ],
)
def test_an_interruption_says_what_was_driven(cut, drives, text, capsys):
    """The counts so far, and that they decide nothing."""
    with pytest.raises(KeyboardInterrupt):
        driving(cut, drives, KeyboardInterrupt())
    assert capsys.readouterr().out == text


def test_an_error_is_no_interruption(capsys):
    """Its message comes from elsewhere."""
    with pytest.raises(ValueError, match="broken"):
        driving("not verified", [(1, 1)], ValueError("broken"))
    assert capsys.readouterr().out == ""
