"""`--vision` on a task set: pictures of worlds of `dev`, with their movers."""

import io
import json
import math

import numpy as np
import pytest
from few_worlds import write_set
from PIL import Image
from script import AHEAD, NO_RULES, STILL, Script, code
from unconfirmed import synthesize

from tdac_agent.html_report import make_page
from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.runs.resume import resume_arguments
from tdac_agent.synthesis.set_reports import world_picture
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set
from tdac_envs.drawing.canvas import MOVER

MOVERS = [{"kind": "bounce", "count": [3, 3], "radius": [4, 5], "speed": [20, 25]}]


@pytest.fixture
def crowded(tmp_path):
    """A set with movers, which observes the frame of the start."""
    path = tmp_path / "crowded.yaml"
    return load_set(write_set(path, movers=MOVERS, map=False, frame="start"))


def shown_in(request):
    (picture,) = request.images
    with Image.open(io.BytesIO(picture.png)) as shown:
        assert shown.format == "PNG"
        assert max(shown.size) <= LARGEST_SIDE
        return np.asarray(shown.convert("RGB")).astype(int)


@pytest.mark.slow
def test_the_first_failed_world_is_shown_with_its_movers(crowded, tmp_path, warm):
    model = Script(code(AHEAD), code(STILL), NO_RULES)
    given = {"episodes": 12, "feedback_episodes": 2, "seed": 3, "judge": warm}
    run = synthesize(
        crowded, model, out=tmp_path / "run", iterations=1, vision=True, **given
    )
    first, edit = model.requests[:2]
    assert first.images == ()
    pixels = shown_in(edit)
    assert (np.abs(pixels - MOVER).max(axis=-1) <= 8).any()
    (picture,) = edit.images
    folder = run.folder / "iterations/k01"
    tested = json.loads((folder / "j0/feedback-1/episodes.json").read_text())
    failed = [each for each in tested["episodes"] if each["outcome"] != "reached"]
    assert tested["provenance"]["split"] == "dev"
    assert picture.caption == f"world {failed[0]['index']}: {failed[0]['cause']}"
    assert picture.png == (folder / "j1/edit.picture.png").read_bytes()
    section = edit.prompt.partition("## A picture of one failure")[2]
    assert picture.caption in section
    assert "purple discs: the movers" in section
    assert "black arrows: the axes x and y of all places" in section
    assert "do not fit the controller to this one" in section
    assert (
        'alt="A failure of the previous version"' in make_page(run.folder).html.decode()
    )
    again = resume_arguments(run.folder)
    assert again["vision"] is True


def test_what_is_shown_is_what_was_diagnosed(crowded, tmp_path, warm):
    report = verify_episodes(
        AHEAD.encode(), crowded, 3, split="dev", out=tmp_path / "dev", judge=warm
    )
    shown = world_picture(crowded, report, tmp_path / "dev")
    failed = next(each for each in report.episodes if not each.success)
    said = failed.text.replace("°", " deg")
    assert shown.event.facts[0] in said
    start = crowded.task("dev", failed.index).start
    assert shown.event.axes == pytest.approx(
        (start.heading, start.heading + math.pi / 2)
    )
    assert world_picture(crowded, report, tmp_path / "dev").png == shown.png


def test_worlds_of_other_splits_are_never_drawn(few, tmp_path, warm):
    report = verify_episodes(
        AHEAD.encode(), few, 1, split="test", out=tmp_path, judge=warm
    )
    assert report.successes == 0
    with pytest.raises(ValueError, match="expected worlds of dev, got test"):
        world_picture(few, report, tmp_path)


@pytest.mark.slow
def test_a_variation_is_asked_for_with_a_picture_of_a_failure(
    few, solver, tmp_path, warm
):
    """The parent reaches the goals on one side only."""
    part = solver.replace("def policy(", "def whole(") + (
        "\n\ndef reset(obs):\n    global able\n"
        "    able = obs['goal'][0] > obs['pose'][0]\n    begin(obs)\n"
        "\n\ndef policy(obs):\n    return whole(obs) if able else (1.0, 1.0)\n"
    )
    part = part.replace("def reset(", "def begin(", 1)
    model = Script(*(code(part) for _ in range(9)))
    synthesize(
        few,
        model,
        out=tmp_path / "run",
        episodes=4,
        feedback_episodes=2,
        improve=32,
        iterations=1,
        patience=0,
        refine=False,
        seed=3,
        vision=True,
        judge=warm,
    )
    asked = [request for request in model.requests if request.kind == "improve"]
    assert asked
    for request in asked:
        shown_in(request)
        (picture,) = request.images
        assert picture.name == "improve.picture.png"
        assert picture.file.read_bytes() == picture.png
        assert "`improve.picture.png`" in request.prompt
