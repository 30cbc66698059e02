"""What a command writes stays in the folder that it was given."""

import os

import pytest

from tdac_agent import load_task
from tdac_agent.errors import RunError
from tdac_agent.runs.run_record import JOURNAL
from tdac_agent.storage.links import refuse_links
from tdac_agent.storage.locks import own_folder
from tdac_agent.synthesis.setup import hold_folder
from tdac_agent.verification.verify import verify
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.ladder.task_sets import load_set

HOLDERS = {
    "run": hold_folder,
    "evaluation": lambda out: own_folder(out, "*"),
}


@pytest.fixture
def place(tmp_path):
    """A folder, and one outside of it."""
    (tmp_path / "run" / "inner").mkdir(parents=True)
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "kept").write_text("kept")
    return tmp_path


@pytest.mark.parametrize("holder", HOLDERS)
@pytest.mark.parametrize(
    ("name", "target"),
    [
        (JOURNAL, "../outside/kept"),
        ("inner/deep", "../../outside"),
        ("inner/new", "/none/such"),
        ("circle", "circle"),
    ],
)
def test_a_link_that_leads_out_is_refused(place, holder, name, target):
    """Before anything is written; one line names it."""
    (place / "run" / name).symlink_to(target)
    with pytest.raises(RunError, match=rf"{name} is a link that leads out of"):
        HOLDERS[holder](place / "run").__enter__()
    assert os.listdir(place / "outside") == ["kept"]
    assert (place / "outside" / "kept").read_text() == "kept"


def test_other_links_are_fine(place):
    """Those within the folder, and the folder itself."""
    (place / "run" / "also").symlink_to("inner")
    (place / "named").symlink_to("run")
    refuse_links(place / "named", "*")
    refuse_links(place / "none", "*")


def test_only_what_is_written_counts(place):
    """A folder that has a `.venv` can be written to."""
    (place / "run" / ".venv").mkdir()
    (place / "run" / ".venv" / "python").symlink_to("/usr/bin/python3")
    refuse_links(place / "run", "report.json", "inner")
    with own_folder(place / "run", "*.png", who="evaluation"):
        (place / "run" / "maze.png").symlink_to("../outside/kept")
    with pytest.raises(RunError, match=r"maze\.png is a link"):
        refuse_links(place / "run", "*.png")


@pytest.mark.parametrize("name", ["report.json", "episodes.json", "trajectories"])
def test_verify_writes_through_no_link(place, name):
    """It ends before the controller is tested."""
    (place / "run" / name).symlink_to("../outside")
    task = load_task("maze")
    with pytest.raises(RunError, match=rf"{name} is a link that leads out of"):
        verify("def policy():\n", task, out=place / "run")
    assert os.listdir(place / "outside") == ["kept"]


def test_other_verifications_write_through_no_link(place):
    """The disturbed episodes, and the worlds of a set."""
    run = place / "run"
    (run / "episodes.json").symlink_to("../outside/kept")
    with pytest.raises(RunError, match=r"episodes\.json is a link"):
        verify_episodes("def policy():\n", load_task("maze"), 1, out=run)
    (run / "sealed").symlink_to("../outside")
    with pytest.raises(RunError, match=r"sealed is a link"):
        verify_episodes("def policy():\n", load_set("known"), out=run)
    assert os.listdir(place / "outside") == ["kept"]
