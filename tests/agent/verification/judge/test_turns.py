"""Work side by side and alone: who may overlap with whom."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from tdac_agent.verification.judge.turns import Turns

PLACES = 3


def test_nothing_goes_on_beside_what_is_alone():
    """Of 400 pieces of work, every tenth alone: no two overlap that must not."""
    turns, lock = Turns(PLACES), threading.Lock()
    beside, alone, wrong = [0], [0], []

    def work(number):
        mine, other = (alone, beside) if number % 10 == 0 else (beside, alone)
        with turns.alone() if mine is alone else turns.beside():
            with lock:
                mine[0] += 1
                if other[0] or alone[0] > 1 or beside[0] > PLACES:
                    wrong.append((number, beside[0], alone[0]))
            sum(range(2000))
            with lock:
                mine[0] -= 1

    with ThreadPoolExecutor(2 * PLACES) as pool:
        list(pool.map(work, range(400)))
    assert wrong == []
    assert beside == alone == [0]


def test_some_work_side_by_side():
    """All the places can be taken at once: each waits there for the others."""
    turns = Turns(PLACES)
    together = threading.Barrier(PLACES, timeout=60)

    def work():
        with turns.beside():
            together.wait()

    with ThreadPoolExecutor(PLACES) as pool:
        for future in [pool.submit(work) for _ in range(PLACES)]:
            future.result()


def test_who_wants_to_be_alone_is_not_overtaken():
    """It gets its turn while others go on asking for theirs."""
    turns, begun, was_alone = Turns(PLACES), threading.Event(), threading.Event()

    def keep_asking():
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            with turns.beside():
                begun.set()
            if was_alone.is_set():
                return True
        return False

    with ThreadPoolExecutor(PLACES) as pool:
        asking = [pool.submit(keep_asking) for _ in range(PLACES)]
        begun.wait()
        with turns.alone():
            was_alone.set()
    assert all(future.result() for future in asking)


@pytest.mark.parametrize("kind", ["beside", "alone"])
def test_an_error_gives_the_place_back(kind):
    """Otherwise the next one would wait for ever."""
    turns = Turns(1)
    for _ in range(2):
        with pytest.raises(ValueError, match="mine"), getattr(turns, kind)():
            raise ValueError("mine")
    with turns.alone():
        pass
