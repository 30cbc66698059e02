"""What can happen to a file: strategies that take a whole one and give a torn one."""

import json

from hypothesis import strategies as st

ENDLESS = b"9" * 5000
DEEP = b"[" * 100_000
ODD_JSON = (b"null", b"[]", b"{}", b'"text"', b'{"a": "\\ud800"}', b"NaN")
ODD_BYTES = (b"\0", b"\0" * 500, b"\n\n", b"\xff\xfe", b"\xef\xbb\xbf")
GARBAGE = st.binary(max_size=40) | st.sampled_from(
    (*ODD_JSON, *ODD_BYTES, ENDLESS, DEEP, b'{"a":' * 5000)
)
# No value is one that a reader waits for.
OTHER_VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-3, 3)
    | st.sampled_from([10**400, -1e308, float("nan"), float("inf")])
    | st.text(st.characters(exclude_categories=()), max_size=8)
    | st.sampled_from(["failed", "skipped", "setup", "rollout", "call"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["message", "reprcrash", "a"]), inner)
    ),
    max_leaves=4,
)


@st.composite
def torn(draw, raw):
    """Bytes that were cut, flipped, overwritten, re-encoded or added to."""
    at = draw(st.integers(0, len(raw)))
    to = min(at + draw(st.integers(0, 60)), len(raw))
    kind = draw(st.sampled_from(["cut", "flip", "insert", "hole", "lose", "encode"]))
    if kind == "cut":
        return raw[:at]
    if kind == "flip" and to > at:
        bit = 1 << draw(st.integers(0, 7))
        return raw[:at] + bytes([raw[at] ^ bit]) + raw[at + 1 :]
    if kind == "hole":
        return raw[:at] + bytes(to - at) + raw[to:]
    if kind == "lose":
        return raw[:at] + raw[to:]
    if kind == "encode":
        text = raw.decode("utf-8", "replace")
        return text.encode(draw(st.sampled_from(["utf-16", "utf-8-sig", "utf-32"])))
    return raw[:at] + draw(GARBAGE) + raw[at:]


@st.composite
def altered(draw, value):
    """A JSON value in which one part is of another kind, or gone."""
    if isinstance(value, dict | list) and value and draw(st.integers(0, 3)):
        keys = list(value) if isinstance(value, dict) else range(len(value))
        key = draw(st.sampled_from(list(keys)))
        copy = value.copy()
        if draw(st.integers(0, 3)):
            copy[key] = draw(altered(value[key]))
        else:
            del copy[key]
        return copy
    return draw(OTHER_VALUES)


@st.composite
def altered_json(draw, raw):
    """A JSON text in which one value is of another kind, or gone."""
    return json.dumps(draw(altered(json.loads(raw)))).encode()


@st.composite
def shuffled(draw, lines, others):
    """Lines that were lost, doubled, moved, altered, or mixed with those of another.

    Args:
        draw: From hypothesis.
        lines: JSON lines, as bytes.
        others: Lines that may get among them.
    """
    lines = list(lines)
    at = draw(st.integers(0, len(lines)))
    kinds = ["move", "double", "lose", "splice", "add", "alter"]
    kind = draw(st.sampled_from(kinds)) if lines else "add"
    at = min(at, len(lines) - 1) if kind != "add" else at
    if kind == "move":
        lines.insert(draw(st.integers(0, len(lines))), lines.pop(at))
    elif kind == "double":
        lines.insert(draw(st.integers(0, len(lines))), lines[at])
    elif kind == "lose":
        del lines[at : at + draw(st.integers(1, 3))]
    elif kind == "splice":
        lines[at:] = others[draw(st.integers(0, len(others))) :]
    elif kind == "add":
        lines.insert(at, draw(GARBAGE))
    else:
        try:
            lines[at] = draw(altered_json(lines[at]))
        except (ValueError, RecursionError):  # one of the lines that were added
            lines[at] = b"{"
    return lines
