"""Which runs a campaign has, and what they are called."""

from itertools import chain
from pathlib import Path

import pytest
import yaml
from small import write_small_task

from tdac_agent.campaign.config import CampaignError, find_config, read_config
from tdac_agent.campaign.plan import PlannedRun, Shard, loop_of, make_plan
from tdac_agent.models.provider import MAX_OUTPUT_TOKENS
from tdac_agent.runs.run_record import Run, setting_of
from tdac_agent.storage.shipped import shipped_names


@pytest.fixture
def written(tmp_path):
    """Writes a campaign on the small task; gives its file."""
    write_small_task(tmp_path / "small")

    def write(**changes):
        content = {
            "schema": 1,
            "name": "few",
            "tasks": ["small"],
            "learners": ["builtin", "scripted:weak"],
            "runs": 3,
        }
        file = tmp_path / "few.yaml"
        file.write_text(yaml.safe_dump(content | changes))
        return file

    return write


def planned(file):
    return make_plan(read_config(file), file.parent)


@pytest.mark.slow
def test_runs_have_the_same_names_whenever_they_are_planned(written):
    """Another R adds runs; whatever else is changed gives other runs."""
    names = [run.name for run in planned(written()).all()]
    assert len(set(names)) == len(names) == 6
    assert [run.name for run in planned(written()).all()] == names
    more = [run.name for run in planned(written(runs=4)).all()]
    assert more[:6] == names
    changes = [{"iterations": 4}, {"patience": 2}, {"seed": 1}, {"max_output": 99}]
    for change in [*changes, {"settings": ["edit only"]}, {"optimizers": ["builtin"]}]:
        first = next(iter(planned(written(**change, learners=["scripted:weak"])).all()))
        assert first.name not in names, change


def test_a_changed_task_gives_other_runs(written, tmp_path):
    before = planned(written()).cells[0].folder
    write_small_task(tmp_path / "small", horizon=401)
    assert planned(written()).cells[0].folder != before


def test_a_changed_script_gives_other_runs(written, tmp_path):
    """Also where it is a controller that was changed, which the script but names."""
    script, controller = tmp_path / "own.yaml", tmp_path / "own.py"
    choices = [{"file": "own.py"}]
    names = []
    for seed, source in ((0, "A = 1"), (1, "A = 1"), (1, "A = 2"), (0, "A = 1")):
        content = {"schema": 1, "seed": seed, "generate": choices, "edit": choices}
        script.write_text(yaml.safe_dump(content))
        controller.write_text(source)
        (cell,) = planned(written(learners=[f"scripted:{script}"])).cells
        names.append(cell.folder)
    assert names[0] == names[3]
    assert len(set(names)) == 3


def test_all_kinds_have_their_first_run_before_any_has_its_second(written):
    """What there is of a stopped campaign is of all kinds alike; seeds are paired."""
    runs = list(planned(written(seed=5)).all())
    assert [run.index for run in runs] == [1, 1, 2, 2, 3, 3]
    assert [run.seed for run in runs] == [5, 5, 6, 6, 7, 7]


@pytest.mark.parametrize("n", [1, 2, 4, 9])
def test_shards_are_all_runs_and_no_run_twice(n, written):
    plan = planned(written())
    parts = [[r.name for r in plan.all(Shard(i, n))] for i in range(1, n + 1)]
    assert sorted(chain(*parts)) == sorted(run.name for run in plan.all())
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_a_planned_run_reaches_another_process_as_it_is(written):
    for run in planned(written()).all():
        assert PlannedRun.from_json(run.to_json()) == run


@pytest.mark.parametrize(
    ("setting", "loop"),
    [
        ("dual tier", (20, 2, True)),
        ("edit only", (20, 2, False)),
        ("prompt only", (20, 0, True)),
        ("best of N", (80, 0, False)),
        ("one shot", (1, 0, False)),
    ],
)
def test_a_setting_is_a_loop_and_the_loop_tells_the_setting(setting, loop, written):
    """`best of N` may have as many answers as the dual tier: K·(J + 2)."""
    assert loop_of(read_config(written(patience=2)), setting) == loop
    assert setting_of(loop[0], loop[1], refine=loop[2]) == setting


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"runs": 0}, r"few.yaml: runs: expected at least 1, got 0 \(R: runs of each"),
        ({"runz": 3}, r"few.yaml: runz: unknown key \(did you mean 'runs'\?\)"),
        ({"R": 3}, r"few.yaml: R: unknown key \(did you mean 'runs'\?\); known: runs,"),
        ({"refine": True}, "few.yaml: refine: unknown key; known: .*settings, "),
        ({"patience": 0}, "expected at least 1, got 0 .*`prompt only`.*`one shot`"),
        ({"settings": ["agent"]}, "settings.0: Input should be 'dual tier'"),
        ({"learners": ["nosuch"]}, "unknown model 'nosuch'; known: builtin"),
        ({"tasks": ["small", "small"]}, "tasks: 'small' is listed twice"),
        ({"learners": ["manual:here"]}, "for one run, not for a campaign"),
        ({"learners": ["openai:gpt-6-sol"]}, "max_cost: required for openai:gpt-6-sol"),
        ({"settings": ["two tier"]}, "settings.0: Input should be 'dual tier'"),
        ({"name": "../up"}, "name: String should match"),
    ],
)
def test_a_wrong_file_is_refused_in_a_line(changes, message, written):
    with pytest.raises(CampaignError, match=message) as caught:
        read_config(written(**changes))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("learner", "base_url", "needed"),
    [
        ("openai:qwen3", "http://localhost:11434/v1", False),
        ("openai:qwen3", "http://10.0.0.2:8000/v1", True),
        ("anthropic:claude-sonnet-5-5", None, True),
    ],
)
def test_only_what_may_cost_money_needs_a_limit(
    learner, base_url, needed, written, monkeypatch
):
    """A model on a server of this machine is free, as `builtin` is."""
    monkeypatch.delenv("ANTHROPIC_BASE_URL", raising=False)
    file = written(learners=["builtin", learner], base_url=base_url)
    if needed:
        with pytest.raises(CampaignError, match=f"max_cost: required for {learner}"):
            read_config(file)
    else:
        assert read_config(file).max_cost is None


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "1/", "a/b", "1/2/3"])
def test_a_wrong_shard_is_refused(text):
    with pytest.raises(CampaignError, match="as in 1/4"):
        Shard.parse(text)


def test_an_unknown_campaign_names_those_that_are_shipped():
    with pytest.raises(
        CampaignError, match="or ablation, loop_vs_sampling, models_2026"
    ):
        find_config("offlin")


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", shipped_names("*.yaml"))
def test_shipped_campaigns_can_be_planned(name):
    """All but the offline one have the paper's K and J, and a limit of money."""
    file = find_config(Path(name).stem)
    config = read_config(file)
    plan = make_plan(config, file.parent)
    assert len(plan) == len(list(plan.all())) == config.runs * len(plan.cells)
    on_tasks = (20, 1) if config.tasks else (8, 1)
    assert (config.iterations, config.patience) == on_tasks
    assert config.max_output == MAX_OUTPUT_TOKENS
    assert (config.max_cost is None) == (name == "offline.yaml")


@pytest.mark.parametrize(("name", "first"), [("race", 4), ("first answers", 20)])
def test_settings_of_a_race(name, first, written):
    """All of its answers, and whether questions follow the first ones."""
    iterations, patience, refine = loop_of(read_config(written()), name)
    loop = {"iterations": iterations, "patience": patience, "refine": refine}
    run = Run.model_construct(search="race", candidates=first, learner="m", **loop)
    assert run.setting == name
