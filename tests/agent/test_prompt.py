"""The prompts: complete, and nothing in them that must stay hidden."""

import re

import pytest
from small import write_small_task

from tdac_agent import contract, hygiene
from tdac_agent.prompt import generate_prompt, repair_prompt
from tdac_agent.rules import add_rules
from tdac_agent.task import load_task, write_workdir
from tdac_agent.task_file import bundled_tasks
from tdac_agent.verification import verify
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.infrared import TABLE
from tdac_envs.map2d import Map2DEnv

CONTRACT = (
    *contract.CONSTANTS_2D,
    *("OccMap2D", "is_occupied", "nearest_free", "plan_path", "run_episode", "main"),
    *("positions", "speeds", "collisions", "goal", "dt", "sensors.show"),
)
EPUCK_CONTRACT = (
    *contract.CONSTANTS_EPUCK,
    *("parse_world", "build_grid", "astar", "compute_wheel_speeds", "run_episode"),
    *("start", "goal", "arena", "obstacles", "resolution", "inflation", "prox"),
    *("positions", "speeds", "collisions", "dt", "main", "sensors.show"),
)


@pytest.fixture
def prompt(small_task):
    return generate_prompt(small_task, ())


@pytest.fixture(scope="module")
def epuck_task():
    return load_task("epuck")


@pytest.fixture(scope="module")
def epuck_prompt(epuck_task):
    return generate_prompt(epuck_task, ())


@pytest.mark.parametrize(
    ("asked", "names"),
    [("prompt", CONTRACT), ("epuck_prompt", EPUCK_CONTRACT)],
    ids=["map2d", "epuck"],
)
def test_every_name_of_the_contract_is_in_the_prompt(asked, names, request):
    """No test needs what the prompt does not say."""
    prompt = request.getfixturevalue(asked)
    for name in (*names, *contract.ALLOWED_IMPORTS - {"__future__"}):
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


def test_nothing_is_left_undefined(prompt, epuck_prompt):
    """No template syntax and no Python default text is left over."""
    told = (prompt.partition("### sensors.py")[0], epuck_prompt)
    for text in ("{{", "}}", "{%", "Undefined", "<function", "/work", "/tmp"):
        assert not any(text in part for part in told), text
    assert " None" not in told[0]


def test_the_e_pucks_observations_come_from_its_environment(epuck_prompt):
    """What is observed by default is told in the manual's words, and nothing else."""
    manual = (EPuckEnv.__doc__ or "").splitlines()
    table = [line.strip() for line in manual if "| `" in line]
    assert any("`ps`" in line for line in table)
    for line in table:
        assert (line in epuck_prompt) == ("=True" not in line), line
    assert "ps0 to ps3 are on the robot's RIGHT" in epuck_prompt
    for distance, reading, _ in TABLE.tolist():
        assert f" {1e3 * distance:g} |" in epuck_prompt
        assert f" {reading:.0f} |" in epuck_prompt


def test_the_e_pucks_figures_are_those_of_the_task(tmp_path):
    """Clock, wheel limit, tolerance, horizon and progress limit of this very task."""
    (tmp_path / "task.yaml").write_text(
        "env: TDAC-EPuck-v0\nworld: crates\ntolerance: 0.0125\ndt: 0.016\n"
        "horizon: 4321\n"
    )
    task = load_task(tmp_path)
    text = generate_prompt(task, ())
    assert "`TIME_STEP` (16, in ms)" in text
    assert "`MAX_WHEEL_SPEED`\n   (6.28, rad/s)" in text
    assert "`GOAL_TOLERANCE` (0.0125, m)" in text
    assert "within 12.5 mm of the goal" in text
    assert "step of\n   0.016 s; a call may take 16 ms" in text
    for figure in (4321, task.progress_steps):
        assert f"within {figure} steps" in text


def test_the_world_is_in_the_prompt(epuck_prompt, epuck_task, tmp_path):
    """The whole file of a small world (Listing 2), the beginning of a large one."""
    write_workdir(tmp_path, epuck_task)
    assert (tmp_path / "world.wbt").read_text().rstrip() in epuck_prompt
    large = load_task("epuck-room")
    write_workdir(tmp_path, large)
    text, prompt = (tmp_path / "world.wbt").read_text(), generate_prompt(large, ())
    shown, mark, _ = prompt.rpartition("\n# ... ")
    assert mark
    shown = shown[shown.rindex("#VRML_SIM") :]
    assert text.startswith(shown)
    left_out = len(text) - len(shown)
    assert f"# ... {left_out} characters more: read the file" in prompt


def test_every_node_of_a_world_file_is_explained(tmp_path):
    """Whatever type stands in the files of the bundled worlds is named before."""
    for name in bundled_tasks():
        if not name.startswith("epuck"):
            continue
        task = load_task(name)
        write_workdir(tmp_path, task)
        head = generate_prompt(task, ()).partition("### params.json")[0]
        text = (tmp_path / "world.wbt").read_text()
        solid = re.sub(r"^  children \[.*?^  \]$", "", text, flags=re.M | re.S)
        for node in set(re.findall(r"([A-Z][\w-]*) \{", solid)):
            assert f"`{node}`" in head or f"{node} {{" in head, (name, node)


def test_profiles_of_the_e_puck(tmp_path):
    """The profile `policy` asks for `policy` alone."""
    (tmp_path / "task.yaml").write_text("env: TDAC-EPuck-v0\nprofile: policy\n")
    text = generate_prompt(load_task(tmp_path), ())
    assert "policy(obs)" in text
    for name in ("run_episode", "parse_world", "GOAL_TOLERANCE", "main()"):
        assert name not in text


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
@pytest.mark.parametrize("name", ["small_task", "epuck_task"])
def test_repair_prompts_hide_the_held_out_starts(name, kind, warm, request):
    """They hold the source and the failures, and no figure of a held-out start."""
    task = request.getfixturevalue(name)
    prompt = generate_prompt(task, ())
    source = "X = '{{ 1 }}'\n\n\ndef policy(obs):\n    return 0.6, 0.5\n"
    report = verify(source, task, profile="policy", judge=warm)
    text = repair_prompt(kind, prompt, source, report)
    assert source.strip() in text
    assert text.startswith(prompt)
    assert "jitter 3" not in text
    assert "test_no_collisions" in text
    assert "What happened: nominal: collision in step" in text
