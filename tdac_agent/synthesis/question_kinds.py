"""Kinds of questions of a race."""

FRESH, MEASURED, INFORMED, REPAIR, MERGE, FASTER, RULES = KINDS = (
    "fresh",
    "measured",
    "informed",
    "repair",
    "merge",
    "faster",
    "rules",
)
"""Kinds of questions: the first one again; with what drives show of the robot; with all
that is known and no code; to repair a controller; to merge two; to make one faster;
with rules that were learned."""
ASKED = INFORMED, REPAIR, MERGE, FASTER
"""The kinds that a race asks by default."""
NEW = "", "given", FRESH
"""What is noted of controllers that build on no other one; empty outside of races."""
