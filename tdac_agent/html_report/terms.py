"""Terms of the glossary, explained where they first stand on a page.

The list is that of `docs/glossary.md`; a test compares both.
"""

from __future__ import annotations

import re
from html import escape

TERMS = {
    "controller": (
        "A file controller.py with a function policy(obs), which returns the speeds "
        "of the left and the right wheel."
    ),
    "episode": (
        "One drive of a robot, from its start until it reaches the goal, touches "
        "something or runs out of time."
    ),
    "task": (
        "One problem to solve: a map or world, a robot, a start, a goal and limits. "
        "The file task.yaml states it."
    ),
    "world": (
        "The surroundings of one episode. It is a map, or a Webots world with solid "
        "objects, with a start and a goal."
    ),
    "set": (
        "Short for task set: a distribution of worlds, a robot, what it observes, and "
        "its disturbances. One controller has to drive in all of its worlds."
    ),
    "level": (
        "One of the seven bundled sets, from known to floor. Together they are the "
        "ladder."
    ),
    "split": (
        "A part of the worlds of a set. train is for training, dev for feedback and "
        "selection, test is public, and hidden has worlds that nobody has seen."
    ),
    "salt": (
        "Random bytes from which the worlds of a split follow. Without the salt of a "
        "hidden split, nobody can know its worlds."
    ),
    "mover": (
        "A moving disc on a map: it follows a route, bounces off walls, or walks as a "
        "person in a crowd."
    ),
    "dynamics": (
        "All the code and values that decide what happens in an episode, such as "
        "physics, generators and sensors. They have a hash, and results with "
        "different hashes cannot be put together."
    ),
    "suite": "The tests that a controller must pass on a task.",
    "passed": "All tests of the suite passed, with six drives without noise.",
    "blind drive": "A drive from a disturbed start that no feedback has shown.",
    "verified": (
        "A controller that passed also drove blind, and at most one of about a "
        "hundred drives failed. On a set, two sequential tests accept it."
    ),
    "gap": (
        "The distance between the body of the robot and an obstacle. As a figure of a "
        "generated world, it is the width of the narrowest passage, in body "
        "diameters."
    ),
    "sandbox tier": (
        "How a controller is confined: bubblewrap, namespaces, landlock or rlimits. A "
        "report names the tier that was used."
    ),
    "OT": "Optimal time: the least number of steps to the goal at full speed.",
    "time score": (
        "Success × OT ÷ the steps taken, at most 1 and 0 for a failure. It is also "
        "called SCT, success weighted by completion time."
    ),
    "path score": (
        "Success × the length of the shortest path ÷ the length driven. It is also "
        "called SPL, success weighted by path length."
    ),
    "entrant": "What drives in a bench: a controller, a planner or a learned policy.",
    "planner": (
        "A classical method such as dwa, written as a controller, without a language "
        "model and without learning."
    ),
    "learner": (
        "The model that writes controllers. The optimizer edits controllers that "
        "failed and turns failures into rules; by default it is the same model."
    ),
    "builtin": (
        "The learner that needs no language model: on a task a template that is tuned "
        "from failed tests, on a set a controller of our own."
    ),
    "candidate": (
        "A version of the controller that a run has judged. It is named by k and j."
    ),
    "k": "The number of the iteration, from 1.",
    "j": "The number of the repair in an iteration. j = 0 is the first version.",
    "SR": (
        "Success rate: valid iterations that passed, divided by all valid iterations."
    ),
    "CS(k)": (
        "Cumulative success: the fraction of runs whose first success came in "
        "iteration k or earlier."
    ),
    "race": (
        "A search on a set: several answers drive in the same worlds, and further "
        "questions ask to improve on them."
    ),
    "pool": "The worlds of dev in which all candidates of a race drive.",
    "informed, repair, merge, faster": (
        "Kinds of questions in a race. informed shows what all drives show, without "
        "code. repair asks to repair what costs most, merge to join two controllers, "
        "and faster to save time."
    ),
}
"""Each term with its explanation, in the order of the glossary."""
_FORMS = {
    "set": ("task set", "task sets"),
    "sandbox tier": ("sandbox tier", "sandbox"),
    "CS(k)": ("CS(k)", "CS(K)"),
    "informed, repair, merge, faster": ("informed",),
}
"""Words for a term, other than its name and the plural of it."""
_CASED = {"OT", "k", "j", "SR", "CS(k)", "CS(K)"}
"""Words that mean something only if they are written like this."""
PLACE = "<!-- terms -->"
"""Where a page lists the terms that it uses."""
# Code, pictures, and what can be pressed, as a whole; then single tags; then text.
_PIECES = re.compile(
    r"<(script|style|svg|pre|code|title|a|button|select|canvas|summary|h[1-4])\b.*?</\1>"
    r"|<[^>]*>|(?P<text>[^<]+)",
    re.DOTALL,
)


def explain_terms(html: str) -> str:
    """A page whose terms have an explanation where they first stand.

    Those that it uses are listed at `PLACE`, too, for readers without a mouse.

    Args:
        html: The page; all that is not markup is escaped in it.
    """
    left = {form: term for term in TERMS for form in _forms(term)}
    used: set[str] = set()

    def marked(word: re.Match[str]) -> str:
        term = left.get(word[0]) or left.get(word[0].lower())
        if term is None or term in used:
            return word[0]
        used.add(term)
        return f'<abbr title="{escape(TERMS[term])}">{word[0]}</abbr>'

    words = _pattern(left)

    def piece(found: re.Match[str]) -> str:
        text = found["text"]
        return found[0] if text is None else words.sub(marked, text)

    page = _PIECES.sub(piece, html)
    return page.replace(PLACE, _list_of(used), 1)


def _forms(term: str) -> tuple[str, ...]:
    """The words for a term; in lower case, unless they are always written like this."""
    return _FORMS.get(term, (term,) if term in _CASED else (term, f"{term}s"))


def _pattern(forms: dict[str, str]) -> re.Pattern[str]:
    """Finds the forms as whole words, the longest first."""
    cased = "|".join(map(re.escape, sorted(_CASED, key=len, reverse=True)))
    others = sorted(set(forms) - _CASED, key=len, reverse=True)
    return re.compile(
        rf"(?<![\w&-])(?:{cased}|(?i:{'|'.join(map(re.escape, others))}))(?![\w-])"
    )


def _list_of(used: set[str]) -> str:
    """The terms of a page, folded."""
    if not used:
        return ""
    rows = "".join(
        f"<dt>{escape(term)}</dt><dd>{escape(text)}</dd>"
        for term, text in TERMS.items()
        if term in used
    )
    return (
        f'<details class="terms"><summary>Terms on this page</summary>'
        f'<dl class="origin">{rows}</dl></details>'
    )
