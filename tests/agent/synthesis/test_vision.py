"""`--vision`: a picture of the failure goes with the question to edit a controller."""

import base64
import hashlib
import io
import json
import re
from dataclasses import replace
from datetime import date

import pytest
from changed_run import journal
from PIL import Image
from script import AHEAD, NO_RULES, Script, code
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent.errors import Fault, RunError
from tdac_agent.html_report import make_page
from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.models.prices import Price, PriceList
from tdac_agent.models.provider import PermanentFault, Request
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.models.tariff import Tariff
from tdac_agent.models.tokens import picture_tokens
from tdac_agent.runs.journal_state import call_key
from tdac_agent.runs.resume import resume_arguments
from tdac_agent.runs.run_record import load_run
from tdac_agent.synthesis.cost_forecast import cost_of
from tdac_agent.synthesis.workload import rest_of

AT_ONCE = RetryPolicy(first_wait=0.0)
PLACE = "iterations/k01/j1"


@pytest.fixture(scope="module")
def seen(task, good_source, tmp_path_factory, warm):
    """A run in which a model saw the failure, and what it was asked."""
    out = tmp_path_factory.mktemp("runs") / "seen"
    # The second answer has no Python, so that the question is repeated.
    model = Script(code(AHEAD), NO_RULES, code(good_source))
    run = synthesize(task, model, out=out, seed=4, vision=True, judge=warm)
    assert run.passed
    return out, model


@pytest.mark.slow
def test_the_edit_alone_has_a_picture_of_the_failure(seen, task):
    out, model = seen
    assert model.asked() == [("generate", 1, 0), ("edit", 1, 1), ("edit", 1, 1)]
    first, *edits = model.requests
    assert first.images == ()
    for edit in edits:
        (picture,) = edit.images
        with Image.open(io.BytesIO(picture.png)) as shown:
            assert shown.format == "PNG"
            assert max(shown.size) <= LARGEST_SIDE
            assert shown.info == {}
        assert picture.file == (out / PLACE / "edit.picture.png").absolute()
        assert picture.caption == "nominal: collision"
        assert edit.prompt.count("`edit.picture.png`") == 1
        assert "- orange ring: the contact;" in edit.prompt
        assert "- places in px: x points right, y points down." in edit.prompt
        assert "movers" not in edit.prompt.partition("## A picture")[2]
        # What a vendor may cache is the same as without a picture.
        assert edit.prompt[: edit.stable] == first.prompt[: first.stable]


def test_the_picture_is_on_record(seen):
    """Its bytes beside the prompt that names it, its hash in the journal."""
    out, model = seen
    content = (out / PLACE / "edit.picture.png").read_bytes()
    assert content == model.requests[1].images[0].png
    assert (out / PLACE / "edit.prompt.md").read_text() == model.requests[1].prompt
    generated, *edited = journal(out, "call.intent")
    assert "images" not in generated
    for call in edited:
        assert call["images"] == [
            {
                "file": "edit.picture.png",
                "sha256": hashlib.sha256(content).hexdigest(),
                "caption": "nominal: collision",
            }
        ]
    assert load_run(out).vision
    assert resume_arguments(out)["vision"] is True


def test_the_report_shows_the_picture_and_how_to_repeat_the_run(seen):
    out, _ = seen
    html = make_page(out).html.decode()
    content = (out / PLACE / "edit.picture.png").read_bytes()
    (shown,) = re.findall(
        r'<img src="data:image/png;base64,([^"]*)" alt="A failure', html
    )
    assert base64.b64decode(shown) == content
    commands = re.findall(r"tdac synth --task[^<]*", html)
    assert len(commands) == 2
    assert all(" --vision " in command for command in commands)


def test_a_replay_finds_the_same_questions(seen, task, tmp_path, warm):
    """With the same pictures, byte by byte; without pictures they are others."""
    out, _ = seen
    given = {"learner": f"replay:{out}", "judge": warm}
    run = synthesize(task, out=tmp_path / "again", vision=True, **given)
    assert run.passed
    one, other = (each / PLACE / "edit.picture.png" for each in (out, run.folder))
    assert one.read_bytes() == other.read_bytes()
    with pytest.raises(Fault, match="the question differs from the record"):
        synthesize(task, out=tmp_path / "blind", **given)


@pytest.mark.slow
def test_a_resumed_run_has_the_same_picture(task, good_source, tmp_path, warm):
    """It is drawn again with the same bytes, and its answer is not asked for again."""
    given = {"out": tmp_path / "run", "seed": 4, "vision": True, "judge": warm}
    given |= {"retry": AT_ONCE, "iterations": 2}
    first = Script(code(AHEAD), PermanentFault("no access"))
    with pytest.raises(Fault, match="no access"):
        synthesize(task, first, **given)
    file = tmp_path / "run" / PLACE / "edit.picture.png"
    before = file.read_bytes()
    file.unlink()
    second = Script(code(AHEAD + "# again\n"), PermanentFault("no access"))
    with pytest.raises(Fault, match="no access"):
        synthesize(task, second, **given)
    assert second.requests[0].images == first.requests[1].images
    assert file.read_bytes() == before
    file.unlink()
    last = Script(NO_RULES, code(good_source))
    assert synthesize(task, last, **given).passed
    assert last.asked() == [("summarise", 1, 1), ("generate", 2, 0)]
    assert file.read_bytes() == before


def test_an_answer_to_another_picture_is_not_reused(seen, tmp_path):
    """The key has the hash of the picture, and is as before without one."""
    _, model = seen
    edit = model.requests[1]
    (picture,) = edit.images
    other = replace(picture, png=picture.png + b"\0")
    moved = replace(picture, file=tmp_path / "edit.picture.png")
    keys = {call_key(model, replace(edit, images=(each,))) for each in (picture, other)}
    assert len(keys) == 2
    assert call_key(model, replace(edit, images=(moved,))) in keys
    facts = {
        "schema": 1,
        "model": model.name,
        "served_at": None,
        "kind": edit.kind,
        "prompt": edit.prompt,
        "max_tokens": edit.max_tokens,
        "sample": edit.sample,
        "turn": edit.turn,
    }
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
    assert call_key(model, replace(edit, images=())) == digest


def test_runs_with_and_without_pictures_are_different_runs(seen, task):
    out, model = seen
    with pytest.raises(RunError, match="pictures True instead of False"):
        synthesize(task, model, out=out, seed=4)


@pytest.mark.slow
def test_without_the_flag_a_run_is_as_it_always_was(
    seen, task, good_source, tmp_path, warm
):
    """The question has no word of a picture, and nothing else is different."""
    model = Script(code(AHEAD), code(good_source))
    run = synthesize(task, model, out=tmp_path / "run", seed=4, judge=warm)
    assert all(request.images == () for request in model.requests)
    before, _, section = seen[1].requests[1].prompt.partition("\n\n## A picture")
    after = section.partition("y points down.\n")[2]
    assert model.requests[1].prompt == f"{before}\n{after}"
    assert list(run.folder.rglob("*picture.png")) == []
    assert all("images" not in call for call in journal(run.folder, "call.intent"))
    assert "A failure of the previous" not in make_page(run.folder).html.decode()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ((), "--vision has no effect: builtin, which edits controllers, sees no"),
        (("--dry-run",), "--vision has no effect: builtin, which edits controllers"),
        (
            ("--learner", "openai:m", "--optimizer", "builtin"),
            "--vision has no effect: builtin",
        ),
        (
            ("--learner", "manual:mail", "-J", 0),
            "--vision has no effect without edits: give -J 1 or more",
        ),
    ],
)
def test_pictures_for_nobody_are_refused(refused, tmp_path, words, reason):
    folder = write_small_task(tmp_path / "task")
    err = refused(
        "synth", "--task", folder, "--vision", "--out", tmp_path / "run", *words
    )
    assert reason in " ".join(err.split())
    assert not (tmp_path / "run").exists()


def test_a_resumed_run_takes_the_flag_from_its_folder(refused, seen):
    err = refused("synth", "--resume", seen[0], "--vision")
    assert "leave out --vision" in err


PRICES = PriceList(
    dated=date(2026, 1, 2),
    models={
        "openai:dear": Price(input=10, output=50),
        "anthropic:cheap": Price(input=1, output=2),
    },
    schema=1,
)


@pytest.mark.parametrize("vendor", ["openai:dear", "anthropic:cheap"])
def test_a_forecast_counts_the_pictures(vendor):
    """One for each edit and variation, none for the others."""
    given = {"iterations": 4, "patience": 2, "candidates": 2, "variations": 4}
    models = ("openai:dear", vendor, PRICES)
    blind = cost_of("small", "question", *models, **given)
    shown = cost_of("small", "question", *models, **given, vision=True)
    assert blind.pictures == 0
    edits, variations = 2 * 2, 4
    assert shown.pictures == edits + variations
    assert shown.questions == blind.questions
    usd = picture_tokens(vendor) * PRICES.models[vendor].input / 1e6
    assert shown.cost_once - blind.cost_once == pytest.approx(8 * usd)
    assert shown.cost_most - blind.cost_most == pytest.approx(3 * 8 * usd)
    assert shown.first_cost == blind.first_cost


def test_the_rest_of_a_run_counts_the_pictures(seen):
    run = load_run(seen[0]).model_copy(
        update={"learner": "a", "optimizer": "b", "iterations": 3, "patience": 2}
    )
    tariff = Tariff(price=Price(input=1, output=1), picture_tokens=1000)
    tariffs = {"a": tariff, "b": tariff}
    for kind, j, pictures in (
        ("generate", 0, 2 * 3),
        ("edit", 1, 1 + 2 * 2),
        ("edit", 2, 2 * 2),
        ("summarise", 2, 2 * 2),
    ):
        request = Request(kind, "?", sample=(0, 1, j))
        worst = tariff.worst(request)
        most = [
            rest_of(each, tariffs, request, worst, 100).most
            for each in (run, run.model_copy(update={"vision": False}))
        ]
        assert most[0].tokens - most[1].tokens == 1000 * pictures


def test_a_dry_run_says_how_many_pictures(tdac, tmp_path):
    folder = write_small_task(tmp_path / "task")
    words = ("synth", "--task", folder, "--dry-run", "--vision", "-K", 3, "-J", 2)
    code_, _, err = tdac(*words, "--learner", "anthropic:claude-sonnet-5-5")
    assert code_ == 0
    assert "whole run: 12 questions (K=3, J=2) with 6 pictures if no" in err
