"""The options of a synthesis: declared once, for command, library and record."""

import subprocess
import sys
from dataclasses import dataclass, fields

import pytest
import typer
import yaml
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent.campaign import config as campaign_file
from tdac_agent.campaign.config import CampaignError, read_config
from tdac_agent.campaign.perform import Terms, perform
from tdac_agent.campaign.plan import PlannedRun, make_plan
from tdac_agent.cli import synth_flags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.errors import RunError
from tdac_agent.models.provider import MAX_OUTPUT_TOKENS
from tdac_agent.option_fields import flag_of, option
from tdac_agent.runs.ownership import is_own_folder, load_task
from tdac_agent.runs.run_record import Run, load_run
from tdac_agent.synthesis import synthesize as synthesis
from tdac_agent.synthesis.options import SynthOptions


def test_each_option_is_a_flag_with_a_help_text():
    """A sentence or two, which ends with a full stop or its default in brackets."""
    for field in fields(SynthOptions):
        flag = flag_of(field)
        assert flag is not None, field.name
        assert flag.help.endswith((".", "]")), field.name


FIELDS = {
    *("search", "iterations", "patience", "candidates", "improve", "ask", "envelope"),
    *("omit", "refine", "base_url", "max_output", "episodes", "feedback_episodes"),
}
"""Options with a field of their own in the record; others are in its `options`."""


def test_defaults_are_those_of_the_providers_and_the_record():
    """The record keeps options under their own names."""
    assert SynthOptions().max_output == MAX_OUTPUT_TOKENS
    kept = SynthOptions().recorded("set").keys()
    assert kept >= FIELDS
    assert Run.model_fields.keys() >= {*FIELDS, "confirm"}
    assert SynthOptions().recorded("task").keys() - kept == {"confirm"}


def test_the_options_import_nothing_slow():
    """The command reads them when it starts."""
    slow = "numpy", "pydantic", "jinja2", "tdac_envs", "tdac_agent.models.provider"
    words = (
        "import sys, tdac_agent.synthesis.options;"
        f"print([each for each in {slow} if each in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", words], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@dataclass(frozen=True, slots=True)
class Louder(SynthOptions):
    """The options with two further ones, the second of which tells runs apart."""

    loud: int = option(0, "Say everything so often.", least=0)
    kind: str = option("plain", "Kind of the words.", identity=True)


class Told(Louder):
    """Tells what would reach the library."""

    def changed(self, **values):
        words = (values.get(name, getattr(self, name)) for name in ("loud", "kind"))
        raise TypeError("{} {}".format(*words))


class Interrupts:
    """A model in whose first answer the user interrupts the run."""

    name, paid = "builtin", False

    def complete(self, request):
        raise KeyboardInterrupt


@pytest.fixture
def problem(tmp_path):
    return load_task(write_small_task(tmp_path / "task", profile="policy"))


@pytest.fixture
def begun(problem, tmp_path, warm):
    """The folder of a run that was interrupted."""

    def begin(**values):
        words = {"options": Louder(**values), "judge": warm}
        with pytest.raises(KeyboardInterrupt):
            synthesize(problem, Interrupts(), out=tmp_path / "run", **words)
        return tmp_path / "run"

    return begin


@pytest.fixture
def command(monkeypatch):
    """`tdac synth` with the further options; it tells them."""
    declared = synth_flags.synth.__wrapped__
    monkeypatch.setitem(declared.__annotations__, "options", Told)
    app = typer.Typer()
    app.command()(typed_options("synth:run")(declared))
    return lambda *words: app([*map(str, words)], standalone_mode=False)


def test_a_further_option_is_recorded_and_reaches_the_loop(begun, monkeypatch):
    """The record keeps it, and its mark covers it; the loop has it in its terms."""
    seen, trials_of = [], synthesis.trials_of

    def watched(about, terms):
        seen.append(terms.options.loud)
        return trials_of(about, terms)

    monkeypatch.setattr(synthesis, "trials_of", watched)
    run = load_run(begun(loud=3))
    assert (run.options, seen) == ({"loud": 3, "kind": "plain"}, [3])
    assert is_own_folder(run)
    assert not is_own_folder(run.model_copy(update={"options": {"loud": 4}}))


def test_a_further_option_of_a_resumed_run(begun, command):
    """The recorded value, or a new one, unless that would be another run."""
    out = begun(loud=3, kind="odd")
    with pytest.raises(TypeError, match=r"^3 odd$"):
        command("--resume", out)
    with pytest.raises(TypeError, match=r"^5 odd$"):
        command("--resume", out, "--loud", 5)
    with pytest.raises(RunError, match="as it was begun: leave out --kind"):
        command("--resume", out, "--kind", "odd")


def test_a_further_option_tells_runs_apart(begun):
    """The same command with another value is another run if the option says so."""
    begun(loud=3)
    assert load_run(begun(loud=4)).options["loud"] == 4
    with pytest.raises(RunError, match="kind plain instead of odd"):
        begun(kind="odd")


def test_an_option_that_is_not_known_is_not_resumed(begun, tdac):
    """It may be of another version; the message names it, and where it is."""
    out = begun(loud=3)
    code, _, err = tdac("synth", "--resume", out)
    assert code == 2
    assert f"{out / 'run.json'}: there is no option 'loud'" in err


@pytest.fixture
def campaign(tmp_path):
    """The file of a campaign."""
    write_small_task(tmp_path / "small")

    def write(**changes):
        content = {"schema": 1, "name": "few", "tasks": ["small"], "runs": 1}
        file = tmp_path / "few.yaml"
        file.write_text(yaml.safe_dump({**content, "learners": ["builtin"], **changes}))
        return file

    return write


@pytest.mark.parametrize("about", [{}, {"tasks": [], "sets": ["known"]}])
def test_a_further_option_of_a_campaign(campaign, tmp_path, monkeypatch, about):
    """The file sets it for each run, and another value makes other runs."""
    monkeypatch.setattr(campaign_file, "SynthOptions", Louder)
    monkeypatch.setattr(synthesis, "SynthOptions", Told)
    names = set()
    for options in ({}, {"loud": 2}, {"loud": 3}):
        file = campaign(**about, options=options)
        (planned,) = make_plan(read_config(file), file.parent).all()
        names.add(planned.name)
    assert len(names) == 3
    again = PlannedRun.from_json(planned.to_json())
    assert again == planned
    terms = Terms(str(tmp_path / "out"), 1, None, None, "all")
    assert perform(again, terms, None).reason == "TypeError: 3 plain"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"loud": 1},
            "there is no option 'loud'; expected one of ask, base_url, candidates",
        ),
        ({"candidates": "two"}, "candidates: expected int, got 'two'"),
        ({"improve": 31}, "improve: expected at least 32, got 31"),
        ({"patience": 2}, "patience is set by another key of this file"),
        ({"tier": "none"}, "there is no option 'tier'"),
    ],
)
def test_options_that_a_campaign_cannot_have(campaign, options, message):
    with pytest.raises(CampaignError, match=message):
        read_config(campaign(options=options))
