"""The prompts: complete, and nothing in them that must stay hidden."""

import re

import pytest
from small import write_small_task

from tdac_agent import contract, hygiene
from tdac_agent.prompt import generate_prompt, repair_prompt
from tdac_agent.rules import add_rules
from tdac_agent.task import load_task
from tdac_agent.verification import verify
from tdac_envs.map2d import Map2DEnv

CONTRACT = (
    *contract.CONSTANTS_2D,
    *("OccMap2D", "is_occupied", "nearest_free", "plan_path", "run_episode", "main"),
    *("positions", "speeds", "collisions", "goal", "dt", "sensors.show"),
)


@pytest.fixture
def prompt(small_task):
    return generate_prompt(small_task, ())


def test_every_name_of_the_contract_is_in_the_prompt(prompt):
    """No test needs what the prompt does not say."""
    for name in (*CONTRACT, *contract.ALLOWED_IMPORTS - {"__future__"}):
        assert re.search(rf"\b{re.escape(name)}\b", prompt), name
    for call in hygiene.FORBIDDEN_CALLS | hygiene.FORBIDDEN_ATTRIBUTES:
        assert re.search(rf"\b{call}\b", prompt), call


def test_the_tables_come_from_the_environment(prompt):
    """Observations and actions are told in the words of the environment's manual."""
    table = [line for line in (Map2DEnv.__doc__ or "").splitlines() if "| `" in line]
    assert table
    for line in table:
        assert line.strip() in prompt


def test_the_figures_are_those_of_the_task(prompt, small_task):
    """Horizon, tolerance, radius and progress limit of this very task."""
    nominal = small_task.nominal
    for figure in (nominal.horizon, small_task.progress_steps):
        assert f"within {figure} steps" in prompt
    assert f"{nominal.goal_tolerance:.1f} px of the" in prompt
    assert "disc of\n  6 px radius" in prompt
    assert small_task.params.model_dump_json(indent=2) in prompt


def test_nothing_is_left_undefined(prompt):
    """No template syntax and no Python default text is left over."""
    for text in ("{{", "}}", "{%", "Undefined", "<function", " None", "/work", "/tmp"):
        before_sensors = prompt.partition("### sensors.py")[0]
        assert text not in before_sensors, text


def test_profiles(tmp_path):
    """The profile `policy` asks for `policy` alone."""
    task = load_task(write_small_task(tmp_path / "t", profile="policy"))
    head = generate_prompt(task, ()).partition("### sensors.py")[0]
    assert "policy(obs)" in head
    for name in ("run_episode", "OccMap2D", "LOOKAHEAD", "main()"):
        assert name not in head


def test_the_users_instructions_are_passed_on(tmp_path, prompt):
    """They stand at the end under a heading of their own, or not at all."""
    task = load_task(write_small_task(tmp_path / "t", instructions="Keep LEFT. {{x}}"))
    tail = generate_prompt(task, ())[-200:]
    assert "## Further instructions from the user\nKeep LEFT. {{x}}" in tail
    assert "Further instructions" not in prompt


def test_rules_are_in_the_block(small_task):
    """The rules in force stand between the markers."""
    rules = add_rules((), ["slow down near walls"], 1, ())
    text = generate_prompt(small_task, rules)
    block = text.partition("AUTO_REPAIR_RULES_BEGIN")[2]
    assert "- slow down near walls" in block.partition("AUTO_REPAIR_RULES_END")[0]


@pytest.mark.parametrize("kind", ["edit", "summarise"])
def test_repair_prompts_hide_the_held_out_starts(small_task, prompt, kind, warm):
    """They hold the source and the failures, and no figure of a held-out start."""
    source = "X = '{{ 1 }}'\n\n\ndef policy(obs):\n    return 0.6, 0.5\n"
    report = verify(source, small_task, profile="policy", judge=warm)
    text = repair_prompt(kind, prompt, source, report)
    assert source.strip() in text
    assert text.startswith(prompt)
    assert "jitter 3" not in text
    assert "test_no_collisions" in text
