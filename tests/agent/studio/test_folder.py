"""The studio reads and writes in its folder alone, whatever others have put there."""

import io
import os
import shutil
import zipfile

import numpy as np
import pytest
from changed_run import change_run

pytest.importorskip("nicegui", reason="needs tdac[studio]")

from tdac_agent.runs.replay import DEMO
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.journal import append_record
from tdac_agent.studio.folder import (
    STATE,
    as_word,
    deployable,
    keep,
    lines_in,
    made_within,
    within,
)
from tdac_agent.studio.jobs import start
from tdac_agent.studio.pages.questions import asked_for
from tdac_agent.studio.pages.worlds import policies_in
from tdac_agent.studio.run_status import episodes_driven
from tdac_agent.studio.serve import opened_port
from tdac_agent.studio.sources import sources_in


@pytest.fixture
def place(tmp_path):
    """The folder of a studio, beside a file."""
    (tmp_path / "place").mkdir()
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "kept").write_text("kept")
    yield tmp_path / "place"
    assert [path.name for path in (tmp_path / "outside").iterdir()] == ["kept"]
    assert (tmp_path / "outside" / "kept").read_text() == "kept"


@pytest.mark.parametrize("at", ["..", "/etc", "a/../..", "link", "circle/x", "a\0b"])
def test_a_path_that_leads_out(place, at):
    (place / "link").symlink_to("../outside")
    (place / "circle").symlink_to("circle")
    assert within(place, at) is None
    assert within(place, "a/b") == place / "a" / "b"


@pytest.mark.parametrize("name", [STATE, f"{STATE}/files"])
def test_a_link_in_place_of_a_folder_is_not_followed(place, name):
    """An upload, a job or a film would be written elsewhere."""
    (place / name).parent.mkdir(exist_ok=True)
    (place / name).symlink_to("../outside" if name == STATE else "../../outside")
    with pytest.raises(OSError, match="leads out of this folder"):
        keep(place, f"{STATE}/files/plan.png", b"x")
    with pytest.raises(OSError, match="leads out of this folder"):
        made_within(place, f"{STATE}/files")
    if name == STATE:
        with pytest.raises(OSError, match="leads out of this folder"):
            start(place, ["runs"], "x")
        opened_port(place, 0).close()


def test_a_link_in_place_of_an_upload_is_replaced(place):
    """What it led to is as before."""
    folder = made_within(place, f"{STATE}/files")
    (folder / "plan.png").symlink_to("../../../outside/kept")
    keep(place, f"{STATE}/files/plan.png", b"x")
    assert (folder / "plan.png").read_bytes() == b"x"


def test_a_download_has_no_file_from_elsewhere(place):
    """A run's link leads to it."""
    (place / "controller.py").write_text("x")
    (place / "sensors.py").symlink_to("../outside/kept")
    os.mkfifo(place / "params.json")
    with zipfile.ZipFile(io.BytesIO(deployable(place))) as packed:
        assert packed.namelist() == ["controller.py"]


def test_a_file_is_not_taken_for_a_flag(place):
    """By its name; its command line drives it, and does nothing else."""
    (place / "--tier=rlimits.py").touch()
    (place / "--out=x").mkdir()
    (place / "--out=x" / "policy.zip").touch()
    assert policies_in(place) == ["./--out=x/policy.zip", "./--tier=rlimits.py"]
    assert as_word("runs/maze-1") == "runs/maze-1"


def test_large_files_and_pipes_are_not_read(place):
    """They are no maps, and have no lines."""
    for name in ("large.yaml", "large"):
        (place / name).touch()
        os.truncate(place / name, 8 << 30)
    os.mkfifo(place / "pipe.yaml")
    np.save(place / "map.npy", np.zeros((3, 3), bool))
    sources = sources_in(place)
    assert "map: map.npy" in sources
    assert not {"map: large.yaml", "map: pipe.yaml"} & {*sources}
    assert lines_in(place / "large") == lines_in(place / "pipe.yaml") == 0


def test_a_question_that_cannot_be_read(place):
    """A pipe would be waited for."""
    folder = place / "iterations" / "k01" / "j0"
    folder.mkdir(parents=True)
    os.mkfifo(folder / "edit.prompt.md")
    assert asked_for(place, "text") == "an answer"


def test_a_journal_with_other_types(tmp_path):
    """Counts that are none are left out."""
    folder = tmp_path / "run"
    shutil.copytree(DEMO, folder)
    change_run(folder, episodes=40)
    for driven in ("x", None, [1], True, 3):
        record = {"event": "drive.end", "what": "feedback", "driven": driven}
        append_record(folder / "journal.jsonl", record)
    assert episodes_driven(load_run(folder)) == "3 of at most 40 episodes driven"
