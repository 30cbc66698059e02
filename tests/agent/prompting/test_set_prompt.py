"""The question for a task set: everything of the level, nothing of a world."""

import json
import math
import re

import gymnasium as gym
import pytest
import yaml

import tdac_envs
from tdac_agent.prompting.params_text import params_text
from tdac_agent.prompting.prompt import FULL, PromptError, PromptTemplate
from tdac_agent.prompting.rules import BEGIN, RuleBook
from tdac_agent.prompting.set_prompt import set_prompt
from tdac_agent.verification.judge.set_files import level_params
from tdac_envs import load_set
from tdac_envs.ladder.set_file import set_names
from tdac_envs.ladder.shown import in_shown_units

SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("barn", "barn-slow")]


@pytest.mark.parametrize("name", [*set_names(), *SLOW])
def test_a_prompt_has_all_of_its_level(name):
    """The table of observations is that of the environment, and so are the limits."""
    tasks = load_set(name)
    text, file = set_prompt(tasks, (), FULL), tasks.file
    env = gym.make("tdac_envs:TDAC-Ladder-v0", level=name, split="dev")
    rows = dict(re.findall(r"^\| `(\w+)` \| (\([\d, ]*\)) \|", text, re.MULTILINE))
    spaces = env.observation_space.spaces
    assert rows == {key: str(box.shape) for key, box in spaces.items()}
    ceil = 1.0 if file.shown_unit == "px" else 100.0
    limit = math.ceil(ceil * float(spaces["goal"].high[0]) - 1e-3) / ceil
    assert f"to {limit:g} |" in text or f"to {spaces['goal'].high[0]:g} |" in text
    params = text.partition("```json\n")[2].partition("\n```")[0]
    assert params == params_text(level_params(file))
    assert json.loads(params).keys() == level_params(file).keys()
    file = in_shown_units(file)
    for value in (file.bar, file.goal_tolerance, file.horizon.most, file.full_step):
        assert f"{value:g}" in text
    assert ("occupancy.npy" in text) == file.map
    assert ("start frame" in text) == (file.frame == "start")
    assert BEGIN in text
    assert "import sensors" not in text
    assert ("infra-red" in text) == ("ps" in file.observed)
    assert max(map(len, text.splitlines())) < 400


def test_worlds_from_files():
    """Nothing is promised that is only true of generated worlds."""
    for name, generated in (("unknown", True), ("barn", False)):
        text = set_prompt(load_set(name), (), FULL)
        assert ("The straight drive to" in text) == generated
        assert ("several kinds in turn" in text) == generated
        assert ("It is at least 60." in text) == generated
        assert ("whether there are dead ends, is not" in text) != generated


def test_disturbances_are_told_with_distribution_and_size(tmp_path):
    """Each that is set, and no other."""
    sizes = {
        "wheel_gains": 0.11,
        "wheel_slip": 0.12,
        "axle_error": 0.13,
        "range_noise": 0.14,
        "range_dropout": 0.15,
        "odometry_scale": 0.16,
        "odometry_noise": 0.17,
        "motor_lag": 0.18,
        "delay": 3,
        "wheel_radius_error": 0.19,
        "max_acceleration": 21.0,
        "range_min": 2.2,
        "pose_noise": 2.3,
        "heading_noise": 0.24,
        "pose_correlation": 2.5,
        "pose_jumps": 2.6,
        "pose_delay": 4,
        "scan_delay": 5,
        "message_drop": 0.27,
    }
    # Without a noise, they have no effect.
    needed = {key: {"pose_noise": 2.3} for key in ("pose_correlation", "pose_jumps")}
    told = {
        "wheel_gains": r"uniform in \[0.89, 1.11\]",
        "wheel_slip": "mean 1 and SD 0.24;",
        "axle_error": "uniform within ±0.13",
        "range_noise": "mean 1 and SD 0.14,",
        "range_dropout": "probability 0.15",
        "odometry_scale": "normal with SD 0.16",
        "odometry_noise": r"mean 1 and SD 0.17\.",
        "motor_lag": "time constant of 0.18 s",
        "delay": "3 steps late",
        "wheel_radius_error": "within ±0.19",
        "max_acceleration": "21 px/s², which is 0.525 px/s in a step",
        "range_min": "below 2.2 px read range_max",
        "pose_noise": "SD 2.3 px in x",
        "heading_noise": "0.24 rad of the heading",
        "pose_correlation": "correlated over 2.5 s",
        "pose_jumps": "2.6 in a minute",
        "pose_delay": "pose is 4 steps old",
        "scan_delay": "ranges are 5 steps old",
        "message_drop": "with probability 0.27,",
    }
    path = tmp_path / "own.yaml"
    for name, size in sizes.items():
        level = {
            "worlds": [{"name": "aisles"}],
            "dt": 0.025,  # the slip of a step of 0.1 s is half of that of such a step
            "observed": ["goal", "odometry", "pose", "ranges"],
            "disturbances": {**needed.get(name, {}), name: size},
        }
        path.write_text(yaml.safe_dump(level))
        text = set_prompt(load_set(path), (), FULL).partition("## Disturbances")[2]
        text = text.partition("## What the file")[0]
        found = [each for each, words in told.items() if re.search(words, text)]
        assert found == [*needed.get(name, ()), name]
    assert tdac_envs.load_set("known").file.disturbances.model_dump().keys() == (
        sizes.keys()
    )


def test_rules_and_templates(tmp_path):
    """A template of one's own knows the variables."""
    tasks = load_set("unknown")
    rules = RuleBook().add("keep off walls", "task", 1, ()).in_force
    assert "- keep off walls [R1]" in set_prompt(tasks, rules, FULL)
    own = PromptTemplate("own", "{{ name }} {{ file.bar }}\n{{ rules_block }}\n")
    assert set_prompt(tasks, (), own).startswith("unknown 0.95\n")
    with pytest.raises(PromptError, match=r"known names: .*disturbances"):
        set_prompt(tasks, (), PromptTemplate("own", "{{ robots }}{{ rules_block }}"))
