"""Places on the command line: `--start X Y [YAW]` and `--goal X Y`."""

from __future__ import annotations

from typing import NoReturn

EXPECTED = {
    "--start": "two numbers X Y, or three X Y YAW, as in --start 90 302",
    "--goal": "two numbers X Y, as in --goal 178 386",
}
"""Flags of places, and what they expect."""
HEADING = "--heading"


def with_coordinates(words: list[str]) -> list[str]:
    """The words with each place as `--goal X Y` or `--start X Y --heading YAW`.

    Understands `--start X Y YAW`, `--start X,Y`, `--start "X, Y"`, `--start=X,Y` and
    the like.

    Raises:
        TaskError: A place is not two numbers, or a start with a heading of its own
            comes with `--heading`.
    """
    done: list[str] = []
    rest = list(words)
    while rest:
        flag, is_joined, value = rest[0].partition("=")
        del rest[0]
        done.append(f"{flag}{is_joined}{value}")
        if flag not in EXPECTED:
            continue
        typed = [value, *rest] if is_joined else rest
        numbers, used = _numbers(typed)
        if len(numbers) < 2 or (len(numbers) == 3 and flag == "--goal"):
            _refuse_coordinates(flag, typed, max(used, 2))
        if len(numbers) == 3:
            _refuse_two_headings(words, numbers)
        yaw = [HEADING, numbers[2]] if len(numbers) == 3 else []
        done[-1:] = [flag, *numbers[:2], *yaw]
        del rest[: used - bool(is_joined)]
    return done


def _refuse_coordinates(flag: str, typed: list[str], count: int) -> NoReturn:
    """Refuses a place; quotes up to `count` words, without the next option.

    Raises:
        TaskError: Always.
    """
    from tdac_envs.core.errors import TaskError

    ends = [n for n, word in enumerate(typed) if word.startswith("--")]
    quoted = " ".join([flag, *typed[: min([count, *ends])]])
    raise TaskError(f"{quoted}: expected {EXPECTED[flag]}")


def _refuse_two_headings(words: list[str], numbers: list[str]) -> None:
    """Refuses a start with a heading beside `--heading`.

    Raises:
        TaskError: Both are given.
    """
    from tdac_envs.core.errors import TaskError

    if any(word.partition("=")[0] == HEADING for word in words):
        raise TaskError(
            f"--start {' '.join(numbers)} already has a heading, {numbers[2]}: leave "
            f"out {HEADING}, or the third number"
        )


def _numbers(words: list[str]) -> tuple[list[str], int]:
    """The two or three numbers that the words begin with, and how many words they are.

    Numbers in one word are separated by commas or spaces; if the first word has two of
    them, the place ends with it.
    """
    numbers: list[str] = []
    for used, word in enumerate(words):
        parts = [part for part in word.replace(",", " ").strip("()[] ").split() if part]
        is_place = len(parts) > 1
        if not parts or not all(map(_is_number, parts)) or (numbers and is_place):
            return numbers, used
        if len(numbers) + len(parts) > 3:
            return numbers, used
        numbers += parts
        if is_place:
            return numbers, used + 1
    return numbers, len(words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
