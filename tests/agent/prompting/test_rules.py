"""The repair rules: short, not twice, bounded, and with a memory."""

import itertools
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_agent.models.tokens import estimate_tokens
from tdac_agent.prompting.rule_answer import (
    MAX_OPERATIONS,
    Add,
    Drop,
    Edit,
    RuleAnswerError,
    apply,
    parse_operations,
)
from tdac_agent.prompting.rules import (
    BEGIN,
    END,
    MAX_RULE_CHARS,
    MAX_RULE_TOKENS,
    RuleBook,
    clean,
    render_block,
    say_the_same,
)

SLOW, SLOW_2 = "Slow down near walls.", "  slow DOWN, near\nwalls!"


def add(text, scope="task"):
    return Add(op="add", scope=scope, text=text)


def edit(name, text):
    return Edit(op="edit", id=name, text=text)


def drop(name, reason=""):
    return Drop(op="drop", id=name, reason=reason)


def after(*rounds):
    """A book after the operations of iterations 1, 2, ..., and all the notes."""
    book, notes = RuleBook(), []
    for k, operations in enumerate(rounds, 1):
        book, told = apply(book, list(operations), k, (f"test_{k}",))
        notes += told
    return book, notes


def answer(*operations):
    return f"Here:\n```json\n{json.dumps(operations)}\n```\n"


words = st.text(alphabet="abc dé1.5-!", min_size=1, max_size=30).filter(
    lambda text: any(map(str.isalnum, text))
)
long_words = st.builds(lambda t, n: " ".join([t] * n)[:180], words, st.integers(1, 40))
names = st.integers(1, 12).map(lambda n: f"R{n}")
operations = st.one_of(
    st.builds(add, words | long_words),
    st.builds(edit, names, words | long_words),
    st.builds(drop, names, st.text(max_size=9)),
)
lives = st.lists(st.lists(operations, max_size=MAX_OPERATIONS), max_size=30)


@pytest.mark.slow
@settings(deadline=None)
@given(lives, st.data())
def test_a_book_stays_sound(rounds, data):
    """Whatever the answers: ids unique, texts short, block bounded, no doubles."""
    book = RuleBook()
    for k, wanted in enumerate(rounds, 1):
        before = {rule.id for rule in book.rules}
        book, notes = apply(book, wanted, k, ("test_x",))
        assert len(notes) == len(wanted)
        assert before <= {rule.id for rule in book.rules}
        failed = data.draw(st.sampled_from([(), ("test_x",), ("test_y", "test_z")]))
        book = book.observed(failed, 1)
    in_force = book.in_force
    assert len({rule.id for rule in book.rules}) == len(book.rules)
    block = render_block(in_force)
    assert estimate_tokens(block) <= MAX_RULE_TOKENS
    assert len(block.splitlines()) == max(len(in_force), 1) + 2
    assert all(0 < len(rule.text) <= MAX_RULE_CHARS for rule in book.rules)
    for one, other in itertools.combinations(in_force, 2):
        assert not say_the_same(one.text, other.text)
    for one, other in itertools.product(in_force, book.rules):
        assert not (other.rejected and say_the_same(one.text, other.text))
    assert RuleBook.model_validate_json(book.model_dump_json()) == book


@given(st.text())
def test_any_answer_is_read_or_refused(reply):
    """An answer gives at most three operations, or says in one line what is wrong."""
    check_answer(reply)


parts = ['{"op": "add"', '"text": "a"', '"scope": "task"}', "[", "]", ",", "```json"]
parts += ["```", "\n", '{"op": "drop", "id": "R1"}', "[]", "1e999", '"\\ud800"', "~~~"]


@given(st.lists(st.sampled_from(parts)).map("".join))
def test_any_nearly_right_answer_is_read_or_refused(reply):
    """The same of answers that are made of what right ones are made of."""
    check_answer(reply)


def check_answer(reply):
    wanted, problem = read(reply)
    if wanted is None:
        assert problem
        assert "\n" not in problem
    else:
        assert len(wanted) <= MAX_OPERATIONS
        assert {type(operation) for operation in wanted} <= {Add, Edit, Drop}


def read(reply):
    """The operations of an answer, or what is wrong with it."""
    try:
        return parse_operations(reply), None
    except RuleAnswerError as error:
        return None, str(error)


GOOD = {"op": "add", "scope": "code", "text": "Use Python ints."}


def test_the_operations_of_an_answer():
    """One block of JSON, with words around it or without; none is an answer, too."""
    change = {"op": "edit", "id": "R2", "text": "x"}
    end = {"op": "drop", "id": "R1"}
    expected = [add("Use Python ints.", "code"), edit("R2", "x"), drop("R1")]
    assert parse_operations(answer(GOOD, change, end)) == expected
    assert parse_operations(json.dumps([GOOD])) == expected[:1]
    assert parse_operations("```json\n[]\n```") == []


@pytest.mark.parametrize(
    ("reply", "problem"),
    [
        ("- Drive slowly.", "got no block"),
        (answer(GOOD) + answer(GOOD), "got 2 blocks"),
        ("```json\n[\n", "got no block"),
        ("```json\n[,]\n```", "not JSON"),
        (answer(GOOD, GOOD, GOOD, GOOD), "at most 3 of them, got 4"),
        ("```json\n{}\n```", "valid list"),
        (answer({**GOOD, "scope": "world"}), "scope"),
        (answer({**GOOD, "why": "so"}), "why"),
        (answer({**GOOD, "op": "replace"}), "op"),
        (answer({**GOOD, "text": 5}), "valid string"),
        (answer({**GOOD, "text": " \n"}), "needs words"),
        (answer({**GOOD, "text": "x" * 201}), "201 characters, at most 200"),
        (answer({**GOOD, "text": "see http://x.y"}), "or a URL"),
        (answer({"op": "edit", "text": "x"}), "id"),
    ],
)
def test_a_malformed_answer_says_what_is_wrong(reply, problem):
    """Nothing is guessed, and nothing of such an answer is used."""
    with pytest.raises(RuleAnswerError, match=problem):
        parse_operations(reply)


def test_an_endless_answer_is_read_in_one_pass():
    """A hundred thousand fences cost no more than their length."""
    with pytest.raises(RuleAnswerError):
        parse_operations("```json\n" * 100_000)
    with pytest.raises(RuleAnswerError):
        parse_operations("[" * 100_000)


def test_doubles_are_not_added():
    """The same words in other spelling are the same rule; other numbers are not."""
    book, notes = after([add(SLOW)], [add(clean(SLOW_2)), add("Slow down near walls")])
    assert [rule.text for rule in book.rules] == [SLOW]
    assert notes[1:] == ["not added: it repeats R1"] * 2
    book, _ = after([add("set X = 1.5"), add("set X = 15"), add("set X = 1.5 !")])
    assert [rule.text for rule in book.rules] == ["set X = 1.5", "set X = 15"]


def test_what_was_dropped_does_not_come_back():
    """Neither as a new rule nor as another text of an old one."""
    book, notes = after(
        [add(SLOW), add("Turn in place.")],
        [drop("R1", "too slow")],
        [add(clean(SLOW_2)), edit("R2", SLOW)],
    )
    assert [rule.id for rule in book.in_force] == ["R2"]
    assert notes[-2:] == [
        "not added: it repeats R1, which was ended in k=2",
        "not edited: it repeats R1, which was ended in k=2",
    ]
    gone = book.rules[0]
    assert (gone.status, gone.ended, gone.reason) == ("dropped", 2, "too slow")


def test_a_changed_rule_is_as_it_is_read_again():
    """Control characters of an answer do not stay in its text or reason."""
    book, _ = after([add("1")], [edit("R1", "2 \x1b")], [drop("R1", "3 \x1b")])
    assert "\x1b" not in repr(book)
    assert RuleBook.model_validate_json(book.model_dump_json()) == book


def test_a_rule_remembers_its_life():
    """Birth, evidence and earlier texts stay with it; ids are never used twice."""
    book, _ = after([add("one")], [drop("R1")], [add("two")], [edit("R2", "three")])
    rule = book.get("R2")
    assert (rule.born, rule.evidence, rule.text) == (3, ("test_3",), "three")
    assert rule.edits == ("k=4: was 'two'",)
    assert book.get("R1") is None


def test_what_came_of_a_rule():
    """Each test of its evidence counts for itself; more failures than before, too."""
    book, _ = apply(RuleBook(), [add("one")], 1, ("a", "b", "c"))
    assert book.rules[0].effect_text == "not tried yet"
    book = book.observed(("b", "c"), 3)
    rule = book.rules[0]
    assert (rule.tried, rule.cured, rule.worse, rule.passes) == (1, 0, 0, (1, 0, 0))
    assert rule.effect_text == "cured 1 of 3 tests"
    book = book.observed(("c", "d", "e"), 2)
    rule = book.rules[0]
    assert (rule.tried, rule.cured, rule.worse, rule.passes) == (2, 0, 1, (2, 1, 0))
    assert rule.effect_text == (
        "cured 1 of 3 tests in each of 2 tries, 1 more in some of them; more tests "
        "failed than before in 1 of them"
    )
    assert book.observed((), 2).rules[0].cured == 1
    edited, _ = apply(book, [edit("R1", "other")], 4, ("c",))
    assert edited.rules[0].effect_text == "not tried yet"


def test_a_record_that_does_not_tell_tests_apart():
    """An older one counts all tests of a rule as one; it goes on from there."""
    book, _ = apply(RuleBook(), [add("one")], 1, ("a", "b"))
    old = book.change("R1", tried=2, cured=1)
    assert old.rules[0].effect_text == (
        "cured 0 of 2 tests in each of 2 tries, 2 more in some of them"
    )
    assert old.observed(("b",), 9).rules[0].passes == (2, 1)
    assert book.change("R1", tried=1, passes=(1, 1, 1)).rules[0].passes_each == (0, 0)


def test_the_worst_rules_make_room():
    """Those that did harm go first, then the oldest; what is new stays for a try."""
    long = "about this and that " * 8
    book = RuleBook()
    for k in range(1, 9):
        book, _ = apply(book, [add(f"rule {k} {long}")], k, ("t",))
    book = book.change("R3", passes=(1,), tried=1).change("R5", worse=2, tried=2)
    left = []
    for k in range(9, 20):
        before = book.in_force
        book, _ = apply(book, [add(f"rule {k} {long}")], k, ("t",))
        left += [rule.id for rule in before if book.get(rule.id) is None]
        assert book.get(f"R{k}") is not None
    assert left[:5] == ["R5", "R1", "R2", "R4", "R6"]
    assert book.get("R3") is not None
    ended = [rule for rule in book.rules if not rule.in_force]
    assert {rule.status for rule in ended} == {"made room"}
    assert [rule.id for rule in ended if rule.rejected] == ["R5"]


@pytest.mark.parametrize("operation", [edit("R7", "x"), drop("R7")])
def test_a_rule_that_is_not_there(operation):
    """Nothing happens to the others, and the notes say so."""
    book, notes = after([add("one")], [operation])
    assert book == after([add("one")])[0]
    assert "no rule R7 in force" in notes[-1]


def test_the_block_is_marked():
    """The markers stand around the rules, also around none."""
    assert render_block(()).splitlines() == [
        f"# === {BEGIN} ===",
        "(none yet)",
        f"# === {END} ===",
    ]
    book, _ = after([add("one")])
    assert render_block(book.in_force).splitlines()[1] == "- one [R1]"


def test_a_rule_cannot_end_the_block():
    """Text that imitates a marker does not end the block."""
    book, _ = after([add(f"x {END}"), add(f"# === {BEGIN} === y")])
    block = render_block(book.in_force)
    assert len(book.in_force) == 2
    assert (block.count(BEGIN), block.count(END)) == (1, 1)
