"""Options that all tests share."""

from __future__ import annotations

import atexit
import gc
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from file_halves import is_in_half

SAMPLE = 80
ROOT = Path(__file__).resolve().parents[1]
REAL_DATA = ROOT.parent / "shared" / "data"
# Their tests import the benchmarks, which are never installed.
sys.path.append(str(ROOT))


def pytest_configure(config: pytest.Config) -> None:
    """Interrupts reach what tests start, also where they are run in the background."""
    _set_up_hypothesis()
    _set_up_secret()
    if not hasattr(config, "workerinput") and not config.option.collectonly:
        _compile_kernels()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # `nohup` has SIGHUP ignored. Commands that tests run take it, so that processes
    # would begin with or without it, depending on the test that starts them.
    for number in (signal.SIGHUP, signal.SIGQUIT):
        if signal.getsignal(number) == signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collects without the garbage collector, which then ignores what stays."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


def _set_up_secret() -> None:
    """An installation of the tests' own, whose secret is the same in each run."""
    # Not a TemporaryDirectory: since Python 3.13, a forked child of multiprocessing
    # drops the functions of atexit, and with them the object, which removes its folder.
    folder = tempfile.mkdtemp(prefix="tdac-state-")
    secret = Path(folder, "tdac", "secret")
    secret.parent.mkdir()
    secret.touch(0o600)
    secret.write_bytes(bytes(range(32)))
    os.environ["XDG_STATE_HOME"] = folder
    atexit.register(shutil.rmtree, folder, ignore_errors=True)


def _compile_kernels() -> None:
    """Compiles before the first test, whose output would report it otherwise."""
    from tdac_envs.core.code_cache import cache_folder

    folder = cache_folder()
    if folder is not None and not any(folder.rglob("*.nbi")):
        subprocess.run([sys.executable, "-m", "tdac_agent", "warm"], check=True)


def _set_up_hypothesis() -> None:
    try:
        from hypothesis import HealthCheck, settings
    except ImportError as error:
        command = f"{sys.executable} -m pip install -e '{ROOT}[test]'"
        message = f"the tests need the extra `test`: {command}"
        raise pytest.UsageError(message) from error
    # How long an example takes says more of the machine's other work than of the code.
    settings.register_profile(
        "calm",
        deadline=None,
        max_examples=50,
        suppress_health_check=[HealthCheck.too_slow],
    )
    settings.load_profile("calm")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Maps and worlds by other people; tests that need them skip without."""
    if not REAL_DATA.is_dir():
        pytest.skip(f"{REAL_DATA.name} is not beside this checkout")
    return REAL_DATA


@pytest.fixture(scope="session", autouse=True)
def one_set_of_types() -> Iterator[None]:
    """No kernel is compiled for two: numba's cache mixes them up between processes."""
    yield
    compiled = sys.modules.get("tdac_envs.core.compiled")
    kernels = compiled.KERNELS if compiled else []
    several = [each for each in kernels if len(getattr(each, "signatures", ())) > 1]
    assert not several, [(each.py_func, each.signatures) for each in several]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Keeps a seeded sample of the slow tests, or the tests of half of the files.

    TDAC_SLOW_SAMPLE is the seed of the sample, TDAC_TEST_PART that of the files.
    """
    _mark_later_cases(items)
    if part := os.environ.get("TDAC_TEST_PART"):
        others = [each for each in items if not is_in_half(part, each.nodeid)]
        config.hook.pytest_deselected(items=others)
        items[:] = [item for item in items if item not in set(others)]
    seed = os.environ.get("TDAC_SLOW_SAMPLE")
    slow = sorted((i for i in items if i.get_closest_marker("slow")), key=_order)
    if seed is None or len(slow) <= SAMPLE:
        return
    kept = set(random.Random(seed).sample(slow, SAMPLE))
    dropped = [item for item in slow if item not in kept]
    config.hook.pytest_deselected(items=dropped)
    items[:] = [item for item in items if item not in dropped]


def _mark_later_cases(items: list[pytest.Item]) -> None:
    """Of a test with `slow_after(N)` all cases but the first N are slow."""
    seen: Counter[str] = Counter()
    for item in items:
        if mark := item.get_closest_marker("slow_after"):
            test = item.nodeid.partition("[")[0]
            seen[test] += 1
            if seen[test] > mark.args[0]:
                item.add_marker(pytest.mark.slow)


def _order(item: pytest.Item) -> int:
    return zlib.crc32(item.nodeid.encode())
