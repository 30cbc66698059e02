"""What is compiled before the first run: what this run needs, and nothing else."""

import importlib
import inspect
import json
import re
import subprocess
import sys

import pytest
from numba.core import event

from tdac_agent.tasks.first_run import CodePart, compile_first
from tdac_agent.tasks.registry import environment
from tdac_envs.core.code_cache import cache_folder
from tdac_envs.core.compiled import KERNELS, compiling
from tdac_envs.map2d import kernels

STATIC = {
    "drive.stepping.wrap_angle",
    *(f"grid.astar.{name}" for name in ("_clear", "_octile", "_search")),
    "grid.grid._clearance",
    *(f"grid.plan.{name}" for name in ("_cropped", "_descend", "_spread", "_walk")),
    "map2d.contact.first_contact",
    *(f"map2d.kernels.{name}" for name in ("begin", "drive", "path_distance")),
    *(f"map2d.rays.{name}" for name in ("_fill_leaps", "sees")),
    "map2d.smallest_gap.note_gap",
    "map2d.straight.is_straight_path_free",
    "map2d.terrain.may_start",
}
"""The kernels that a judged run on a map without movers uses."""
LEFT_OUT = "drive.sliding", "movers.", "map2d.among", "map2d.encounters", "map2d.sonar"


def name_of(compiled):
    function = compiled.py_func
    return f"{function.__module__.removeprefix('tdac_envs.')}.{function.__name__}"


@pytest.mark.slow
def test_a_map_without_movers_needs_few_kernels():
    """Each further one would be compiled before the first run of all."""
    script = (
        "import json\n"
        "from tdac_agent.tasks.registry import environment\n"
        "for part in environment('TDAC-Map2D-v0').code_parts(movers=False):\n"
        "    part.use()\n"
        "from tdac_envs.core.compiled import KERNELS\n"
        "used = [each.py_func for each in KERNELS if each.signatures]\n"
        "print(json.dumps([f'{f.__module__}.{f.__name__}' for f in used]))\n"
    )
    command = [sys.executable, "-P", "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    used = {name.removeprefix("tdac_envs.") for name in json.loads(done.stdout)}
    assert {"map2d.kernels.begin", "map2d.kernels.drive"} <= used <= STATIC


def called_by(compiled, known):
    """All that a kernel has compiled with it: what it calls, directly or not."""
    if name_of(compiled) in known:
        return
    known.add(name_of(compiled))
    found = inspect.getclosurevars(compiled.py_func)
    for value in (*found.nonlocals.values(), *found.globals.values()):
        if hasattr(value, "py_func"):
            called_by(value, known)


def test_a_step_without_movers_has_no_code_of_movers_or_sliding():
    """Neither do the other kernels that a map without movers needs."""
    for kernel in KERNELS:
        if name_of(kernel) in STATIC:
            called = set()
            called_by(kernel, called)
            assert not [name for name in called if name.startswith(LEFT_OUT)]
    called = set()
    called_by(kernels.drive_or_slide, called)
    assert [name for name in called if name.startswith("drive.sliding")]


def test_only_code_that_is_not_cached_is_compiled():
    """Whatever else is cached."""
    if cache_folder() is None:
        pytest.skip("nothing is cached here")
    used = []
    env = environment("TDAC-Map2D-v0").small_env()
    env.reset(seed=0)
    env.step(env.action_space.sample())
    parts = [
        CodePart(lambda: used.append("old"), "tdac_envs.map2d", "kernels.drive", 1.0),
        CodePart(lambda: used.append("new"), "tdac_envs.map2d", "kernels.none", 1.0),
    ]
    assert [part.is_compiled() for part in parts] == [True, False]
    compile_first(parts)
    assert used == ["new"]


@pytest.mark.parametrize("env_id", ["TDAC-Map2D-v0", "TDAC-EPuck-v0"])
def test_the_mark_of_a_part_is_a_kernel(env_id):
    """Only a kernel is kept on disk, so another function would never be found."""
    for part in environment(env_id).code_parts(movers=True, worlds=True):
        module, name = part.last.split(".")
        found = getattr(importlib.import_module(f"{part.package}.{module}"), name)
        assert found in KERNELS


@pytest.mark.parametrize(
    ("movers", "worlds", "last"),
    [
        (False, False, ["rays.sees"]),
        (True, False, ["rays.sees", "among.drive_among"]),
        (False, True, ["rays.sees", "dead_ends._look"]),
    ],
)
def test_movers_and_worlds_are_parts_of_their_own(movers, worlds, last):
    """A task set with movers needs the planners that admit its worlds, too."""
    parts = environment("TDAC-Map2D-v0").code_parts(movers=movers, worlds=worlds)
    assert [part.last for part in parts] == last


def test_a_run_says_how_long_it_will_compile():
    """Before the first kernel, for this machine."""
    said = []

    def use():
        with event.trigger_event("numba:compile", data={"dispatcher": KERNELS[0]}):
            said.append(compiling())

    if cache_folder() is None:
        pytest.skip("nothing is cached here")
    compile_first([CodePart(use, "tdac_envs.map2d", "kernels.none", 20.0)])
    use()
    first, then = (re.match(r"compiling [\w ]+, \d+ of \d+ \((\w+)", s) for s in said)
    assert (first[1], then[1]) == ("about", "cached")
