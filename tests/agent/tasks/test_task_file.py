"""The manual of `task.yaml` names each key, and its examples are valid."""

import re
from pathlib import Path

import pytest

from tdac_agent import load_task
from tdac_agent.tasks.task_file import ProgressSpec, RobotSpec, TaskFile, checked
from tdac_envs.core.intake import parse_yaml

MANUAL = Path(__file__).parents[3] / "docs" / "tasks.md"


def test_each_key_has_a_row():
    """With a meaning; keys of `robot` are written with a dot."""
    row = re.compile(r"^\| `([\w.]+)` \|(?:[^|\n]*\|){3,}$", re.MULTILINE)
    rows = set(row.findall(MANUAL.read_text("utf-8")))
    names = {field.alias or name for name, field in TaskFile.model_fields.items()}
    robot = {f"robot.{name}" for name in RobotSpec.model_fields}
    assert rows == (names - {"robot"}) | robot
    for name in ProgressSpec.model_fields:
        assert f"`{name}`" in MANUAL.read_text("utf-8")


def test_the_examples_are_task_files():
    """Each block of YAML is accepted."""
    blocks = re.findall(r"```yaml\n(.*?)```", MANUAL.read_text("utf-8"), re.DOTALL)
    assert len(blocks) == 4
    for block in blocks:
        checked(parse_yaml(block.encode()), "docs/tasks.md")


@pytest.mark.parametrize("profile", ["policy", "paper"])
def test_a_task_with_another_profile(profile):
    """Only the profile changes: the episodes are the same."""
    task = load_task("maze")
    other = task.with_profile(profile)
    assert other.spec.profile == profile
    assert other.sha256() == task.sha256()
    assert task.with_profile(None) is task
