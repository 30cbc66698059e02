"""One retry loop: how often, how long, and what ends it at once."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from script import Script

from tdac_agent.models.provider import (
    PermanentFault,
    ProviderFault,
    RateLimited,
    Reply,
    Request,
)
from tdac_agent.models.retry import RetryPolicy, answer

QUESTION = Request("generate", "?")


def failing(*faults):
    """A model that answers after some faults."""
    return Script(*faults, Reply("done"))


def ask(model, policy):
    """The answer or the last fault; the waits; what was noted."""
    waits, missed = [], []
    try:
        end = answer(model.complete, QUESTION, policy, missed.append, waits.append).text
    except ProviderFault as fault:
        end = fault
    assert [miss.wait for miss in missed if miss.wait is not None] == waits
    assert [miss.attempt for miss in missed] == list(range(1, len(missed) + 1))
    return end, waits


def test_waits_double_and_are_drawn():
    """Between half and all of 2, 4, 8 s; three retries, no more."""
    model = failing(*[ProviderFault("503")] * 9)
    end, waits = ask(model, RetryPolicy())
    assert isinstance(end, ProviderFault)
    assert len(waits) == 3
    assert all(2**n / 2 <= wait <= 2**n for n, wait in enumerate(waits, start=1))
    assert len(model.requests) == 4


def test_a_permanent_fault_is_not_asked_again():
    """One question, no wait."""
    end, waits = ask(failing(PermanentFault("401")), RetryPolicy())
    assert isinstance(end, PermanentFault)
    assert waits == []


def test_a_rate_limit_is_waited_for():
    """More often than there are retries, as long as the provider asks for."""
    model = failing(*[RateLimited("429", 7.0)] * 2, *[RateLimited("429")] * 20)
    end, waits = ask(model, RetryPolicy())
    assert end == "done"
    assert waits[:2] == [7.0, 7.0]
    assert len(waits) == 22
    assert max(waits) <= 60.0


@given(
    st.lists(
        st.builds(
            lambda kind, after: kind("503", after),
            st.sampled_from([ProviderFault, RateLimited, PermanentFault]),
            st.none() | st.floats(0, allow_infinity=False) | st.just(1e300),
        ),
        max_size=12,
    ),
    st.builds(
        RetryPolicy,
        st.integers(0, 5),
        st.floats(0, 1e4),
        st.floats(0, 100),
        st.floats(0, 100),
    ),
)
def test_no_wait_is_longer_than_it_may_be(faults, policy):
    """Neither the longest wait nor the time for the whole question is exceeded."""
    model = failing(*faults)
    end, waits = ask(model, policy)
    assert all(0 <= wait <= policy.longest_wait for wait in waits)
    assert all(wait < policy.seconds for wait in waits)
    assert max(request.seconds for request in model.requests) <= policy.seconds
    assert len(model.requests) == len(waits) + 1
    assert end == "done" or end is faults[len(waits)]


def test_a_busy_server_is_left_alone_as_long_as_it_asks():
    """Its `Retry-After` counts, up to the longest wait."""
    model = failing(ProviderFault("503", 30.0), ProviderFault("529", 1e9))
    assert ask(model, RetryPolicy()) == ("done", [30.0, 60.0])


def test_an_interrupt_ends_the_wait():
    """Ctrl-C while waiting: nothing is asked again."""

    def interrupted(seconds):
        raise KeyboardInterrupt

    model = failing(ProviderFault("503"))
    with pytest.raises(KeyboardInterrupt):
        answer(model.complete, QUESTION, RetryPolicy(), lambda miss: None, interrupted)
    assert len(model.requests) == 1


def test_a_policy_that_is_none():
    """Negative numbers are refused."""
    with pytest.raises(ValueError, match="no negative numbers"):
        RetryPolicy(retries=-1)
