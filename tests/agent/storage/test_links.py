"""What a command writes stays in the folder that it was given."""

import os

import pytest

from tdac_agent.errors import RunError
from tdac_agent.evaluation.unfinished import open_store
from tdac_agent.runs.run_record import JOURNAL
from tdac_agent.storage.links import refuse_links
from tdac_agent.storage.locks import own_folder
from tdac_agent.synthesis.setup import hold_folder

HOLDERS = {
    "run": hold_folder,
    "evaluation": lambda out: own_folder(out, "evaluation"),
    "store": open_store,
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
    refuse_links(place / "named")
