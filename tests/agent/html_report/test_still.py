"""The picture in three dimensions on the page of an e-puck's run."""

import base64
import io
import re
import threading

import numpy as np
import pytest
from PIL import Image
from script import AHEAD, NO_RULES, Script, code
from unconfirmed import synthesize
from without_marks import reading

from tdac_agent import load_task
from tdac_agent.html_report.still import still_of
from tdac_agent.runs.history import gather_run

STILL = re.compile(r'class="still"><img src="data:image/jpeg;base64,([^"]+)"')


@pytest.fixture(scope="module")
def run(tmp_path_factory, warm):
    """A run whose only candidate drives ahead until it touches something."""
    place = tmp_path_factory.mktemp("still")
    file = place / "task.yaml"
    file.write_text("env: TDAC-EPuck-v0\nworld: crates\nprofile: policy\n")
    out = place / "run"
    synthesize(
        load_task(file),
        Script(code(AHEAD), NO_RULES),
        out=out,
        iterations=1,
        patience=0,
        judge=warm,
    )
    return out


def test_the_page_shows_the_robot_where_it_came_nearest(run):
    pytest.importorskip("mujoco")
    page = reading(run)
    (found,) = STILL.findall(page)
    image = np.asarray(Image.open(io.BytesIO(base64.b64decode(found))))
    assert image.ndim == 3
    assert image.std() > 20.0  # not one colour
    report = gather_run(run).tried[-1].report
    nominal = next(each for each in report.episodes if each.name == "nominal")
    assert f"nominal, step {nominal.smallest_gap.step}: its smallest gap" in page


def test_a_thread_draws_none(run):
    """As in the studio, whose pages are made in threads."""
    found = [0]
    thread = threading.Thread(target=lambda: found.append(still_of(gather_run(run))))
    thread.start()
    thread.join()
    assert found == [0, None]


def test_a_run_on_a_map_has_none(page):
    assert STILL.search(page) is None
