"""The options of a synthesis: declared once, for command, library and record."""

import subprocess
import sys
from dataclasses import fields

from tdac_agent.models.provider import MAX_OUTPUT_TOKENS
from tdac_agent.options import flag_of
from tdac_agent.runs.run_record import Run
from tdac_agent.synthesis.options import SynthOptions
from tdac_agent.synthesis.synthesize import ALIKE


def test_each_option_is_a_flag_with_a_help_text():
    """A sentence or two, which ends with a full stop or its default in brackets."""
    for field in fields(SynthOptions):
        flag = flag_of(field)
        assert flag is not None, field.name
        assert flag.help.endswith((".", "]")), field.name


def test_defaults_are_those_of_the_providers_and_the_record():
    """The record keeps options under their own names."""
    assert SynthOptions().max_output == MAX_OUTPUT_TOKENS
    kept = {*ALIKE, "vision", "seed", "episodes", "feedback_episodes", "then_verify"}
    assert kept <= {field.name for field in fields(SynthOptions)}
    assert kept <= Run.model_fields.keys()


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
