"""Promises of the hash of the code that decides what happens in an episode."""

import ast

import pytest

from tdac_envs.core.dynamics import (
    IN_WORLDS,
    NEUTRAL,
    ON_MAPS,
    PACKAGE,
    SAME,
    code_of,
    code_sha256,
    files_of,
)
from tdac_envs.ladder.frozen import ON_MAPS_OF_SETS, ON_PLATES

ALL = ON_MAPS_OF_SETS, ON_PLATES, ON_MAPS, IN_WORLDS
SOURCE = '''"""Module."""

SIZE = 0.057  # m
"""Of the axle."""


def turn(left, right):
    r"""Turns."""
    # A comment.
    return "a # b", f"{left} # {right}", """
    text"""
'''
OTHERS = {
    "comment": ("# m", "# metres, of the 'axle"),
    "no comment": ("  # m", ""),
    "docstring": ('"""Module."""', '"""Another\n\n"text" # here.\n"""'),
    "of a constant": ('"""Of the axle."""\n', ""),
    "raw docstring": ('r"""Turns."""', 'r"""Turns \\d."""'),
    "blank line": ("\n\n\n", "\n\n"),
    "line ends": ("\n", "\r\n"),
}
CHANGES = {
    "constant": ("0.057", "0.052"),
    "text": ("a # b", "a # c"),
    "format": ("# {right}", "# {left}"),
    "long text": ("    text", "    other"),
    "name": ("SIZE", "AXLE"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_what_does_not_run_does_not_count(name):
    """Comments, docstrings, blank lines and line ends change nothing."""
    old, new = OTHERS[name]
    assert old in SOURCE
    assert code_of(SOURCE.replace(old, new)) == code_of(SOURCE)


@pytest.mark.parametrize("name", CHANGES)
def test_what_runs_counts(name):
    """Every change of code and of its texts changes the hash."""
    old, new = CHANGES[name]
    assert old in SOURCE
    assert code_of(SOURCE.replace(old, new)) != code_of(SOURCE)


@pytest.mark.slow
@pytest.mark.parametrize("part", sorted({part for parts in ALL for part in parts}))
def test_only_docstrings_are_left_out_of_our_code(part):
    """The rest of a file has the same syntax tree as the whole of it.

    A function of a docstring alone has no body left; nothing is compared there.
    """
    for name in files_of(part):
        source = (PACKAGE / name).read_text("utf-8")
        whole = ast.parse(source)
        bodies = [getattr(node, "body", None) for node in ast.walk(whole)]
        if any(
            isinstance(body, list) and _without_texts(body) == [] for body in bodies
        ):
            continue
        rest = ast.parse(code_of(source))
        for node in ast.walk(whole):
            if isinstance(body := getattr(node, "body", None), list):
                node.body = _without_texts(body)
        assert ast.dump(rest) == ast.dump(whole), name


def _without_texts(body):
    return [
        each
        for each in body
        if not isinstance(each, ast.Expr)
        or not isinstance(each.value, ast.Constant)
        or not isinstance(each.value.value, str)
    ]


@pytest.mark.parametrize(
    ("parts", "names"),
    [
        (
            ON_MAPS,
            "core/compiled.py drive/stepping.py drive/disturbances.py grid/grid.py "
            "map2d/kernels.py map2d/rays.py map2d/contact.py map2d/among.py "
            "map2d/encounters.py map2d/reception.py map2d/observed.py map2d/env.py "
            "mapping/ray_angles.py movers/orca.py movers/crowd.py",
        ),
        (
            ON_MAPS_OF_SETS,
            "map2d/kernels.py ladder/admission.py ladder/observed.py ladder/env.py "
            "ladder/generators/mazes.py ladder/random_stream.py ladder/set_file.py",
        ),
        (
            ON_PLATES,
            "worlds/world.py worlds/bodies.py epuck/kernels.py epuck/infrared.py "
            "epuck/contact.py epuck/pushing.py ladder/plate_worlds.py "
            "ladder/generators/plates.py ladder/robots.py drive/stepping.py",
        ),
        (IN_WORLDS, "worlds/world.py worlds/bodies.py epuck/kernels.py"),
    ],
)
def test_what_decides_an_episode_counts(parts, names):
    """Constants of the robots, kernels, observations, generators and admission."""
    assert set(names.split()) <= set(files_of(*parts))


def test_each_folder_counts_or_decides_nothing():
    """A new folder is added to the lists of `dynamics`, or here.

    Another physics gives a second opinion; it is no part of the exact step.
    """
    elsewhere = {"controller_kit", "core", "drawing", "learning", "robots", "webots"}
    elsewhere.add("physics")
    folders = {file.parent.name for file in PACKAGE.glob("*/__init__.py")}
    counted = {name.split("/")[0] for parts in ALL for name in files_of(*parts)}
    assert folders == elsewhere | counted


def test_pictures_and_training_do_not_count():
    """And each entry that leaves files out leaves out at least one."""
    files = [file.relative_to(PACKAGE).as_posix() for file in PACKAGE.rglob("*.py")]
    for end in NEUTRAL:
        assert any(file.endswith(end) for file in files), end
    counted = {name for parts in ALL for name in files_of(*parts)}
    assert not any(name.endswith(NEUTRAL) for name in counted)


def test_equal_dynamics_are_not_renamed_twice():
    """`SAME` leads to a hash in one step."""
    assert not set(SAME.values()) & set(SAME)
    assert all(code_sha256(*parts) not in SAME for parts in ALL)
