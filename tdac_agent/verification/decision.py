"""Decisions of tests that may end a series of episodes."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.verification.judge.confirming import EndingTest
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.sequential import (
    Characteristics,
    Decision,
    SequentialTest,
)


class ContactResult(StrictRecord):
    """What a sequential test found about contacts."""

    contacts: int = Field(description="Episodes in which something was touched.")
    decision: Decision
    at_refused_rate: Characteristics
    at_accepted_rate: Characteristics


class SequentialResult(StrictRecord):
    """The decision of a test that may end the episodes, and its error rates."""

    decision: Decision
    test: EndingTest
    refuse_at: float = Field(description="Success rate that the test should reject.")
    at_refused_rate: Characteristics
    at_accepted_rate: Characteristics
    contact: ContactResult | None = Field(
        None, description="Of drives without a contact, on a task set."
    )


def result_of(test: EndingTest, episodes: Sequence[EpisodeRow]) -> SequentialResult:
    """The decision of a test, with its error rates."""
    successes = sum(each.success for each in episodes)
    touched = sum(each.touched for each in episodes)
    contact = test.contact if isinstance(test, SequentialTest) else None
    return SequentialResult(
        contact=None if contact is None else _of_contacts(contact, touched, episodes),
        decision=test.decide(successes, len(episodes) - successes, touched),
        test=test,
        refuse_at=test.refuse_at,
        at_refused_rate=test.characteristics(test.refuse_at),
        at_accepted_rate=test.characteristics(test.accept_at),
    )


def _of_contacts(
    test: SequentialTest, touched: int, episodes: Sequence[EpisodeRow]
) -> ContactResult:
    return ContactResult(
        contacts=touched,
        decision=test.decide(len(episodes) - touched, touched),
        at_refused_rate=test.characteristics(test.refuse_at),
        at_accepted_rate=test.characteristics(test.accept_at),
    )


def decision_text(result: SequentialResult) -> str:
    """What a sequential test decided."""
    contact = result.contact
    if result.decision == "accepted":
        text = f"accepted at {percent(result.test.accept_at)}"
        if contact is None:
            return text
        most = percent(1.0 - contact.at_refused_rate.rate)
        return f"{text}, contacts below {most}"
    if contact is not None and contact.decision == "rejected":
        most = percent(1.0 - contact.at_refused_rate.rate)
        return f"rejected, since {contact.contacts} contacts are too many for {most},"
    if result.decision == "rejected":
        return f"rejected at {percent(result.test.accept_at)}"
    return "undecided, therefore not accepted,"


def percent(share: float) -> str:
    """A percentage with one decimal; with three if it would round to 0 or 100 %."""
    rounded = f"{100 * share:.1f}"
    if rounded in ("0.0", "100.0") and 0.0 < share < 1.0:
        rounded = f"{100 * share:.3f}"
    return f"{rounded} %"
