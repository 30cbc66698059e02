"""A compiled loop over many rows, on several threads."""

import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from tdac_envs.core.compiled import kernel
from tdac_envs.core.slices import Slices


@kernel
def _raised(rows, values):
    for row in rows:
        values[row] += 1 + row


def raised_by(slices, values, rows):
    slices.run(lambda some: _raised(some, values), rows)


@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 1000])
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_each_row_is_called_once(count, threads):
    """Whatever the number of threads; rows that are not named stay as they are."""
    values, slices = np.zeros(1200, np.int64), Slices(threads)
    rows = np.random.default_rng(0).permutation(1200)[:count]
    for _ in range(20):
        raised_by(slices, values, rows)
    slices.close()
    expected = np.zeros(1200)
    expected[rows] = 20 * (1 + rows)
    np.testing.assert_array_equal(values, expected)


@pytest.mark.parametrize("failing", [0, 999])
def test_a_failing_row_is_told_when_nobody_is_at_work_any_more(failing):
    """Be it the caller's or another thread's; the next call works."""
    at_work, slices = [], Slices(3)

    def loop(rows):
        at_work.append(True)
        try:
            if failing in rows:
                raise ArithmeticError("failed")
            time.sleep(0.05)
        finally:
            at_work.pop()

    with pytest.raises(ArithmeticError, match="failed"):
        slices.run(loop, np.arange(1000))
    assert not at_work
    values = np.zeros(1000, np.int64)
    raised_by(slices, values, np.arange(1000))
    slices.close()
    np.testing.assert_array_equal(values, 1 + np.arange(1000))


def test_threads_end_with_the_slices():
    """Closing leaves none behind, nor does forgetting; the next call starts them."""
    slices, values = Slices(3), np.zeros(500, np.int64)
    for _ in range(2):
        before = set(threading.enumerate())
        raised_by(slices, values, np.arange(500))
        helpers = set(threading.enumerate()) - before
        assert len(helpers) == 2
        slices.close()
        for helper in helpers:
            helper.join(60)
            assert not helper.is_alive()
    raised_by(slices, values, np.arange(500))
    helpers = set(threading.enumerate()) - before
    del slices
    for helper in helpers:
        helper.join(60)
        assert not helper.is_alive()


def _script(text):
    """What a script prints that runs in a process of its own."""
    command = [sys.executable, "-W", "ignore", "-c", text]
    here = Path(__file__).parent
    return subprocess.run(
        command, check=True, cwd=here, stdout=subprocess.PIPE, text=True
    ).stdout


@pytest.mark.slow
def test_a_forked_process_has_threads_of_its_own():
    """Those of its parent are not there."""
    _script(
        "import os\n"
        "from test_slices import Slices, raised_by, np\n"
        "values, slices = np.zeros(500, np.int64), Slices(3)\n"
        "raised_by(slices, values, np.arange(500))\n"
        "child = os.fork()\n"
        "raised_by(slices, values, np.arange(500))\n"
        "assert (values == 2 * (1 + np.arange(500))).all()\n"
        "if child:\n"
        "    assert os.waitpid(child, 0)[1] == 0\n"
    )


@pytest.mark.slow
def test_where_no_thread_can_be_started_the_caller_s_does_all():
    """It is told once."""
    told = _script(
        "import threading, warnings\n"
        "from test_slices import Slices, raised_by, np\n"
        "values, slices = np.zeros(500, np.int64), Slices(4)\n"
        "threading.stack_size(1 << 47)  # no memory for it\n"
        "with warnings.catch_warnings(record=True) as told:\n"
        "    warnings.simplefilter('always')\n"
        "    for _ in range(3):\n"
        "        raised_by(slices, values, np.arange(500))\n"
        "assert (values == 3 * (1 + np.arange(500))).all()\n"
        "print(*(str(each.message) for each in told), sep='\\n')\n"
    )
    assert told == "using 1 thread instead of 4: can't start new thread\n"


def test_first_calls_in_two_threads_at_once():
    """Both come to whole rows."""
    values = np.zeros((2, 500), np.int64)

    def go(own):
        slices = Slices(2)
        for _ in range(200):
            raised_by(slices, own, np.arange(500))
        slices.close()

    both = [threading.Thread(target=go, args=(own,)) for own in values]
    for each in both:
        each.start()
    for each in both:
        each.join()
    np.testing.assert_array_equal(values, 200 * np.tile(1 + np.arange(500), (2, 1)))
