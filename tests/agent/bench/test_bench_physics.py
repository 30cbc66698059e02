"""A bench on another physics: rows of its own, which are not mixed with exact ones."""

import pytest

from tdac_agent.bench.bench import bench
from tdac_agent.bench.shown import merged
from tdac_agent.errors import RunError
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import load_set

pytest.importorskip("mujoco")


@pytest.mark.slow
def test_rows_of_another_physics_are_its_own(few, solver, tmp_path, warm):
    """In one folder nothing of one physics answers for the other one."""
    file, out = tmp_path / "solver.py", tmp_path / "out"
    file.write_text(solver)
    driven = []

    def run(physics):
        return bench(
            [f"own={file}"], [tmp_path / "few.yaml"], "dev", 2, out=out, judge=warm,
            physics=physics, watch=lambda *seen: driven.append(seen),
        )  # fmt: skip

    here, there, again = run("exact"), run("mujoco"), run("mujoco")
    assert there == again
    assert [each.sets[0].physics for each in (here, there)] == ["exact", "mujoco"]
    assert there.sets[0].which == "worlds 0 to 1 of dev, moved by mujoco"
    assert here.rows[0].success.value == there.rows[0].success.value == 1.0
    assert here.rows[0].time.value != there.rows[0].time.value
    assert abs(here.rows[0].time.value - there.rows[0].time.value) < 0.05
    # Twice two worlds, and nothing the third time.
    assert [each[2] for each in driven].count(2) == 2


@pytest.mark.slow
def test_different_physics_are_not_put_together(tmp_path, level, warm):
    folders = [tmp_path / name for name in ("exact", "mujoco")]
    for folder in folders:
        bench(
            ["go-to-goal"],
            [level],
            "dev",
            1,
            out=folder,
            judge=warm,
            physics=folder.name,
        )
    with pytest.raises(RunError, match="physics"):
        merged(folders)


@pytest.mark.parametrize(
    ("level", "split", "physics", "told"),
    [
        ("unknown", "hidden", "mujoco", "hidden worlds are driven with the exact step"),
        ("unknown", "test", "mujoko", "unknown physics 'mujoko'"),
        ("moving", "test", "mujoco", "has no movers"),
    ],
)
def test_what_cannot_be_driven_leaves_no_folder(tmp_path, level, split, physics, told):
    out = tmp_path / "out"
    with pytest.raises(TaskError, match=told):
        bench(["go-to-goal"], [level], split, 1, out=out, physics=physics)
    assert not out.exists()
    assert load_set(level).name == level
