"""Random numbers that are the same everywhere."""

import hashlib
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tdac_envs.ladder.random_stream import RandomStream, rounded, world_key

GOLDEN_WORDS = "b836e7e42419968d9a1ddd6e486e2ce19de48f31b065451957778e75beaadf1e"
GOLDEN_KEY = "ceb7f2773124549d66b61e817c4167932605f830f87dfad4fa26a98ef6565e26"
KEYS = st.binary(min_size=32, max_size=32)


def test_the_words_are_philox_with_both_halves_of_the_key():
    """Two keys that differ in any byte give different words."""
    key = bytes(range(32))
    low, high = int.from_bytes(key[:16], "little"), int.from_bytes(key[16:], "little")
    plain = np.random.Philox(key=low, counter=high << 128).random_raw(1000)
    words = RandomStream(key)
    assert [words.word() for _ in range(1000)] == plain.tolist()
    firsts = {
        RandomStream(bytes(k == at for k in range(32))).word() for at in range(32)
    }
    assert len(firsts) == 32


def test_golden_words():
    """NumPy guarantees them; the maps to numbers are our own."""
    words = RandomStream(bytes(range(32)))
    drawn = [
        words.word(),
        words.integer(-3, 10**12),
        words.uniform(-1.0, 1.0),
        words.chance(0.5),
        words.shuffled("abcdef"),
        words.choice("abcdef"),
        np.packbits(words.chances(0.3, (5, 5))).tolist(),
        words.word(),
    ]
    assert hashlib.sha256(repr(drawn).encode()).hexdigest() == GOLDEN_WORDS


def test_golden_key():
    """The key is an HMAC of canonical JSON, as other programs can compute it."""
    key = world_key(b"salt", "ab" * 32, "test", 7, "world")
    assert key.hex() == GOLDEN_KEY
    others = [
        world_key(b"salu", "ab" * 32, "test", 7, "world"),
        world_key(b"salt", "ac" * 32, "test", 7, "world"),
        world_key(b"salt", "ab" * 32, "dev", 7, "world"),
        world_key(b"salt", "ab" * 32, "test", 8, "world"),
        world_key(b"salt", "ab" * 32, "test", 7, "noise"),
    ]
    assert len({key, *others}) == 6


@given(KEYS, st.integers(-(10**20), 10**20), st.integers(0, 2**64 - 1))
def test_integers_are_within_their_bounds(key, low, more):
    """Both bounds are included, up to a range of 2**64 numbers."""
    words = RandomStream(key)
    assert all(low <= words.integer(low, low + more) <= low + more for _ in range(20))


@given(KEYS, st.floats(-1e6, 1e6), st.floats(0, 1e6))
def test_real_numbers_are_multiples_within_their_rounded_bounds(key, low, more):
    """They have 16 binary digits after the point."""
    value = RandomStream(key).uniform(low, low + more)
    assert rounded(low) <= value <= rounded(low + more)
    assert value == rounded(value)


@given(KEYS, st.integers(0, 70), st.integers(0, 30), st.integers(0, 30))
def test_an_array_of_chances_is_as_many_single_ones(key, before, rows, columns):
    """Also when some words are left of a block."""
    one, other = RandomStream(key), RandomStream(key)
    for words in (one, other):
        for _ in range(before):
            words.word()
    many = one.chances(0.3, (rows, columns))
    single = [other.chance(0.3) for _ in range(rows * columns)]
    assert many.ravel().tolist() == single
    assert one.word() == other.word()


def test_all_integers_are_equally_likely():
    """Chi-square of 5 x 2**62 numbers, where the upper word alone would be biased."""
    words, counts, n = RandomStream(bytes(32)), np.zeros(5), 20_000
    for _ in range(n):
        counts[words.integer(0, 5 * 2**61 - 1) // 2**61] += 1
    assert ((counts - n / 5) ** 2 / (n / 5)).sum() < 18.5  # 4 degrees, p = 0.001


def test_all_orders_are_equally_likely():
    """Chi-square of the 24 orders of four values."""
    words, n = RandomStream(bytes(32)), 12_000
    counts = dict.fromkeys(itertools.permutations(range(4)), 0)
    for _ in range(n):
        counts[tuple(words.shuffled(range(4)))] += 1
    found = np.array(list(counts.values()))
    assert ((found - n / 24) ** 2 / (n / 24)).sum() < 49.8  # 23 degrees, p = 0.001


@pytest.mark.parametrize(("probability", "share"), [(0.0, 0.0), (1.0, 1.0), (0.3, 0.3)])
def test_chances(probability, share):
    """0 never and 1 always comes true."""
    found = RandomStream(bytes(32)).chances(probability, (100, 200)).mean()
    assert found == pytest.approx(share, abs=0.015 if 0 < share < 1 else 0.0)


def test_bad_arguments():
    """They are named."""
    with pytest.raises(ValueError, match="a key of 32 bytes, got 31"):
        RandomStream(bytes(31))
    with pytest.raises(ValueError, match=r"got 2 to 1"):
        RandomStream(bytes(32)).integer(2, 1)
    with pytest.raises(ValueError, match=r"got 0 to -1"):
        RandomStream(bytes(32)).choice([])
