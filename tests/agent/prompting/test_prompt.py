"""The prompts: complete, and nothing in them that must stay hidden."""

import inspect
import re

import numpy as np
import pytest
from gymnasium import spaces
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.environments.map2d.entry import MAP2D
from tdac_agent.prompting.context import contract_of
from tdac_agent.prompting.feedback import render_feedback
from tdac_agent.prompting.manual import ManualError, interface_of
from tdac_agent.prompting.prompt import (
    PromptError,
    PromptTemplate,
    generate_prompt,
    load_template,
    repair_question,
)
from tdac_agent.prompting.rules import BEGIN, RuleBook
from tdac_agent.tasks.task import SENSORS_FILE, write_workdir
from tdac_agent.tasks.task_file import bundled_tasks
from tdac_agent.verification.suite import contract, hygiene
from tdac_agent.verification.verify import verify
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.infrared import TABLE

CONTRACT = (
    *MAP2D.names.constants,
    *("OccMap2D", "is_occupied", "nearest_free", "plan_path", "run_episode", "main"),
    *("positions", "speeds", "collisions", "goal", "dt", "sensors.show"),
)
EPUCK_CONTRACT = (
    *EPUCK.names.constants,
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
    forbidden = hygiene.FORBIDDEN_CALLS | hygiene.FORBIDDEN_ATTRIBUTES
    for call in forbidden | hygiene.SAVERS | hygiene.SURFACES:
        assert re.search(rf"\b{call}\b", prompt), call


ROW = re.compile(r"^\| `(\w+)` \| (.*) \|$", re.M)


def cells(row):
    return [cell.strip() for cell in row.split("|")]


@pytest.mark.parametrize("name", ["small_task", "epuck_task"])
def test_the_tables_come_from_the_environment(name, request):
    """Keys, shapes and limits are those of the spaces, words those of the manual."""
    task = request.getfixturevalue(name)
    env = task.make_env()
    told = {key: cells(row) for key, row in ROW.findall(generate_prompt(task, ()))}
    manual = {
        key: cells(row)
        for key, row in ROW.findall(inspect.cleandoc(type(env).__doc__ or ""))
    }
    assert set(told) == set(env.observation_space.keys())
    for key, (shape, limits, *words) in told.items():
        box = env.observation_space[key]
        assert shape == str(box.shape)
        low, high = (
            np.broadcast_to(np.array(re.findall(r"-?[\d.e+]+", text), float), box.shape)
            for text in limits.split(" to ")
        )
        np.testing.assert_allclose(low, box.low, rtol=1e-3)
        np.testing.assert_allclose(high, box.high, rtol=1e-3)
        assert words == manual[key][1:]


def test_a_manual_that_has_drifted_is_refused(small_task):
    """A key without words, or words about another action, never reach a prompt."""
    env = small_task.make_env()
    keys, action = env.observation_space, env.action_space
    env.observation_space = spaces.Dict({**keys.spaces, "smell": action})
    with pytest.raises(ManualError, match="no row for smell"):
        interface_of(env)
    env.observation_space = keys
    env.action_space = spaces.Box(-2, 2, (2,), np.float32)
    with pytest.raises(ManualError, match=r"Action Space must begin with `Box\(-2, 2"):
        interface_of(env)


def test_the_figures_are_those_of_the_task(prompt, small_task):
    """Horizon, tolerance, radius and progress limit of this very task."""
    nominal = small_task.nominal
    for figure in (nominal.horizon, small_task.progress_steps):
        assert f"within {figure} steps" in prompt
    assert f"{nominal.goal_tolerance:.1f} px\n  (" in prompt
    assert f"({nominal.goal_tolerance / 6.0:.1f} radii) of the goal" in prompt
    assert "disc of\n  6 px radius" in prompt
    robot = small_task.params.robot.model_dump_json(indent=2).removesuffix("\n}")
    assert robot.replace("\n", "\n  ") in prompt
    assert '"ray_angles": [' in prompt


def test_nothing_is_left_undefined(prompt, epuck_prompt):
    """No template syntax and no Python default text is left over."""
    told = (prompt.partition("### sensors.py")[0], epuck_prompt)
    for text in ("{{", "}}", "{%", "Undefined", "<function", "/work", "/tmp"):
        assert not any(text in part for part in told), text
    assert " None" not in told[0]


def test_the_e_pucks_observations_come_from_its_environment(epuck_prompt):
    """What is observed by default is told in the manual's words, and nothing else."""
    manual = (EPuckEnv.__doc__ or "").partition("## Rewards")[0].splitlines()
    table = [line.strip() for line in manual if "| `" in line]
    assert any("`ps`" in line for line in table)
    for line in table:
        words = line.strip("| ").rpartition("| ")[2]
        assert (words in epuck_prompt) == ("=True" not in line), line
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
    assert "within 12.5 mm\n  (0.3 radii) of the goal" in text
    assert "step of\n   0.016 s. " in text
    assert "`policy` 16 ms on average" in text
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
    before, block, _ = generate_prompt(task, ()).partition("\n\n## Rules learnt")
    assert block
    assert before.endswith("\n## Further instructions from the user\nKeep LEFT. {{x}}")
    assert "Further instructions" not in prompt


def test_rules_are_in_the_block(small_task):
    """The rules in force stand between the markers."""
    book = RuleBook().add("slow down near walls", "task", 1, ())
    text = generate_prompt(small_task, book.in_force)
    block = text.partition("AUTO_REPAIR_RULES_BEGIN")[2]
    assert "- slow down near walls" in block.partition("AUTO_REPAIR_RULES_END")[0]


def test_what_changes_comes_last(small_task, epuck_task, warm):
    """All prompts of a run begin alike, up to the rules: a provider can keep that."""
    book = RuleBook().add("slow down near walls", "task", 1, ())
    for task in (small_task, epuck_task):
        first = generate_prompt(task, ())
        stable = first.partition(BEGIN)[0]
        assert len(stable) > 0.95 * len(first)
        later = generate_prompt(task, book.in_force)
        assert later.startswith(stable)
    report = verify("def policy(obs):\n    return 1, 1\n", small_task, judge=warm)
    first = generate_prompt(small_task, ())
    stable = first.partition(BEGIN)[0]
    assert repair_question("edit", first, "x = 1", render_feedback(report)).startswith(
        stable
    )


def test_the_summariser_reads_first_that_no_file_is_wanted(small_task, warm):
    """Else the question that it quotes would ask it for a controller."""
    report = verify("def policy(obs):\n    return 1, 1\n", small_task, judge=warm)
    first = generate_prompt(small_task, ())
    text = repair_question("summarise", first, "x = 1", render_feedback(report))
    preface, _, rest = text.partition(first)
    assert "not\na Python file" in preface
    assert "exactly one fenced ```json block" in rest


def test_the_narrowest_passage_is_told(prompt):
    """On the route with most room: here a gap of 39 px for a disc of 6 px."""
    (room,) = re.findall(r"route from start to goal has ([\d.]+) px", prompt)
    assert float(room) == pytest.approx(39 / 2, abs=1.0)
    (margin,) = re.findall(r"below ([\d.]+) px of margin", prompt)
    assert float(margin) == pytest.approx(float(room) - 6, abs=0.11)


def test_only_what_concerns_the_task_is_shown(prompt, small_task):
    """Nothing of how the map was made, nor of how `sensors.py` draws."""
    assert "score_terms" not in prompt
    assert "pygame" not in prompt.partition("class Graphics")[0]
    shown = prompt.partition('```python\n"""Map')[2].partition("```\n")[0]
    own = SENSORS_FILE.read_text(encoding="utf-8")
    assert shown.count("\n") < 0.5 * own.count("\n")
    for line in shown.splitlines()[1:]:
        assert line.strip() in ("", "...") or line in own
    for name in ("load_occupancy", "load_params", "Ultrasonic", "Graphics", "show"):
        assert re.search(rf"^(def|class) {name}\b", shown, re.M), name


@pytest.mark.parametrize("name", ["small_task", "epuck_task"])
def test_the_underspecified_prompt(name, request):
    """The goal and the interface, names and types; no figures, tests or advice."""
    task = request.getfixturevalue(name)
    text = generate_prompt(task, (), load_template("underspecified"))
    names = task.environment.names
    for word in (*names.constants, *names.functions, *names.classes, "policy(obs)"):
        assert word in text
    assert text.count(BEGIN) == 1
    full = generate_prompt(task, ())
    assert len(text) < 0.4 * len(full)
    for word in (
        "## Advice",
        "## What is tested",
        "within ",
        "1.1",
        "### params.json",
    ):
        assert word in full
        assert word not in text


def test_a_template_of_ones_own(small_task, tmp_path):
    """A file may use every name, and parts of the shipped templates."""
    file = tmp_path / "mine.j2"
    file.write_text(
        "Steps: {{ horizon }}\n{% include 'answer.md.j2' %}\n{{ rules_block }}\n"
    )
    text = generate_prompt(small_task, (), load_template(str(file)))
    assert text.startswith(f"Steps: {small_task.nominal.horizon}\n## Answer\n")
    assert text.count(BEGIN) == 1


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("{{ horizonn }} {{ rules_block }}", "'horizonn' is undefined; known names: "),
        ("a\n{% if %}", "line 2: Expected an expression"),
        ("{% include 'x.j2' %}", "includes 'x.j2', which does not exist"),
        ("Drive!", "must contain {{ rules_block }} once"),
        ("{{ rules_block }}{{ rules_block }}", "must contain {{ rules_block }} once"),
        ("{{ horizon / 0 }}{{ rules_block }}", "division by zero"),
    ],
)
def test_a_broken_template_is_refused(small_task, text, problem):
    """One line says what is wrong with it."""
    with pytest.raises(PromptError, match=re.escape(problem)) as caught:
        generate_prompt(small_task, (), PromptTemplate("mine.j2", text))
    assert "mine.j2" in str(caught.value)


def test_a_template_that_is_not_there(tmp_path):
    """A wrong name is told with the names that there are."""
    with pytest.raises(PromptError, match=r"no prompt 'ful'.*expected a template file"):
        load_template("ful")
    (tmp_path / "x.j2").write_bytes(b"\xff")
    with pytest.raises(PromptError, match="not UTF-8 text"):
        load_template(str(tmp_path / "x.j2"))


def test_repair_prompts_tell_earlier_attempts_and_rules(small_task, warm):
    """The attempts before this one, and to the summariser what came of each rule."""
    book = RuleBook().add("slow down near walls", "task", 1, ("test_x",))
    book = book.observed(("test_x",), 0)
    report = verify("def policy(obs):\n    return 1, 1\n", small_task, judge=warm)
    prompt = generate_prompt(small_task, book.in_force)
    feedback = render_feedback(report)
    texts = {
        kind: repair_question(
            kind,
            prompt,
            "x = 1",
            feedback,
            earlier=("k=1 j=0: 3",),
            rules=book.in_force,
        )
        for kind in ("edit", "summarise")
    }
    for text in texts.values():
        assert "## Earlier attempts, oldest first\n- k=1 j=0: 3\n" in text
    effect = "cured 0 of 1 test; more tests failed than before"
    line = f"- R1 (task, since k=1; {effect}): slow down near walls\n"
    assert line in texts["summarise"]
    assert line not in texts["edit"]
    assert "test_x" not in texts["summarise"]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("kind", ["edit", "summarise"])
@pytest.mark.parametrize("name", ["small_task", "epuck_task"])
def test_repair_prompts_hide_the_held_out_starts(name, kind, warm, request):
    """They hold the source and the failures, and no figure of a held-out start."""
    task = request.getfixturevalue(name)
    prompt = generate_prompt(task, ())
    source = "X = '{{ 1 }}'\n\n\ndef policy(obs):\n    return 0.6, 0.5\n"
    report = verify(source, task, profile="policy", judge=warm)
    text = repair_question(kind, prompt, source, render_feedback(report))
    assert source.strip() in text
    assert prompt in text
    assert "jitter 3" not in text
    assert "test_no_collisions" in text
    assert "What happened: nominal: collision in step" in text


def test_the_contract_names_what_a_controller_defines(small_task):
    """For the profile `paper` what the environment lists, else `policy` alone."""
    names = contract_of(small_task.with_profile("paper"))
    assert names[0] == "policy"
    assert {"plan_path", "OccMap2D", "N_RAYS", "run_episode", "main"} < {*names}
    assert contract_of(small_task.with_profile("policy")) == ("policy",)
