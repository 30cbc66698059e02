"""`scripted:SCRIPT`: prepared controllers, drawn with a seed."""

import pytest
import yaml
from scipy.stats import binomtest

from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options, choose_model
from tdac_agent.models.provider import Request
from tdac_agent.prompting.extract import read_answer
from tdac_agent.prompting.rule_answer import parse_operations

A, B, C = (f"def policy(obs):\n    return 0.0, 0.{n}\n" for n in (1, 2, 3))


@pytest.fixture
def chosen(tmp_path, small_task):
    """Makes the provider for a script beside three files."""
    for name, source in (("a", A), ("b", B), ("c", C)):
        (tmp_path / f"{name}.py").write_text(source)

    def choose(**content):
        script = {"schema": 1, "generate": [{}], "edit": [{}]} | content
        file = tmp_path / "script.yaml"
        file.write_text(yaml.safe_dump(script))
        return choose_model(f"scripted:{file}", Options(small_task.setting))

    return choose


def answered(model, run=0, k=1, j=0, kind="generate"):
    reply = model.complete(Request(kind, "?", sample=(run, k, j)))
    return read_answer(reply.text, ("policy",)).source


def files(*names, **weights):
    return [{"file": f"{n}.py", "weight": weights.get(n, 1)} for n in names]


def test_equal_questions_of_a_run_get_equal_answers_in_every_process(chosen):
    """That is what makes a killed run the same as one that nobody disturbed."""
    places = [(run, k, j) for run in range(5) for k in range(1, 5) for j in range(2)]
    script = {"generate": files("a", "b", "c"), "edit": files("a", "b")}
    one, two = ([answered(chosen(**script), *at) for at in places] for _ in range(2))
    assert one == two
    other = [answered(chosen(**script, seed=1), *at) for at in places]
    assert other != one


def test_another_task_has_other_draws(chosen):
    """What is the same in all questions of a run tells tasks apart."""
    model = chosen(generate=files("a", "b"))

    def first_ones(task):
        asked = (
            Request("generate", task, sample=(r, 1, 0), stable=4) for r in range(40)
        )
        return [model.complete(request).text for request in asked]

    assert first_ones("maze ...") == first_ones("maze ,,,")
    assert first_ones("maze") != first_ones("epuc")


def test_controllers_are_drawn_by_their_weights(chosen):
    """3 to 1 over 400 runs, by an exact test."""
    model = chosen(generate=files("a", "b", a=3))
    hits = sum(answered(model, run) == A for run in range(400))
    assert binomtest(hits, 400, 0.75).pvalue > 1e-3


def test_without_draws_the_kth_is_for_iteration_k(chosen):
    model = chosen(generate=files("a", "b"), edit=files("c"), drawn=False)
    assert [answered(model, k=k) for k in (1, 2, 3)] == [A, B, B]
    assert answered(model, k=2, j=1, kind="edit") == C


def test_it_is_called_scripted_costs_nothing_and_gives_no_rules(chosen):
    model = chosen()
    assert model.name.startswith("scripted:")
    assert not model.paid
    reply = model.complete(Request("summarise", "?"))
    assert parse_operations(reply.text) == []
    assert (reply.tokens_in, reply.tokens_out) == (0, 0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"generate": [{"file": "d.py"}]}, "d.py: No such file"),
        ({"generate": [{"parameters": {"cruise": 1}}]}, "did you mean 'cruise_speed'"),
        ({"generate": [{"file": "a.py", "parameters": {"x": 1}}]}, "a file or"),
        (
            {"generate": [{"weight": 0}]},
            "generate.0.weight: .*expected more than 0, got 0",
        ),
        ({"edit": []}, "edit: .*expected at least 1 of them"),
        ({"speed": 1}, "speed: unknown key"),
    ],
)
def test_a_wrong_script_is_refused_in_a_line(content, message, chosen):
    with pytest.raises(ProviderError, match=message) as caught:
        chosen(**content)
    assert "\n" not in str(caught.value)
