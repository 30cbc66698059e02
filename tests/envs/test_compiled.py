"""Kernels: compiled once, kept on disk, and the same as the Python they are made of."""

import math
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from tdac_envs import contact, grid, kernels, machine_code, plan, rays
from tdac_envs.compiled import Kernel, kernel
from tdac_envs.contact import first_contact
from tdac_envs.grid import clearance
from tdac_envs.rays import cast_ray, leaps_of

HALF = 0.5


@kernel()
def _inner(x: float) -> float:
    return HALF * x


@kernel("f8[:,:] f8 i8 f4[:] -> f8")
def _sum(values, factor, count, out):
    total = 0.0
    for j in range(values.shape[0]):
        for i in range(values.shape[1]):
            total += values[j, i]
    for k in range(min(count, out.shape[0])):
        out[k] = k
    return _inner(total) * factor


@kernel("i8 i8 -> i8")
def _divide(a, b):
    return a // b


@kernel("i8 -> i8")
def _raised(a):
    return a + 5


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache, and kernels that are not loaded yet."""
    monkeypatch.setattr(machine_code, "cache_folder", lambda: tmp_path)
    return tmp_path


def fresh(of):
    return Kernel(of.function, of.signature)


def test_arguments_and_results(cache):
    """Numbers and arrays come as they are given; what is written is seen outside."""
    values, out = np.arange(6.0).reshape(2, 3), np.full(3, -1, np.float32)
    assert fresh(_sum)(values, 2.0, 2, out) == 15.0
    assert out.tolist() == [0.0, 1.0, -1.0]


def test_arrays_of_another_kind_are_converted(cache):
    """Other types and layouts are copied; another number of dimensions is refused."""
    add = fresh(_sum)
    out = np.zeros(1, np.float32)
    assert add(np.ones((4, 6), np.int32)[::2, ::3], 1.0, 0, out) == 2.0
    with pytest.raises(TypeError, match="2 dimensions, got 1"):
        add(np.ones(3), 1.0, 0, out)
    with pytest.raises(TypeError, match="expected 4 arguments, got 1"):
        add(np.ones(3))


def test_a_bound_call_reads_the_arrays_anew(cache):
    """What is in the arrays at the time of a call counts."""
    values, out = np.ones((1, 1)), np.zeros(2, np.float32)
    call = fresh(_sum).bind(values, 1.0, 2, out)
    call()
    assert out.tolist() == [0.0, 1.0]
    out[:] = 7
    call()
    assert out.tolist() == [0.0, 1.0]


def test_a_failing_kernel_raises(cache):
    """What would raise in Python does not crash the process."""
    divide = fresh(_divide)
    assert divide(7, 2) == 3
    with pytest.raises(ArithmeticError, match="_divide failed"):
        divide(1, 0)


def test_machine_code_is_kept(cache, monkeypatch):
    """The second time it is read from disk, unless the file is torn."""
    assert fresh(_divide)(9, 3) == 3
    (file,) = cache.iterdir()
    whole = file.read_bytes()
    monkeypatch.setattr(Kernel, "_compile", lambda _: pytest.fail("compiled again"))
    assert fresh(_divide)(9, 3) == 3
    monkeypatch.undo()
    monkeypatch.setattr(machine_code, "cache_folder", lambda: cache)
    file.write_bytes(whole[: len(whole) // 2])
    assert fresh(_divide)(9, 3) == 3
    assert len(file.read_bytes()) == len(whole)


@pytest.mark.parametrize("terminal", [True, False])
def test_compiling_is_told_on_a_terminal(cache, monkeypatch, terminal):
    """Once: it takes seconds, and nobody asked for it."""
    machine_code._tell.cache_clear()
    reading, writing = os.openpty() if terminal else os.pipe()
    with open(writing, "w") as stderr, open(reading, "rb", buffering=0) as seen:
        monkeypatch.setattr("sys.stderr", stderr)
        assert fresh(_divide)(9, 3) == fresh(_raised)(3) - 5 == 3
        stderr.write("the end\n")
        stderr.flush()
        assert seen.read(1000).count(b"compiling") == terminal


def test_a_changed_constant_is_other_code(monkeypatch):
    """The key depends on what inner kernels and constants say."""
    before = _sum._about()
    monkeypatch.setitem(globals(), "HALF", 0.25)
    assert _sum._about() != before


def test_a_cache_that_cannot_be_written_is_done_without(monkeypatch, tmp_path):
    """A full or read-only disk is no reason to stop."""
    monkeypatch.setattr(machine_code, "cache_folder", lambda: tmp_path / "missing")
    assert fresh(_divide)(9, 2) == 4


def test_kernels_are_pickled_by_name():
    """A worker process finds its own."""
    assert pickle.loads(pickle.dumps(first_contact)) is first_contact


def test_an_environment_needs_no_compiler_twice():
    """With its code on disk, a process makes and steps an environment without numba."""
    script = (
        "import sys, gymnasium as gym, tdac_envs\n"
        "env = gym.make('TDAC-Map2D-v0')\n"
        "env.reset(seed=0); env.step(env.action_space.sample())\n"
        "print('numba' in sys.modules)\n"
    )
    for _ in range(2):
        run = [sys.executable, "-c", script]
        done = subprocess.run(run, check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["False"]


def test_an_import_compiles_nothing():
    """What is heavy waits for the first environment."""
    script = (
        "import sys, tdac_envs\n"
        "print(sorted({'numba', 'llvmlite', 'cv2', 'scipy'} & set(sys.modules)))\n"
    )
    run = [sys.executable, "-c", script]
    done = subprocess.run(run, check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["[]"]


@pytest.mark.parametrize("seed", range(5))
def test_compiled_and_plain_agree(seed):
    """Machine code and the Python it was made of give the same numbers."""
    random = np.random.default_rng(seed)
    cells = random.random((24, 31)) < 0.2
    cells[10:14, 10:14] = False
    free = ~cells
    clear = clearance(cells)
    plain = np.empty_like(clear)
    rows, site = np.empty(cells.shape, np.int32), np.empty(33, np.int64)
    grid._clearance.function(cells, rows, site, np.empty((2, 34)), plain)
    np.testing.assert_array_equal(clear, plain)
    field = plan.distance_field(free, (12, 12))
    settled, buckets = np.zeros(cells.size, np.bool_), np.empty((3, 9000), np.int64)
    own = np.full(cells.shape, np.inf)
    plan._spread.function(free, 12, 12, own, settled, buckets)
    np.testing.assert_array_equal(field, own)
    leaps, padded = leaps_of(cells), np.pad(clear, 1)
    plain = np.zeros_like(leaps)
    rays._fill_leaps.function(cells, plain)
    np.testing.assert_array_equal(leaps, plain)
    for _ in range(20):
        x, y = random.uniform(10.5, 12.5, 2)
        angle, turn = random.uniform(-math.pi, math.pi, 2)
        ray = (leaps, x, y, angle, 40.0)
        assert cast_ray(*ray) == pytest.approx(rays.cast_ray.function(*ray), abs=1e-12)
        step = (padded, x, y, angle, random.uniform(-9, 9), turn, 1.0)
        exact = contact.first_contact.function(*step)
        assert first_contact(*step) == pytest.approx(exact, abs=1e-9)
        way = (leaps, field.astype(np.float32), x, y, 5.0)
        exact = kernels.path_distance.function(*way)
        assert kernels.path_distance(*way) == pytest.approx(exact, rel=1e-5)
