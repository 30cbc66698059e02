"""Planted faults are named as what they are, with the figures that were planted."""

import functools
import re

import pytest
from planted import PLANTS, fail, wrong_facts

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.storage.plain import MAX_MESSAGE
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.verify import verify

MAX_CHARS = 700


@functools.cache
def driven(number):
    """The planted episode and its task; driven once."""
    env, rollout = fail(PLANTS[number])
    return env.nominal, rollout


def found(number):
    task, rollout = driven(number)
    return diagnose(rollout, task)


@pytest.mark.slow
def test_nine_in_ten_are_named_right():
    """Of more than 40 faults on bundled maps at most one in ten gets another name."""
    named = [found(n).cause == plant.cause for n, plant in enumerate(PLANTS)]
    assert len(named) >= 40
    assert len({plant.map for plant in PLANTS} - {"room", "thin wall"}) == 10
    assert sum(plant.jitter > 0 for plant in PLANTS) >= 12
    assert sum(named) >= 0.9 * len(named)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(PLANTS)), ids=lambda n: PLANTS[n].fault)
def test_facts(number):
    """Cause, side, place, step, corner and words are those that were planted."""
    assert wrong_facts(PLANTS[number], found(number)) == [], found(number).text


@pytest.mark.slow_after(7)
@pytest.mark.parametrize("number", range(len(PLANTS)), ids=lambda n: PLANTS[n].fault)
def test_paragraph(number):
    """One bounded line that says whose it is, with no odd figures in it."""
    _, rollout = driven(number)
    diagnosis = found(number)
    text = diagnosis.text
    assert text.startswith(f"{rollout.name}: {diagnosis.cause}")
    assert diagnosis.episode == rollout.name
    assert len(text) <= MAX_CHARS
    assert text.isprintable()
    assert not re.search(r"\b(nan|inf)\b|-0\.0+\b|  ", text)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("number", range(0, len(PLANTS), 7))
def test_repeatable(number, tmp_path):
    """The same record gives the same paragraph, also when it was read from a file."""
    task, rollout = driven(number)
    first = diagnose(rollout, task)
    rollout.trajectory.save(tmp_path / "kept.npz")
    kept = Trajectory.load(tmp_path / "kept.npz")
    again = fail(PLANTS[number])[1]
    assert (kept.poses == again.trajectory.poses).all()
    assert diagnose(again, task) == first


COUNTS = "n = 0\n\n\ndef policy(obs):\n    global n\n    n += 1\n"
CONTROLLERS = {
    "NaN": (
        COUNTS + "    return (float('nan') if n > 4 else 0.5), 0.5\n",
        "contract",
        4,
        "two finite numbers (left, right), got (nan, 0.5)",
    ),
    "one number": (
        "def policy(obs):\n    return 0.5\n",
        "contract",
        0,
        "got 0.5",
    ),
    "three numbers": (
        "def policy(obs):\n    return 0.1, 0.2, 0.3\n",
        "contract",
        0,
        "got (0.1, 0.2, 0.3)",
    ),
    "no policy": (
        "def drive(obs):\n    return 0.5, 0.5\n",
        "contract",
        0,
        "no attribute 'policy'",
    ),
    "exception, with an address and a path in its text": (
        COUNTS
        + "    if n > 7:\n"
        + "        raise ValueError(f'no way {object()} in /var/lib/tdac-9/plan.txt')\n"
        + "    return 0.3, 0.3\n",
        "error",
        7,
        "ValueError at policy (line 8): no way <object object> in …/plan.txt.",
    ),
    "exception with a long text": (
        COUNTS + "    raise ValueError('x' * 5000)\n",
        "error",
        0,
        "ValueError at policy (line 7): xxx",
    ),
    "wrong key": (
        "def policy(obs):\n    return obs['gps'][0], 0.3\n",
        "error",
        0,
        "KeyError at policy (line 2): 'gps'",
    ),
    "attribute of an observation": (
        "def policy(obs):\n    return obs.pose[0], 0.3\n",
        "error",
        0,
        "has no attribute 'pose'",
    ),
    "exit": (
        "import sys\n" + COUNTS + "    sys.exit(3) if n > 2 else None\n"
        "    return 0.3, 0.3\n",
        "error",
        2,
        "SystemExit",
    ),
    "unknown module": (
        "import nowhere\n\n\ndef policy(obs):\n    return 0.3, 0.3\n",
        "error",
        0,
        "No module named 'nowhere'",
    ),
    "hangs": (
        COUNTS + "    while n > 5:\n        pass\n    return 0.3, 0.3\n",
        "time-out",
        5,
        "policy did not end within 1.5 s",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CONTROLLERS)
def test_controllers_that_fail(name, small_task, warm, quick):
    """What a controller did wrong is told with its step; bounded, nothing of ours."""
    source, cause, step, words = CONTROLLERS[name]
    report = verify(
        source, small_task, profile="policy", paper=True, judge=warm, limits=quick
    )
    failure = next(f for f in report.failures if f.test.endswith("test_reaches_goal"))
    diagnosis = failure.diagnosis
    assert (diagnosis.cause, diagnosis.step) == (cause, step), diagnosis.text
    assert words in diagnosis.text
    assert len(diagnosis.text) <= MAX_MESSAGE + 400
    assert not re.search(r"0x[0-9a-f]|/tmp|/var|assert|\n", diagnosis.text)
