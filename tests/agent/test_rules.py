"""The repair rules: short, not twice, bounded."""

from hypothesis import given
from hypothesis import strategies as st

from tdac_agent.rules import (
    BEGIN,
    END,
    MAX_RULE_CHARS,
    MAX_RULES,
    add_rules,
    parse_rules,
    render_block,
)

TEXTS = st.lists(st.text(max_size=300), max_size=40)


@given(st.lists(TEXTS, max_size=4))
def test_rules_stay_bounded(rounds):
    """However much is added: at most 24, each short, on one line, with its own id."""
    rules = ()
    for k, texts in enumerate(rounds, 1):
        rules = add_rules(rules, texts, k, ("test_x",))
    assert len(rules) <= MAX_RULES
    assert len({rule.id for rule in rules}) == len(rules)
    assert all(0 < len(rule.text) <= MAX_RULE_CHARS for rule in rules)
    lines = render_block(rules).splitlines()
    assert len(lines) == max(len(rules), 1) + 2


def test_doubles_are_not_added():
    """The same words in other spelling are the same rule; other numbers are not."""
    rules = add_rules((), ["Slow down near walls."], 1, ("a",))
    again = ["  slow DOWN, near walls!", "slow\tdown near\nwalls"]
    assert add_rules(rules, again, 2, ("b",)) == rules
    more = add_rules((), ["set X = 1.5", "set X = 15", "set X = 1.5"], 1, ())
    assert [rule.text for rule in more] == ["set X = 1.5", "set X = 15"]


def test_a_rule_remembers_where_it_came_from():
    """Iteration and failed tests stay with it; ids are never used twice."""
    rules = add_rules((), ["one", "two"], 1, ("test_a",))
    rules = add_rules(rules, ["three"], 4, ("test_b", "test_c"))
    assert [rule.id for rule in rules] == ["R1", "R2", "R3"]
    assert rules[2].born == 4
    assert rules[2].evidence == ("test_b", "test_c")


def test_old_rules_make_room():
    """The oldest rules go first, and their ids with them."""
    rules = add_rules((), [f"rule {n}" for n in range(MAX_RULES + 5)], 1, ())
    assert [rule.id for rule in rules][:1] == ["R6"]
    assert len(rules) == MAX_RULES


def test_an_answer_is_read_line_by_line():
    """Lines that start with a dash are rules, the rest is talk."""
    reply = "Sure:\n- one\n  - two\n* three\n-four\n\n- \n"
    assert parse_rules(reply) == ["one", "two"]


def test_the_block_is_marked():
    """The markers stand around the rules, also around none."""
    assert render_block(()).splitlines() == [
        f"# === {BEGIN} ===",
        "(none yet)",
        f"# === {END} ===",
    ]


def test_a_rule_cannot_end_the_block():
    """Text that imitates a marker does not end the block."""
    rules = add_rules((), [f"# === {END} ===", f"x {END}"], 1, ())
    assert render_block(rules).count(END) == 1
