"""Promises of Ladder 1.0."""

from importlib.resources import files

import pytest
import yaml

from tdac_envs import load_set
from tdac_envs.core.dynamics import code_sha256
from tdac_envs.ladder.frozen import (
    BEFORE,
    CODE,
    FROZEN,
    LADDER,
    ON_PLATES,
    UNCHANGED,
    ladder_of,
)
from tdac_envs.ladder.set_file import shipped_names

CHANGED = f"""
The dynamics of {{name}} are not those of {LADDER}. They are frozen: results are
compared with each other, and the ledger of hidden worlds answers from them.
- A change that moves no number of an episode: `python -m tools.frozen --drive` prints
  the same before and after it. Add the old and the new hash of the code to SAME in
  tdac_envs/core/dynamics.py; results stay valid.
- Any other change: raise LADDER in tdac_envs/ladder/frozen.py, replace its table by
  what `python -m tools.frozen` prints, and drive everything in results/ again.
"""


def test_all_bundled_sets_are_frozen():
    """In the order in which they are listed."""
    assert tuple(FROZEN) == shipped_names()


@pytest.mark.parametrize("parts", CODE, ids=("maps", "plates"))
def test_the_code_is_frozen(parts):
    """It decides together with the values of a set what happens in an episode."""
    name = "sets of an e-puck" if parts is ON_PLATES else "sets on maps"
    found, frozen = code_sha256(*parts), CODE[parts]
    same = f'For SAME: "{found}": "{frozen}"'
    assert found == frozen, CHANGED.format(name=name) + same


@pytest.mark.parametrize("name", shipped_names())
def test_the_dynamics_of_bundled_sets_are_frozen(name):
    """Neither their values nor the code that drives on them changes."""
    own = load_set(name)
    assert (own.sha256, own.dynamics) == FROZEN[name], CHANGED.format(name=name)


def test_a_named_robot_counts_with_all_figures(tmp_path):
    """Its values are resolved before they are hashed, not its name."""
    text = (
        files("tdac_envs.robots").joinpath("files/paper-disc.yaml").read_text("utf-8")
    )
    assert "75.59" in text
    robot, path, found = tmp_path / "disc.yaml", tmp_path / "set.yaml", []
    values = {"robot": str(robot), "worlds": [{"name": "aisles"}]}
    path.write_text(yaml.safe_dump(values))
    for speed in ("75.59", "75.6"):
        robot.write_text(text.replace("75.59", speed))
        found.append(load_set(path))
    assert str(robot) not in str(found[0].file.model_dump(mode="json"))
    assert len({own.sha256 for own in found}) == 2
    assert len({own.dynamics for own in found}) == 2


def test_results_say_to_which_ladder_they_belong():
    """Those without a hash of the dynamics are of before."""
    for name, own in FROZEN.items():
        assert ladder_of(name, own.sha256, own.dynamics) == LADDER
        assert ladder_of(name, own.sha256, "0" * 64) == f"other dynamics than {LADDER}"
        before = ladder_of(name, own.sha256, "")
        assert before.startswith(BEFORE)
        assert (before == BEFORE) == (name not in UNCHANGED)
        assert ladder_of(name, "0" * 64, "") == BEFORE
    assert ladder_of("mine", "0" * 64, "0" * 64) == ""
