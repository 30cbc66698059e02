"""A verdict does not depend on the tier that was asked for."""

import json

import pytest

STILL = "\n\ndef policy(obs):\n    return 0.0, 0.0\n"


@pytest.mark.slow_after(2)
@pytest.mark.parametrize(
    ("more", "code", "flags"),
    [("", 0, ["--no-confirm"]), (STILL, 1, []), ("", 0, [])],
    ids=["good", "bad", "confirmed"],
)
def test_every_tier_gives_the_verdict_that_is_due(tdac, good, tier, more, code, flags):
    """Named on the command line, it is the one used, and its verdict is the right one.

    The good controller passes each test; the bad one, which stands still, fails those
    of driving and no other.
    """
    file = good / "controller.py"
    file.write_text(file.read_text() + more)
    ended, said, _ = tdac("verify", good, "--tier", tier, "--json", *flags)
    report = json.loads(said)
    failed = {test for test, outcome in report["tests"].items() if outcome != "passed"}
    assert ended == code
    assert report["provenance"]["sandbox"] == tier
    assert len(report["tests"]) == 41
    assert bool(failed) == bool(code)
    assert {test.partition("::")[0] for test in failed} <= {"test_end_to_end.py"}
