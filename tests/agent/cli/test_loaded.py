"""What a command loads."""

import subprocess

import pytest
from small import write_small_task

from tdac_agent.interpreter import python, safe_environment

NOT_FOR_MAPS = ("tdac_envs.ladder", "tdac_envs.worlds", "tdac_envs.epuck")
NAMES = {"tdac_envs.worlds", "tdac_envs.worlds.bundled"}
"""What lists the names of bundled worlds, which a task may not have."""
MODULES = (
    *("cli.synth", "cli.verify", "environments.map2d.entry", "builtin.provider"),
    *("verification.verify_episodes", "verification.judge.server"),
    *("verification.judge.episode_job", "verification.judge.findings"),
)
"""What these commands, and a judge, load."""
STARTS = {
    "synth": ("tdac_agent", "synth", "--task", "small", "--out", "r"),
    "verify": ("tdac_agent", "verify", "--task", "small", "small/c.py", "-n", "1"),
    "a judge": ("tdac_agent.verification.judge.server", "small"),
}


def _loaded(*words, cwd):
    """Names of the modules that a process imports, beginning with `words`."""
    done = subprocess.run(
        python("-X", "importtime", *words),
        cwd=cwd,
        env=safe_environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "tdac_envs" in loaded
    return loaded


@pytest.mark.slow
def test_code_for_tasks_imports_no_task_sets_and_no_worlds(tmp_path):
    """What a task on a map needs imports no code of other problems, and no pandas."""
    names = ", ".join(f"tdac_agent.{each}" for each in MODULES)
    loaded = _loaded("-c", f"import {names}", cwd=tmp_path)
    assert not [each for each in loaded if each.startswith(NOT_FOR_MAPS)]
    assert not {"pandas", "matplotlib", "torch"} & loaded


@pytest.mark.slow
@pytest.mark.parametrize("name", STARTS)
def test_a_task_on_a_map_loads_neither_task_sets_nor_worlds(
    tmp_path, good_source, name
):
    """Commands on a task on a map, and its judge, import no code of other problems."""
    (write_small_task(tmp_path / "small") / "c.py").write_text(good_source)
    loaded = _loaded("-m", *STARTS[name], cwd=tmp_path)
    assert not {each for each in loaded if each.startswith(NOT_FOR_MAPS)} - NAMES
