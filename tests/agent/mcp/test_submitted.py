"""The file in what an agent submits: all of it, or a refusal that does not count."""

import pytest
from script import STILL

from tdac_agent.mcp.answers import Refused
from tdac_agent.mcp.submitted import source_of


@pytest.mark.parametrize(
    "text",
    [STILL, f"```python\n{STILL}```\n", f"\ufeff```\n{STILL}```", f" ```\n{STILL}```"],
)
def test_a_file_is_taken_as_it_is_or_out_of_its_fence(text):
    """Agents send the file, or an answer with it."""
    assert source_of(text) == STILL


@pytest.mark.parametrize("text", ["x = (\n", "import math\n", "Here it is."])
def test_what_is_no_controller_is_judged_as_it_is(text):
    """The tests say what is wrong with it."""
    assert source_of(text) == text


REFUSED = {
    " \n": "is empty",
    "x" * 200_001: "200001 bytes",
    f"```python\n{STILL}": "has no end",
    f"# ... unchanged ...\n{STILL}": "leaves out code",
    f"def helper():\n    ...\n\n\n{STILL}": "leaves out code",
    f"```python\n# ... imports unchanged\n{STILL}```": "leaves out code",
}


@pytest.mark.parametrize("text", REFUSED, ids=range(len(REFUSED)))
def test_what_is_no_whole_file_does_not_count(text):
    """Its reason is told, and the budget stays."""
    with pytest.raises(Refused, match=REFUSED[text]) as caught:
        source_of(text)
    assert str(caught.value).endswith("was not judged and does not count")
