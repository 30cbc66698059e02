"""The budget: never exceeded, whoever shares it, whatever becomes of the calls."""

import math
import subprocess
import sys
import textwrap
import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_agent.errors import RunError
from tdac_agent.models.budget import NOTHING, Amount, Budget, BudgetExhausted
from tdac_agent.storage.journal import read_records

AMOUNTS = st.builds(Amount, st.integers(0, 50), st.floats(0, 1, allow_subnormal=False))
CALLS = st.lists(st.tuples(AMOUNTS, st.floats(0, 1), st.booleans()), max_size=6)


class Watched:
    """Makes calls; checks at each moment what all of them may have cost so far."""

    def __init__(self, budget):
        self.budget = budget
        self.lock = threading.Lock()
        self.billed = {}
        self.worst = Amount()

    def make(self, name, calls):
        for number, (worst, share, answered) in enumerate(calls):
            call = f"{name}/{number}"
            try:
                self.budget.reserve(call, worst)
            except BudgetExhausted:
                continue
            # Whoever is asked may bill up to the worst case from now on.
            real = Amount(math.floor(worst.tokens * share), worst.usd * share)
            with self.lock:
                self.billed[call] = worst
                self.check()
            if answered:
                with self.lock:
                    self.billed[call] = real
                self.budget.settle(call, real)

    def check(self):
        tokens = sum(amount.tokens for amount in self.billed.values())
        usd = sum(amount.usd for amount in self.billed.values())
        assert tokens <= self.budget.max_tokens
        assert usd <= self.budget.max_cost + 1e-6


RUNS = st.lists(CALLS, min_size=1, max_size=8)


@settings(deadline=None, max_examples=60)
@given(RUNS, st.floats(0, 4), st.integers(0, 200))
def test_it_is_never_exceeded(runs, max_cost, max_tokens):
    """By any number of threads, with answers and without."""
    share(runs, Budget(max_cost, max_tokens))


@settings(deadline=None, max_examples=4)
@given(RUNS, st.floats(0, 4), st.integers(0, 200))
def test_nor_where_it_is_kept_in_a_file(tmp_path_factory, runs, max_cost, max_tokens):
    """The same, and the file tells the same to others."""
    ledger = tmp_path_factory.getbasetemp() / "ledger.jsonl"
    ledger.unlink(missing_ok=True)
    budget = Budget(max_cost, max_tokens, ledger)
    share(runs, budget)
    assert Budget(ledger=ledger).taken == budget.taken


def share(runs, budget):
    """Makes the calls of each run in a thread of its own."""
    watched, errors = Watched(budget), []

    def work(name, calls):
        try:
            watched.make(name, calls)
        except BaseException as error:
            errors.append(error)

    threads = [
        threading.Thread(target=work, args=(number, calls))
        for number, calls in enumerate(runs)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    taken, billed = budget.taken, watched.billed.values()
    assert taken.tokens == sum(amount.tokens for amount in billed)
    assert taken.usd == pytest.approx(sum(amount.usd for amount in billed))


@given(CALLS, st.floats(0, 2))
def test_all_that_fits_is_granted(calls, limit):
    """One after the other: refused is only what would be too much."""
    budget, spent = Budget(max_cost=limit), 0.0
    for number, (worst, share, _) in enumerate(calls):
        if spent + worst.usd <= limit:
            budget.reserve(str(number), worst)
            spent += worst.usd * share
            budget.settle(str(number), Amount(0, worst.usd * share))
        elif spent + worst.usd > limit + 1e-6:
            with pytest.raises(BudgetExhausted, match="the next question may cost"):
                budget.reserve(str(number), worst)
    assert budget.taken.usd == pytest.approx(spent)


def test_a_call_that_is_reserved_again():
    """The same call counts once; one of an earlier process counts as it was."""
    budget = Budget(max_cost=1.0)
    for _ in range(3):
        budget.reserve("a", Amount(usd=0.6))
    budget.restore({"b": Amount(usd=0.9)})
    assert budget.taken.usd == pytest.approx(1.5)
    with pytest.raises(BudgetExhausted, match=r"1\.50 USD of 1\.00 USD are spent"):
        budget.reserve("c", Amount(usd=0.1))
    budget.reserve("free", NOTHING)
    budget.settle("b", NOTHING)
    budget.reserve("c", Amount(usd=0.1))


SHARED = """
    import os, signal, sys
    from pathlib import Path
    from tdac_agent.budget import Amount, Budget, BudgetExhausted
    budget = Budget(max_tokens=1000, ledger=Path(sys.argv[2]))
    for number in range(40):
        try:
            budget.reserve(f"{sys.argv[1]}/{number}", Amount(tokens=20))
        except BudgetExhausted:
            break
        if number == 25:
            os.kill(os.getpid(), signal.SIGKILL)
        budget.settle(f"{sys.argv[1]}/{number}", Amount(tokens=10))
    """


def test_processes_share_a_file(tmp_path):
    """Together they stay within the limit; what a killed one reserved stays taken."""
    ledger = tmp_path / "ledger.jsonl"
    words = [sys.executable, "-c", textwrap.dedent(SHARED)]
    running = [subprocess.Popen([*words, str(n), str(ledger)]) for n in range(4)]
    for process in running:
        process.wait()
    settled, most = {}, 0
    for record in read_records(ledger):
        settled[record["call"]] = record["tokens"]
        most = max(most, sum(settled.values()))
    assert most <= 1000
    assert Budget(ledger=ledger).taken.tokens == sum(settled.values()) > 900


def test_what_another_has_written_since_is_read_once(tmp_path):
    """Two that share a file know of each other's calls at each moment."""
    ledger = tmp_path / "ledger.jsonl"
    one, two = Budget(max_tokens=100, ledger=ledger), Budget(ledger=ledger)
    for number in range(3):
        one.reserve(f"one/{number}", Amount(tokens=10))
        assert two.taken.tokens == 20 * number + 10
        two.reserve(f"two/{number}", Amount(tokens=20))
        two.settle(f"two/{number}", Amount(tokens=10))
        assert one.taken.tokens == 20 * number + 20
    two.reserve("two/3", Amount(tokens=31))
    with pytest.raises(BudgetExhausted, match="91 of 100 tokens"):
        one.reserve("one/3", Amount(tokens=10))


def test_a_line_that_was_torn_by_a_crash_takes_nothing(tmp_path):
    """It is cut off, also by one who has read what was before it."""
    ledger = tmp_path / "ledger.jsonl"
    budget = Budget(max_tokens=100, ledger=ledger)
    budget.reserve("a", Amount(tokens=10))
    whole = ledger.read_bytes()
    with ledger.open("ab") as file:
        file.write(whole[: len(whole) // 2])
    assert budget.taken.tokens == 10
    assert ledger.read_bytes() == whole
    budget.reserve("b", Amount(tokens=10))
    assert budget.taken == Budget(ledger=ledger).taken == Amount(20)


def test_a_new_file_in_the_place_of_the_old_one_counts(tmp_path):
    ledger = tmp_path / "ledger.jsonl"
    budget = Budget(ledger=ledger)
    budget.reserve("a", Amount(tokens=10))
    ledger.unlink()
    assert budget.taken == NOTHING


@given(st.lists(st.tuples(st.sampled_from("abc"), AMOUNTS)))
def test_the_sum_is_that_of_the_last_words(calls):
    """However often a call is put: to the last digit, so no error adds up."""
    budget = Budget()
    for call, amount in calls:
        budget.settle(call, amount)
    last = dict(calls).values()
    assert budget.taken.tokens == sum(amount.tokens for amount in last)
    assert budget.taken.usd == math.fsum(amount.usd for amount in last)


def test_a_foreign_file_is_no_ledger(tmp_path):
    """One line, and the file stays as it is."""
    file = tmp_path / "mine.jsonl"
    file.write_text('{"what": 1}\n')
    with pytest.raises(RunError, match="is not a budget ledger"):
        Budget(1.0, ledger=file).reserve("a", NOTHING)
    assert file.read_text() == '{"what": 1}\n'


@pytest.mark.parametrize("wrong", [(-1, 0.0), (0, -1.0), (0, math.inf), (0, math.nan)])
def test_amounts_that_are_none(wrong):
    """Negative or endless ones are refused."""
    with pytest.raises(ValueError, match="expected an amount of 0 or more"):
        Amount(*wrong)
