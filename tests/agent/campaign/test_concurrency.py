"""How many questions are asked at a time."""

import os
import subprocess
import sys
import threading

import pytest

from tdac_agent.campaign.concurrency import (
    FIRST,
    ConcurrencyLimit,
    LimitedProvider,
    limited_provider,
)
from tdac_agent.models.provider import RateLimited, Reply, Request
from tdac_agent.models.retry import RetryPolicy, answer

ASKED = Request("generate", "?")


class Server:
    """A provider that answers so many at a time, and refuses the others."""

    name = "openai:some"
    paid = True

    def __init__(self, capacity):
        self.capacity = capacity
        self.lock = threading.Lock()
        self.now = self.most = self.refused = 0

    def complete(self, request):
        with self.lock:
            self.now += 1
            self.most = max(self.most, self.now)
            too_many = self.now > self.capacity
            self.refused += too_many
        try:
            for _ in range(20):
                os.sched_yield()
            if too_many:
                raise RateLimited("slow down")
            return Reply("ok")
        finally:
            with self.lock:
                self.now -= 1


def yielding(_seconds):
    os.sched_yield()


@pytest.mark.slow
def test_slots_grow_by_one_a_round_and_are_halved_by_a_rate_limit(tmp_path):
    """n answers at n slots make n + 1 of them, about; never more than there may be."""
    limit = ConcurrencyLimit(tmp_path, most=12)
    assert limit.slots == FIRST
    for _ in range(int(FIRST)):
        limit.answered()
    assert FIRST + 0.9 < limit.slots <= FIRST + 1.0
    for _ in range(200):
        limit.answered()
    assert limit.slots == 12
    with limit.slot() as asked_at:
        limit.limited(asked_at)
    assert limit.slots == 6
    for _ in range(9):
        with limit.slot() as asked_at:
            limit.limited(asked_at)
    assert limit.slots == 1


def test_a_wave_of_rate_limits_counts_once(tmp_path):
    """Questions that were asked before the slots were cut say nothing about them."""
    limit = ConcurrencyLimit(tmp_path, most=8)
    with limit.slot() as first, limit.slot() as second, limit.slot() as third:
        for asked_at in (first, second, third):
            limit.limited(asked_at)
    assert limit.slots == 4


@pytest.mark.slow
def test_workers_share_what_the_server_bears(tmp_path):
    """Sixteen workers, a server that bears four: every question is answered, and most
    of them are asked while there is room for them.
    """
    server, done = Server(4), []

    def work():
        # Each worker has a limit of its own, as processes have.
        model = LimitedProvider(
            server, ConcurrencyLimit(tmp_path, most=16, sleep=yielding)
        )
        policy = RetryPolicy(first_wait=0.0)
        done.extend(
            answer(model.complete, ASKED, policy, lambda miss: None, yielding)
            for _ in range(12)
        )

    threads = [threading.Thread(target=work) for _ in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(done) == 16 * 12
    assert server.most <= FIRST + 1
    assert server.refused < len(done)


@pytest.mark.slow
def test_who_is_killed_has_let_go_of_its_slot(tmp_path):
    limit = ConcurrencyLimit(
        tmp_path, most=1, sleep=lambda _: pytest.fail("there is no slot")
    )
    hold = (
        "import sys; from pathlib import Path\n"
        "from tdac_agent.campaign.concurrency import ConcurrencyLimit\n"
        "with ConcurrencyLimit(Path(sys.argv[1]), 1).slot():\n"
        "    print('has', flush=True)\n"
        "    sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", hold, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as other:
        assert other.stdout.readline() == b"has\n"
        assert limit._free() is None
        other.kill()
        other.wait()
        with limit.slot():
            pass


def test_a_free_model_has_no_limit(tmp_path):
    class Free(Server):
        paid = False

    model = Free(1)
    assert limited_provider(model, tmp_path, 4) is model
    assert limited_provider(Server(1), tmp_path, 4).name == "openai:some"


def test_a_torn_state_begins_anew(tmp_path):
    limit = ConcurrencyLimit(tmp_path, most=99)
    (tmp_path / "state.json").write_text("{")
    assert limit.slots == FIRST
