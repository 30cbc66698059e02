"""A model that puts markup into everything that it is asked for."""

import json

from tdac_agent.models.provider import Reply

EVIL = "</script><script>window.hacked = 1</script><img src=x onerror='hacked=1'>"
SUITE = f"""import pytest

@pytest.mark.parametrize("n", [1], ids=[{EVIL!r}])
def test_own(n):
    assert n == 2, {EVIL!r}
"""
CRASHES = f"""# {EVIL}
def policy(obs):
    raise ValueError({EVIL!r})
"""
CRASHES_LATER = f"""# {EVIL}
# ]]> \u202e --> &lt;
def policy(obs):
    if obs["pose"][0] > 45:
        raise ValueError({EVIL!r})
    return 1.0, 1.0
"""


class Model:
    """Answers with given sources in their order, and with one rule each time."""

    name = f"model {EVIL}"
    paid = False

    def __init__(self, *sources):
        self.sources = list(sources)

    def complete(self, request):
        if request.kind == "summarise":
            rule = {"op": "add", "scope": "code", "text": f"Rule of {EVIL}"}
            return Reply(f"```json\n{json.dumps([rule])}\n```", tokens_in=7)
        source = self.sources.pop(0)
        return Reply(
            f"```python\n{source}```\n" if source else EVIL,
            tokens_in=100,
            tokens_out=10,
            notes=(f"note {EVIL}",),
        )
