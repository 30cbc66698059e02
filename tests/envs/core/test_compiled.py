"""Kernels: compiled once, kept where nobody else writes, and equal to their Python."""

import ast
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from numba.core import event

import tdac_envs
from tdac_envs.core.code_cache import cache_folder
from tdac_envs.core.compiled import compiling, read_only
from tdac_envs.grid import grid, plan
from tdac_envs.grid.grid import clearance
from tdac_envs.map2d import contact, kernels, rays
from tdac_envs.map2d.contact import first_contact
from tdac_envs.map2d.rays import cast_ray, leaps_of
from tdac_envs.webots.rays import nearest_hit

PACKAGE = Path(tdac_envs.__file__).parent
STEP = (
    "import gymnasium as gym, tdac_envs\n"
    "env = gym.make('TDAC-Map2D-v0')\n"
    "env.reset(seed=0)\n"
    "print(env.step(env.action_space.high)[0]['pose'].tolist())\n"
)
COMPILING = r"tdac: compiling [\w ]+, 1 of \d+ \(cached for later runs\)"


def run(script, **variables):
    """A script in a process of its own: what it prints, and what it says beside."""
    environment = {**os.environ, **{k: str(v) for k, v in variables.items()}}
    command = [sys.executable, "-P", "-c", script]
    done = subprocess.run(
        command, capture_output=True, text=True, env=environment, check=True
    )
    return done.stdout.strip(), done.stderr.strip()


@pytest.fixture(scope="module")
def copied_package():
    """The folder of a copy of the package with an empty cache, which all may read."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, folder / "tdac_envs", ignore=ignored)
    yield folder
    shutil.rmtree(folder)


@pytest.fixture(scope="module")
def cold_start(copied_package):
    """What the first process prints that uses the copy, and what it says beside."""
    return run(STEP, PYTHONPATH=copied_package)


@pytest.mark.slow
def test_a_cold_start_says_what_it_does_and_a_warm_one_nothing(
    cold_start, copied_package
):
    """Also where standard error is no terminal: compiling takes many seconds."""
    pose, said = cold_start
    assert re.fullmatch(COMPILING, said.splitlines()[0])
    assert run(STEP, PYTHONPATH=copied_package) == (pose, "")


@pytest.mark.slow
def test_the_first_run_of_all_compiles_before_the_judge_starts(tmp_path):
    """Where it is said, and only what the task's own environment needs."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "tdac_envs", ignore=ignored)
    variables = {"PYTHONPATH": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)}
    command = ["-m", "tdac_agent", "synth", "--task", "epuck", "--out", "run"]
    done = subprocess.run(
        [sys.executable, "-P", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=tmp_path,
        env={**os.environ, **variables},
        check=False,
    )
    assert done.returncode == 0, done.stdout
    about = re.compile(r"tdac: compiling [\w ]+, \d+ of \d+ \(about \d+ s, cached ")
    said = [bool(about.match(line)) for line in done.stdout.splitlines()]
    assert said[0]
    assert sorted(said, reverse=True) == said
    kept = {folder.name.split("_")[0] for folder in tmp_path.rglob("tdac-*/*")}
    assert "epuck" in kept
    assert not list(tmp_path.rglob("tdac-*/map2d_*/kernels.drive-*.nbi"))


@pytest.mark.slow
def test_an_edited_callee_in_another_module_takes_effect(copied_package):
    """numba looks at the file of the kernel that is called, and at no other."""
    script = (
        "import numpy as np\n"
        "from tdac_envs.core.compiled import read_only\n"
        "from tdac_envs.map2d.straight import is_straight_path_free\n"
        "clear = read_only(np.full((9, 40), 9.0), np.float32)\n"
        "print(is_straight_path_free(clear, 4.0, 4.0, 30.0, 4.0, 2.0))\n"
    )
    file = copied_package / "tdac_envs" / "map2d" / "contact.py"
    text = file.read_text()
    assert "    return contact_before(" in text
    assert run(script, PYTHONPATH=copied_package)[0] == "True"
    file.write_text(
        text.replace("return contact_before(", "return 0.0 * contact_before(")
    )
    edited, said = run(script, PYTHONPATH=copied_package)
    file.write_text(text)
    assert edited == "False"
    assert re.match(COMPILING, said)
    assert run(script, PYTHONPATH=copied_package) == ("True", "")


@pytest.mark.slow
def test_constants_of_kernels_stand_where_changes_are_noticed():
    """A file that is not looked at may have no number that is compiled in."""
    texts = {file: file.read_text() for file in PACKAGE.rglob("*.py")}
    known = {file for file, text in texts.items() if "compiled import" in text}
    for file in known:
        for node in ast.walk(ast.parse(texts[file])):
            module = getattr(node, "module", None) or ""
            if isinstance(node, ast.ImportFrom) and module.startswith("tdac_envs."):
                source = PACKAGE.joinpath(*module.split(".")[1:]).with_suffix(".py")
                names = {each.name for each in node.names if each.name.isupper()}
                own = _names_in_kernels(texts[file]) & names
                assert not own or source in known, (file, own)


def _names_in_kernels(text):
    """The names that kernels and subkernels of a file use."""
    functions = [
        node
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef)
        and any("kernel" in ast.unparse(each) for each in node.decorator_list)
    ]
    inner = (node for function in functions for node in ast.walk(function))
    return {node.id for node in inner if isinstance(node, ast.Name)}


def folder_with(**variables):
    """The cache folder of a process with these variables, and what it says of it."""
    script = "from tdac_envs.core.code_cache import cache_folder; print(cache_folder())"
    return run(script, **variables)


@pytest.mark.slow
@pytest.mark.parametrize(
    "setting",
    [{"NUMBA_OPT": "0"}, {"NUMBA_CPU_NAME": "generic"}, {"NUMBA_DEBUGINFO": 1}],
)
def test_settings_of_numba_have_a_folder_of_their_own(setting):
    """Code made without optimisation is not loaded where it is made with it."""
    usual, _ = folder_with()
    assert folder_with(**setting)[0] != usual
    assert folder_with() == (usual, "")


def test_functions_of_others_keep_their_place(tmp_path):
    """A user's own cache folder is left as it is."""
    script = "import numba, tdac_envs.map2d.kernels\nprint(numba.config.CACHE_DIR)\n"
    assert run(script, NUMBA_CACHE_DIR=tmp_path)[0] == str(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_without_compiling_the_same_comes_out():
    """`NUMBA_DISABLE_JIT=1` runs the same kernels as plain Python, for debugging."""
    script = (
        "import gymnasium as gym, numpy as np, tdac_envs\n"
        "cells = np.zeros((40, 60), bool); cells[18:22, 20:] = True\n"
        "options = dict(map=cells, start=(10, 8), goal=(50, 33), robot_radius=4)\n"
        "envs = gym.make_vec('TDAC-Map2D-v0', 2, 'vector_entry_point', **options)\n"
        "env = gym.make('TDAC-Map2D-v0', **options)\n"
        "seen = [envs.reset(seed=3)[0], env.reset(seed=3)[0]]\n"
        "for k in range(9):\n"
        "    seen += [envs.step(np.full((2, 2), 0.5 + 0.1 * k, np.float32))[0]]\n"
        "    seen += [env.step(np.array([1.0, 0.2 * k], np.float32))[0]]\n"
        "import json\n"
        "print(json.dumps([v.tolist() for each in seen for v in each.values()]))\n"
    )
    compiled, plain = run(script)[0], run(script, NUMBA_DISABLE_JIT=1)[0]
    for one, other in zip(json.loads(compiled), json.loads(plain), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("make", ["link", "loose", "loose file", "loose above"])
def test_a_folder_that_others_may_write_to_is_not_believed(make, tmp_path):
    """What lies there is run, so nobody else may have put it there."""
    from tdac_envs.core.trusted_folders import is_private

    folder = tmp_path / "above" / "cache"
    (folder / "inner").mkdir(parents=True)
    (folder / "inner" / "file").write_bytes(b"")
    for each in (tmp_path / "above", folder, folder / "inner"):
        each.chmod(0o755)
    assert is_private(folder)
    if make == "link":
        (folder / "inner" / "link").symlink_to("/dev/null")
    elif make == "loose":
        (folder / "inner").chmod(0o777)
    elif make == "loose file":
        (folder / "inner" / "file").chmod(0o666)
    else:
        (tmp_path / "above").chmod(0o777)
    assert not is_private(folder)


as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can be another user")


@as_root
@pytest.mark.parametrize("what", ["folder", "file"])
def test_another_user_s_code_is_not_believed(what, tmp_path):
    """Not even where nobody but that user can write to it."""
    from tdac_envs.core.trusted_folders import is_private

    folder = tmp_path / "cache"
    folder.mkdir(mode=0o755)
    (folder / "file").write_bytes(b"")
    assert is_private(folder)
    os.chown(folder if what == "folder" else folder / "file", 12345, 12345)
    assert not is_private(folder)


@pytest.mark.slow
@as_root
@pytest.mark.parametrize("home", ["own", "none"])
def test_an_unprivileged_user_reads_a_warm_package(home, cold_start, copied_package):
    """In a private copy, made once; without a place for it, a line says so."""
    own = copied_package / home
    own.mkdir()
    os.chown(own, 12345, 12345)
    # Other packages are imported before, since they need not be readable for others.
    again = STEP if home == "own" else "import tdac_envs.map2d.kernels"
    script = (
        f"{STEP}"
        "import os, sys, gymnasium as gym\n"
        "for name in [n for n in sys.modules if n.startswith('tdac_envs')]:\n"
        "    del sys.modules[name]\n"
        "for name in [n for n in gym.registry if n.startswith('TDAC-')]:\n"
        "    del gym.registry[name]\n"
        "os.setgroups([]); os.setgid(12345); os.setuid(12345)\n"
        f"{again}\n"
    )
    variables = {"PYTHONPATH": copied_package, "XDG_CACHE_HOME": ""}
    variables["HOME"] = own if home == "own" else "/nonexistent"
    poses, said = run(script, **variables)
    assert set(poses.split("\n")) == {cold_start[0]}
    if home == "own":
        (copy,) = own.glob(".cache/tdac/tdac-*")
        assert (copy.stat().st_uid, copy.stat().st_mode & 0o777) == (12345, 0o700)
        assert said == ""
    else:
        assert said.startswith("tdac: compiled code cannot be kept in ")
        assert said.count("\n") == 0


@pytest.mark.slow
def test_warming_uses_every_kernel():
    """After `tdac warm` nobody waits for a compiler; each has one set of types."""
    script = (
        "import importlib, pkgutil, tdac_envs\n"
        "from tdac_agent.tasks.registry import own_environments\n"
        "for one in own_environments():\n"
        "    one.use_kernels()\n"
        "for found in pkgutil.walk_packages(tdac_envs.__path__, 'tdac_envs.'):\n"
        "    if not any(p in found.name for p in ('.webots.controller', '.sb3')):\n"
        "        importlib.import_module(found.name)\n"
        "from tdac_envs.core.compiled import KERNELS\n"
        "print([k.__name__ for k in KERNELS if len(k.signatures) != 1])\n"
    )
    assert run(script)[0] == "[]"


def test_an_import_compiles_nothing():
    """What is heavy waits for the first environment."""
    script = (
        "import sys, tdac_envs\n"
        "print(sorted({'numba', 'llvmlite', 'cv2', 'scipy'} & set(sys.modules)))\n"
    )
    assert run(script) == ("[]", "")


def test_the_folder_is_this_machine_s_own():
    """Machine code of another processor would end the process."""
    assert cache_folder() is None or cache_folder().name.startswith("tdac-")


@pytest.mark.parametrize("seed", range(5))
def test_compiled_and_plain_agree(seed):
    """Machine code and the Python it was made of give the same numbers."""
    random = np.random.default_rng(seed)
    cells = random.random((24, 31)) < 0.2
    cells[10:14, 10:14] = False
    free = ~cells
    clear = clearance(cells)
    plain = np.empty_like(clear)
    rows, site = np.empty(cells.shape, np.int32), np.empty(33, np.int64)
    grid._clearance.py_func(cells, rows, site, np.empty((2, 34)), plain)
    np.testing.assert_array_equal(clear, plain)
    field = plan.distance_field(free, (12, 12))
    wide, own = np.empty((26, 33)), np.empty(cells.shape)
    first, buckets = 13 * 33 + 13, np.empty((3, 9000), np.int32)
    assert plan._spread.py_func(free, first, wide, buckets)
    plan._cropped.py_func(wide, own)
    np.testing.assert_array_equal(field, own)
    leaps, padded = read_only(leaps_of(cells)), read_only(np.pad(clear, 1))
    plain = np.zeros_like(leaps)
    rays._fill_leaps.py_func(cells, plain)
    np.testing.assert_array_equal(leaps, plain)
    for _ in range(20):
        x, y = random.uniform(10.5, 12.5, 2)
        angle, turn = random.uniform(-math.pi, math.pi, 2)
        ray = (leaps, x, y, angle, 40.0)
        assert cast_ray(*ray) == pytest.approx(rays.cast_ray.py_func(*ray), abs=1e-12)
        step = (padded, x, y, angle, random.uniform(-9, 9), turn, 1.0)
        exact = contact.first_contact.py_func(*step)
        assert first_contact(*step) == pytest.approx(exact, abs=1e-9)
        way = (leaps, read_only(field, np.float32), x, y, 5.0)
        exact = kernels._path_distance.py_func(*way)
        assert kernels.path_distance(*way) == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize(
    ("kernel", "what"),
    [(first_contact, "the environment"), (nearest_hit, "the sensors of Webots")],
)
def test_a_program_can_show_what_is_compiled(kernel, what):
    """A page that waits for it, for example: what for, and how much of it."""
    assert compiling() == ""
    with event.trigger_event("numba:compile", data={"dispatcher": kernel}):
        said = re.match(rf"compiling {what}, (\d+) of (\d+) \(cached", compiling())
    assert 1 <= int(said[1]) <= int(said[2])
    assert compiling() == ""
