"""Many calls of one kernel, in one go."""

import copy
import gc
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tdac_envs.compiled import kernel
from tdac_envs.rows import Rows


@kernel("f8[:] i8[:] ->")
def _scaled(values, factor):
    for i in range(values.shape[0]):
        values[i] *= factor[0]


@kernel("f8[:] i8[:] ->")
def _raised(values, summand):
    for i in range(values.shape[0]):
        values[i] += summand[0]


@kernel("i8[:] ->")
def _inverted(value):
    value[0] = 100 // value[0]


TASKS = Path("/proc/self/task")
needs_tasks = pytest.mark.skipif(not TASKS.exists(), reason="no /proc/self/task")


def _started(call) -> set[str]:
    """The threads that a call starts."""
    before = set(os.listdir(TASKS))
    call()
    return set(os.listdir(TASKS)) - before


def _have_ended(threads: set[str]) -> bool:
    """Whether they end within a while."""
    return _comes_true(lambda: not threads & {*os.listdir(TASKS)})


def _comes_true(check) -> bool:
    """Whether it does within a while."""
    end = time.monotonic() + 20.0
    while not (true := check()) and time.monotonic() < end:
        time.sleep(0.01)
    return true


@pytest.mark.parametrize("count", [1, 63, 64, 65, 1000])
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_each_row_is_called_once(count, threads):
    """With arrays of any length; whatever the number of threads."""
    arrays = [np.arange(1.0 + k % 7) for k in range(count)]
    rows = Rows((_scaled,), [(a, np.array([k])) for k, a in enumerate(arrays)], threads)
    rows.call_all()
    rows.close()
    for k, array in enumerate(arrays):
        np.testing.assert_array_equal(array, k * np.arange(1.0 + k % 7))


def test_one_row_alone_and_with_other_arrays():
    """Only that one is written to; what was put in its place counts."""
    first, second, other = np.ones(2), np.ones(2), np.ones(3)
    rows = Rows((_scaled,), [(first, np.array([2])), (second, np.array([3]))])
    rows.call(np.array([1]))
    rows.put(0, other, np.array([5]))
    rows.call(np.array([0]))
    assert (first.tolist(), second.tolist()) == ([1, 1], [3, 3])
    assert other.tolist() == [5, 5, 5]
    rows.put(1, first, np.array([7]))
    rows.call_all()
    assert (first.tolist(), second.tolist()) == ([7, 7], [3, 3])
    assert other.tolist() == [25, 25, 25]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_failing_row_is_told(threads):
    """As with one call; the others are made all the same."""
    values = [np.array([k % 200]) for k in range(300)]
    rows = Rows((_inverted,), [(value,) for value in values], threads)
    with pytest.raises(ArithmeticError, match="_inverted failed"):
        rows.call_all()
    assert values[299][0] == 100 // 99
    with pytest.raises(ArithmeticError, match="_inverted failed"):
        rows.call(np.array([0]))
    rows.close()


@needs_tasks
def test_threads_end_with_the_rows():
    """Closing leaves none behind; the next call starts them again."""
    arguments = [(np.ones(1), np.array([1])) for _ in range(500)]
    rows = Rows((_scaled,), arguments, 3)
    for _ in range(2):
        helpers = _started(rows.call_all)
        rows.close()
        assert len(helpers) == 2
        assert _have_ended(helpers)


def test_addresses_are_not_copied():
    """A copy would write to memory that is not its own."""
    with pytest.raises(TypeError, match="cannot be copied"):
        copy.copy(Rows((_scaled,), [(np.ones(1), np.array([1]))]))


@pytest.mark.parametrize("threads", [1, 3])
def test_each_row_has_the_kernel_of_its_kind(threads):
    """Rows that are not called stay as they are."""
    values, numbers = np.ones((400, 2)), np.arange(400)[:, None]
    arguments = zip(values, numbers, strict=True)
    kinds = np.zeros(400, np.uint8)
    rows = Rows((_scaled, _raised), arguments, threads, kinds=kinds)
    kinds[:] = np.arange(400) % 3 == 0
    called = np.flatnonzero(np.arange(400) % 5)
    rows.call(called)
    rows.close()
    expected = np.where(kinds[:, None], 1.0 + numbers, 1.0 * numbers)
    expected[::5] = 1.0
    np.testing.assert_array_equal(values, expected * np.ones((1, 2)))


@pytest.mark.parametrize("threads", [1, 3])
def test_what_goes_in_and_comes_out_is_copied(threads):
    """Of each row that is called, from and to arrays of any stride and type."""
    memory, factors = np.zeros((300, 5)), np.arange(300)[:, None]
    inner, given = memory[:, 1:3], np.random.default_rng(0).random((300, 2))
    arguments = [(memory[k], factors[k]) for k in range(300)]
    names = np.arange(300, dtype=np.uint8).reshape(300, 1, 1)
    rows = Rows(
        (_scaled,),
        arguments,
        threads,
        inputs=[[(given, inner)]],
        outputs=(inner, names, memory),
    )
    found, same, whole = rows.call_all()
    np.testing.assert_array_equal(found, given * factors)
    np.testing.assert_array_equal(same, names)
    np.testing.assert_array_equal(whole, memory)
    assert same.dtype == np.uint8
    kept = found.copy()
    given[:] = 1.0
    rows.call(np.arange(7, 290))
    np.testing.assert_array_equal(inner[7:290], factors[7:290] * np.ones((1, 2)))
    np.testing.assert_array_equal(inner[290:], kept[290:])
    again, *_ = rows.call_all()
    rows.close()
    np.testing.assert_array_equal(again, factors * np.ones((1, 2)))
    np.testing.assert_array_equal(found, kept)


@pytest.mark.parametrize("threads", [1, 3])
def test_columns_are_copied_as_what_they_are_listed_by(threads):
    """Numbers of any stride: as they are, whole, or whether they are not 0."""
    memory = np.random.default_rng(0).integers(-2, 3, (300, 4)) * 1.0
    memory[0] = np.nan, np.inf, -np.inf, 0.5
    counts, before = memory[1:, 2], memory.copy()
    arguments = [(row, np.array([3])) for row in memory]
    columns = {
        np.dtype(bool): [memory[:, 0], np.broadcast_to(1.0, 300), memory[:, 3]],
        np.dtype(float): [memory[:, 1]],
    }
    rows = Rows((_scaled,), arguments, threads, outputs=[memory], columns=columns)
    whole, flags, measures = rows.call_all()
    np.testing.assert_array_equal(whole, 3 * before)
    expected = [before[:, 0] != 0, np.ones(300, bool), before[:, 3] != 0]
    np.testing.assert_array_equal(flags, expected)
    np.testing.assert_array_equal(measures, [3 * before[:, 1]])
    assert (flags.dtype, measures.dtype) == (bool, float)
    rows = Rows(
        (_scaled,), arguments[1:], threads, columns={np.dtype(np.int64): [counts]}
    )
    (wholes,) = rows.call_all()
    np.testing.assert_array_equal(wholes, [9 * before[1:, 2]])
    assert wholes.dtype == np.int64


def test_inputs_are_those_of_the_row_s_kernel():
    """A row whose kernel takes none keeps what it has."""
    values, kinds = np.zeros((200, 2)), np.zeros(200, np.uint8)
    given = np.arange(400.0).reshape(200, 2)
    arguments = [(row, np.array([0])) for row in values]
    rows = Rows(
        (_raised, _raised), arguments, 2, kinds=kinds, inputs=[(), [(given, values)]]
    )
    kinds[5:] = 1
    rows.call_all()
    rows.close()
    np.testing.assert_array_equal(values[:5], 0.0)
    np.testing.assert_array_equal(values[5:], given[5:])


def test_threads_that_were_woken_in_vain_help_in_the_next_call():
    """Whether they look for it still, or sleep again."""
    counts = np.zeros((500, 1))
    rows = Rows((_raised,), [(each, np.array([1])) for each in counts], 3)
    rows.wake()
    for pause in (0.0, 0.0, 0.02, 0.0, 0.02):
        rows.call_all()
        rows.wake()
        rows.wake()
        time.sleep(pause)
    rows.close()
    assert (counts == 5).all()


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="no /proc/self/fd")
def test_pipes_end_with_the_threads():
    """Environments that come and go use nothing up."""
    arguments = [(np.ones(1), np.array([1])) for _ in range(500)]
    rows = Rows((_scaled,), arguments, 3)
    before = set(os.listdir("/proc/self/fd"))
    rows.call_all()
    pipes = {*os.listdir("/proc/self/fd")} - before
    assert len(pipes) == 4
    rows.close()
    rows.wake()
    assert _comes_true(lambda: not pipes & {*os.listdir("/proc/self/fd")})


def test_without_a_descriptor_for_a_helper_the_others_do_it():
    """It is told once, and what has begun goes on."""
    script = (
        "import os, resource, warnings\n"
        "from test_rows import Rows, _raised, np\n"
        "value = np.ones((500, 1))\n"
        "rows = Rows((_raised,), [(v, np.array([1])) for v in value], 4)\n"
        "rows.call(np.arange(3))\n"
        "free = max(map(int, os.listdir('/proc/self/fd'))) + 1\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (free, free))\n"
        "with warnings.catch_warnings(record=True) as told:\n"
        "    warnings.simplefilter('always')\n"
        "    for _ in range(3):\n"
        "        rows.call_all()\n"
        "assert (value[3:] == 4).all()\n"
        "print(*(str(each.message) for each in told), sep='\\n')\n"
    )
    told = _script(script)
    assert told.startswith("1 thread instead of more: ")
    assert told.count("\n") == 1


def test_first_calls_in_two_threads_at_once():
    """The machine code of neither is dropped."""
    script = (
        "import threading\n"
        "from test_rows import Rows, _raised, np\n"
        "values = np.ones((2, 500, 1))\n"
        "def go(value):\n"
        "    rows = Rows((_raised,), [(v, np.array([1])) for v in value], 2)\n"
        "    for _ in range(200):\n"
        "        rows.call_all()\n"
        "both = [threading.Thread(target=go, args=(v,)) for v in values]\n"
        "for each in both: each.start()\n"
        "for each in both: each.join()\n"
        "assert (values == 201).all()\n"
    )
    _script(script)


def test_an_interrupt_at_any_place_leaves_whole_rows():
    """Also where a row's arguments are being replaced by such of another shape."""
    values = [np.zeros(3) for _ in range(200)]
    rows = Rows((_raised,), [(v, np.array([1])) for v in values], 2)
    rows.call_all()
    for place in range(1, 400):
        row = place % 200
        values[row] = np.zeros(1 + place % 4)
        _interrupted(lambda k=row: rows.put(k, values[k], np.array([1])), place % 40)
        rows.put(row, values[row], np.array([1]))
        before = [value.copy() for value in values]
        rows.call_all()
        for old, new in zip(before, values, strict=True):
            np.testing.assert_array_equal(new, old + 1)
    rows.close()


def _interrupted(call, place: int) -> None:
    """Makes a call that is interrupted before the so many-th line in this package."""
    left = place

    def trace(frame, event, _):
        nonlocal left
        if "tdac_envs" not in frame.f_code.co_filename:
            return None
        if event == "line":
            left -= 1
            if left == 0:
                raise KeyboardInterrupt
        return trace

    sys.settrace(trace)
    try:
        call()
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(None)


def _script(text: str) -> str:
    """What a script prints that runs in a process of its own."""
    command = [sys.executable, "-W", "ignore", "-c", text]
    here = Path(__file__).parent
    return subprocess.run(
        command, check=True, timeout=120, cwd=here, stdout=subprocess.PIPE, text=True
    ).stdout


def test_each_call_is_whole_when_it_returns():
    """However many follow one another: nobody comes late and makes it again."""
    counts = np.zeros((500, 1))
    rows = Rows((_raised,), [(each, np.array([1])) for each in counts], 6)
    sums = []
    for k in range(1, 400):
        rows.call(np.arange(500 - k))
        sums.append(counts.sum())
    rows.close()
    np.testing.assert_array_equal(np.diff(sums), 500.0 - np.arange(2, 400))
    np.testing.assert_array_equal(counts[:, 0], np.clip(499 - np.arange(500), 0, 399))


@needs_tasks
def test_threads_end_with_an_object_that_is_forgotten():
    """It need not be closed."""
    rows = Rows((_scaled,), [(np.ones(1), np.array([1])) for _ in range(500)], 3)
    helpers = _started(rows.call_all)
    assert len(helpers) == 2
    del rows
    gc.collect()
    assert _have_ended(helpers)


def test_a_forked_process_has_threads_of_its_own():
    """Those of its parent are not there."""
    script = (
        "import os\n"
        "from test_rows import Rows, _scaled, np\n"
        "value = np.ones((500, 1))\n"
        "rows = Rows((_scaled,), [(v, np.array([2])) for v in value], 3)\n"
        "rows.call_all()\n"
        "child = os.fork()\n"
        "rows.call_all()\n"
        "assert (value == 4).all()\n"
        "if child:\n"
        "    assert os.waitpid(child, 0)[1] == 0\n"
    )
    _script(script)
