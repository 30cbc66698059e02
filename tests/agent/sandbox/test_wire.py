"""The wire carries exact values and types; any bytes are a value or a WireError."""

import collections
import contextlib
import enum
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tdac_agent.episodes.episode import as_wheels, wrong_action
from tdac_agent.sandbox.inner import wire
from tdac_agent.sandbox.inner.decode import decode
from tdac_agent.sandbox.inner.describe import FILE_NAME, describe
from tdac_agent.sandbox.inner.encode import encode
from tdac_agent.sandbox.inner.layout import Layout
from tdac_agent.sandbox.inner.wire import Handle, RemoteError, WireError

texts = st.text(st.characters(exclude_categories=()), max_size=20)
names = texts.filter(str.isprintable)
dtypes = st.sampled_from(wire.DTYPES)
scalars = dtypes.flatmap(lambda d: hnp.arrays(d, ())).map(lambda a: a[()])
arrays = dtypes.flatmap(
    lambda d: hnp.arrays(d, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0))
)
hashable = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**200), 2**200)
    | st.floats()
    | texts
    | st.binary(max_size=20)
    | st.builds(Handle, st.integers(0, 2**32 - 1), names),
    lambda inner: st.lists(inner, max_size=4).map(tuple),
    max_leaves=6,
)
values = st.recursive(
    hashable | scalars | arrays,
    lambda inner: (
        st.lists(inner, max_size=5)
        | st.lists(inner, max_size=5).map(tuple)
        | st.dictionaries(hashable, inner, max_size=5)
    ),
    max_leaves=20,
)


def same(a, b):
    """Equal in value and in type all the way down; NaN equals NaN."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray | np.generic):
        return a.dtype == b.dtype and np.array_equal(
            a, b, equal_nan=a.dtype.kind == "f"
        )
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return same(list(a.items()), list(b.items()))
    if isinstance(a, float) and math.isnan(a):
        return math.isnan(b)
    return a == b and (
        not isinstance(a, float) or math.copysign(1, a) == math.copysign(1, b)
    )


@settings(deadline=None)
@given(values)
def test_a_value_comes_back_equal_and_of_the_same_types(value):
    assert same(decode(encode(value)), value)


@settings(deadline=None, max_examples=100)
@given(st.binary(max_size=200))
def test_any_bytes_are_a_value_or_a_wire_error(data):
    try:
        value = decode(data)
    except WireError:
        return
    assert same(decode(encode(value)), value)


@settings(deadline=None, max_examples=100)
@given(values, st.data())
def test_damaged_values_are_a_value_or_a_wire_error(value, data):
    raw = bytearray(encode(value))
    index = data.draw(st.integers(0, len(raw) - 1))
    raw[index] = data.draw(st.integers(0, 255))
    end = data.draw(st.integers(0, len(raw)))
    for damaged in (bytes(raw), bytes(raw[:end])):
        with contextlib.suppress(WireError):
            decode(damaged)


@pytest.mark.slow
@settings(deadline=None, max_examples=10_000)
@given(st.binary(max_size=300))
def test_many_bytes_are_a_value_or_a_wire_error(data):
    with contextlib.suppress(WireError):
        decode(data)


class Direction(enum.IntEnum):
    LEFT = 1


Point = collections.namedtuple("Point", "x y")


class Loud(str):
    def __getitem__(self, index):
        raise RuntimeError

    def encode(self, *args):
        raise RuntimeError


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (Direction.LEFT, 1),
        (Point(1, 2.0), (1, 2.0)),
        (collections.OrderedDict(a=1), {"a": 1}),
        (collections.defaultdict(list, {1: 2}), {1: 2}),
        (Loud("x"), "x"),
        (np.str_("x"), "x"),
        (np.longlong(3), np.int64(3)),
        (np.array([1, 2], ">i4"), np.array([1, 2], "<i4")),
    ],
    ids=lambda value: type(value).__name__,
)
def test_subclasses_come_back_as_the_built_in(value, expected):
    assert same(decode(encode(value)), expected)


def test_an_array_comes_back_writable_and_in_its_layout():
    array = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    back = decode(encode(array))
    back[0, 0] = 7
    assert back.tolist() == [[7, 1, 2], [3, 4, 5]]


def test_numpy_scalars_stay_apart_from_python_numbers():
    assert type(decode(encode(np.int64(1)))) is np.int64
    assert type(decode(encode(np.bool_(True)))) is np.bool_
    assert type(decode(encode(np.float64(1)))) is np.float64
    assert type(decode(encode(True))) is bool


def test_an_error_keeps_its_parts():
    error = RemoteError("ValueError", "no,\nno", "  line 3, in f: raise", 3)
    assert decode(encode(error)) == error


ODD = "\ud800 \x1b[2J \u202e \x00 \n"


@given(texts)
def test_whatever_a_controller_raises_can_be_sent(text):
    """The child itself describes an exception so that the wire carries it."""
    kind = type("E", (Exception,), {})
    kind.__name__ = (
        text.replace("\0", "").encode("utf-8", "replace").decode() + 300 * "n"
    )
    for message in (text, 3000 * ODD):
        described = describe(kind(message), "")
        assert decode(encode(described)) == described


def test_lines_of_a_traceback_are_bounded():
    """Odd names of functions and lines of any length are cut, and printable."""
    source = "def f(): raise ValueError" + 4000 * " " + "# \u202e" + 4000 * "x"
    code = compile(source, FILE_NAME, "exec")
    members = {}
    exec(code, members)
    members["f"].__code__ = members["f"].__code__.replace(co_name=300 * ODD)
    try:
        members["f"]()
    except ValueError as error:
        described = describe(error, source)
    assert decode(encode(described)) == described
    assert 100 < len(described.traceback) < 400


@pytest.mark.parametrize(
    "value",
    [
        object(),
        {1, 2},
        1j,
        np.array(["a"]),
        np.array([1j]),
        np.zeros(2, "M8[s]"),
        iter([]),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_has_no_encoding_is_kept_as_a_handle(value):
    kept = []

    def keep(item):
        kept.append(item)
        return Handle(7, type(item).__name__)

    assert decode(encode([value], keep)) == [Handle(7, type(value).__name__)]
    assert kept[0] is value
    with pytest.raises(WireError, match="cannot be sent"):
        encode(value)


def test_a_handle_is_resolved_where_the_object_lives():
    assert decode(encode([Handle(3, "M")]), 0, lambda h: h.id + 1) == [4]


def nested(depth):
    value = 0
    for _ in range(depth):
        value = [value]
    return value


@pytest.mark.parametrize(
    ("value", "match"),
    [
        (nested(wire.MAX_DEPTH + 1), "nested deeper"),
        ([0] * (wire.MAX_ITEMS + 1), "more than 1000000 items"),
        (dict.fromkeys(map(str, range(wire.MAX_DICT_ITEMS + 1))), "dict items"),
        (dict.fromkeys(range(wire.MAX_DICT_ITEMS // wire.ODD_KEY + 1)), "dict items"),
        ({(0,) * 1000: 0}, "dict items"),
        ([np.zeros(1)] * (wire.MAX_ITEMS // 11 + 1), "arrays"),
        (1 << (8 * wire.MAX_INT_BYTES), "too large"),
        (np.zeros((1,) * 9), "cannot be sent"),
    ],
)
def test_values_beyond_the_limits_are_refused(value, match):
    with pytest.raises(WireError, match=match):
        encode(value)


def test_a_list_that_holds_itself_is_refused():
    value = []
    value.append(value)
    with pytest.raises(WireError, match="nested deeper"):
        encode(value)


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"", "not a value"),
        (b"?", "not a value"),
        (b"NN", "1 extra bytes"),
        (b"l\xff\xff\xff\xff", "too many items"),
        (b"d\x02\0\0\0NNNN", "same key twice"),
        (b"d\x01\0\0\0l\0\0\0\0N", "unhashable"),
        (b"d\xff\xff\0\0", "too many dict items"),
        (b"l\x02\0\0\0" + 2 * encode(dict.fromkeys(range(999))), "too many dict items"),
        (b"s\x01\0\0\0\xff", "utf-8"),
        (b"b\xff\xff\xff\xff", "expected 4294967295 bytes"),
        (b"I\xff\xff\xff\xff", "an int of 4294967295 bytes"),
        (b"a\x0b\x01\xff\xff\xff\xff", "longer than its frame"),
        (b"a\x00\x09", "9 dimensions"),
        (b"a\x0b\x03\0\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff", "not a value"),
        (b"n\x00\x07", "neither 0 nor 1"),
        (b"n\x63", "not a value"),
        (b"h\0\0\0\0N", "expected a string"),
        (b"l\x01\0\0\0" * 40, "nested too deep"),
        (encode(Handle(0, "\ud800")), "cannot be printed"),
        (encode(Handle(0, "\x1b[2J")), "cannot be printed"),
        (encode(Handle(0, "a\nb")), "cannot be printed"),
        (encode(Handle(0, "n" * 201)), "too long"),
        (encode(RemoteError("\u202e", "", "", 0)), "cannot be printed"),
        (encode(RemoteError("E", "\ud800", "", 0)), "cannot be printed"),
        (encode(RemoteError("E", "", "\x9b31m", 0)), "cannot be printed"),
        (encode(RemoteError("E", "m" * 2001, "", 0)), "too long"),
    ],
)
def test_forged_bytes_are_refused(data, match):
    with pytest.raises(WireError, match=match):
        decode(data)


def observation(random):
    return {
        "pose": random.normal(size=3).astype(np.float32),
        "ranges": random.normal(size=18).astype(np.float32),
        "grid": random.integers(0, 9, (2, 3)),
    }


def test_a_layout_writes_and_reads_what_the_format_does():
    """The shorter way for observations gives the same bytes, and the same values."""
    random = np.random.default_rng(0)
    layout = Layout.of(observation(random))
    for _ in range(20):
        value = observation(random)
        data = encode(value)
        assert layout.encode(value) == data
        read = layout.decode(data)
        assert list(read) == list(value)
        for name, array in read.items():
            assert array.dtype == value[name].dtype
            assert array.flags.writeable
            np.testing.assert_array_equal(array, value[name])


def test_a_layout_leaves_other_values_alone():
    """A value of another form is none of its business, nor are other bytes."""
    random = np.random.default_rng(0)
    value = observation(random)
    layout = Layout.of(value)
    data = encode(value)
    for other in (
        {**value, "pose": value["pose"].astype(np.float64)},
        {**value, "pose": np.zeros(4, np.float32)},
        {"pose": value["pose"]},
        {"a": value["pose"], "ranges": value["ranges"], "grid": value["grid"]},
        {**value, "grid": [1, 2]},
    ):
        assert layout.encode(other) is None
    for index in (0, 5, 6, 20, len(data)):
        assert layout.decode(data[:index] + b"\xff" + data[index + 1 :]) is None
    for other in (None, {}, {"a": 1}, {1: value["pose"]}, {"a": np.zeros(0)}, [1]):
        assert Layout.of(other) is None


@given(values | st.lists(hashable | scalars | arrays, min_size=2, max_size=2))
def test_whatever_a_policy_answers_is_two_numbers_or_refused(value):
    """No answer makes an error in the judge, where it would be taken for a fault."""
    wheels = as_wheels(value)
    assert wheels is None or (wheels.shape == (2,) and np.isfinite(wheels).all())
    assert len(wrong_action(value)) < 200
