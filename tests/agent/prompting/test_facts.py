"""The question that is made of facts: it tells them, and withholds what it omits."""

import functools
import json
import re

import pytest

from tdac_agent.prompting.fact_context import KEYS, ROBOT_KEYS, fact_context
from tdac_agent.prompting.facts import FACTS, WORDINGS, FactsPrompt, with_omitted
from tdac_agent.prompting.prompt import PromptTemplate, load_template
from tdac_agent.prompting.rules import BEGIN
from tdac_agent.prompting.set_prompt import set_context, set_prompt
from tdac_agent.verification.judge.set_files import level_params
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.set_file import set_names

# Worlds of BARN take seconds to read.
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("barn", "barn-slow")]
SETS = (*set_names(), *SLOW)
UNIT = (
    r"\bpx\b|\d m\b|\bm\b/s|\bmm\b|\bin m\b|[Pp]ixel|\brad\b|\bradian|\bmet(re|er)s?\b"
)
WORDS = {
    "turning": r"clockwise|faster|[Pp]ositive turn",
    "axes": r"\b[xy].axis|\bframe\b|\borigin\b|occupancy\[|\(0, 0\) with",
    "units": rf"{UNIT}|-pi|encoders. show the",
    "radius": r"body is a disc|along the whole arc",
    "speed": r"\bdt\b|max_wheel_speed|inertia|scaled down|\) / 2",
    "axle": r"axle_length|on the spot|rims",
    "rays": r"\bdegrees?\b|field_of_view|ray_angles|n_rays|\bps0\b",
    "range": r"range_max|range_min|[Ss]canner|sensor_range",
    "tolerance": r"\b[Hh]orizon|goal_tolerance|\bsucceeds as",
    "disturbances": r"[Nn]oise|[Hh]idden|[Ss]lip|[Dd]elay|\bSD\b|without delay",
    "budget": r"\bCPU\b|\bcpu\b|\bGB\b",
    "worlds": r"dead ends|passage|moves|ORCA|[Pp]lates|resolution|occupied cells",
    "score": r"\bOT\b|success rate|verified if",
}
"""Words that only the text of one fact has."""
CONTRACT = (
    *("differential-drive robot to a goal", "without touching anything"),
    *("Exactly one fenced ```python block", "`policy(obs) -> (left, right)`"),
    *("in [-1, 1]", "`reset(obs)`", "Imports at the top level only, from: bisect"),
    *("__subclasses__", "`sleep`", "random.Random(seed)", "`params.json`", BEGIN),
    *("There is nothing else to observe", "there is no network"),
)


def question(tasks, kind="facts", omitted=()):
    return set_prompt(tasks, (), PromptTemplate(FactsPrompt(kind, omitted).name))


def numbers(*values, digits=6):
    return {f"{value:.{digits}g}" for value in values if value}


def figures(tasks):
    """The figures and names of each fact, from the set."""
    context = set_context(tasks) | fact_context(tasks, FactsPrompt("facts"))
    file, robot, d = context["file"], context["robot"], context["d"]
    found = {fact: set() for fact in FACTS}
    found["radius"] = numbers(robot.radius)
    found["speed"] = numbers(file.dt, robot.max_wheel_speed, context["full_step"])
    found["tolerance"] = numbers(file.goal_tolerance, file.horizon.most)
    if file.horizon.least < file.horizon.most:
        found["tolerance"] |= numbers(file.horizon.factor, file.horizon.least)
    cpu = file.cpu
    found["budget"] = numbers(cpu.start, cpu.step, cpu.bank, 1000 * cpu.step)
    found["budget"] |= {context["memory"], context["wall_seconds"]}
    found["score"] = numbers(file.bar, 100 * file.most_contacts)
    if not context["found"]:
        found["score"] |= numbers(file.admission.steps)
        found["worlds"] |= numbers(file.admission.gap)
    for group in file.movers:
        found["worlds"] |= numbers(*group.count, *group.radius, *group.speed)
    gains = (1 - d["wheel_gains"], 1 + d["wheel_gains"]) if d["wheel_gains"] else ()
    found["disturbances"] = numbers(*gains) | numbers(d["slip"], digits=3)
    others = set(d) - {"wheel_gains", "wheel_slip", "slip", "sensor_noise"}
    found["disturbances"] |= numbers(*(d[name] for name in others))
    found["axle"] = numbers(context["turn"], digits=3)
    return _of_epuck(found, context) if file.is_epuck else _on_maps(found, context)


def _on_maps(found, context):
    file, robot = context["file"], context["robot"]
    fan, scanner = context["fan"], context["scanner"] or {"ahead": 0.0, "aside": 0.0}
    found["axle"] |= numbers(robot.axle_length)
    found["speed"] |= numbers(
        *(robot.max_speed, robot.max_turn_rate, robot.max_acceleration),
        *(robot.max_turn_acceleration, robot.stopping_distance),
    )
    ends = [fan[end] for end in ("first", "last") if fan[f"{end}_side"]]
    found["rays"] = numbers(*ends, fan["step"], digits=4)
    found["rays"] |= numbers(robot.field_of_view_deg)
    place = abs(scanner["ahead"]), scanner["aside"]
    found["range"] = numbers(robot.range_max, robot.range_min, *place)
    found["worlds"] |= numbers(context["side"], file.resolution)
    found["worlds"] |= {each.name for each in file.worlds}
    return found


def _of_epuck(found, context):
    sizes, d = context["sizes"], context["d"]
    found["units"] = numbers(context["encoder_step"])
    found["speed"] |= numbers(sizes["wheel_radius"])
    found["axle"] |= numbers(sizes["axle_length"], context["joint_distance"])
    for each in context["sensors"]:
        found["rays"] |= numbers(abs(each["ahead"]), each["aside"])
        found["rays"] |= numbers(each["degrees"], digits=4)
    found["rays"] |= numbers(context["rise"], digits=4)
    found["range"] = numbers(context["largest"], context["ray_length"])
    for row in context["readings"]:
        found["range"] |= numbers(row["distance"], row["reading"])
        found["disturbances"] |= numbers(d["sensor_noise"] * row["spread"], digits=2)
        found["disturbances"] |= numbers(row["distance"])
    found["worlds"] |= numbers(*context["box_sides"], *context["cylinder_radii"])
    for text in (context["sides"], context["passages"]):
        found["worlds"] |= set(text.split(" to "))
    return found


def in_text(figure, text):
    return re.search(rf"(?<![\w.]){re.escape(figure)}(?!\w|\.\d)", text) is not None


def own_figures(tasks):
    """The figures that only one fact has, and that the contract has not."""
    found, bare = figures(tasks), question(tasks, omitted=FACTS)
    written = tasks.file.disturbances.model_dump()  # so in params.json
    others = {
        **found,
        "disturbances": found["disturbances"] | numbers(*written.values()),
    }
    return {
        fact: {
            each
            for each in found[fact]
            if not any(each in others[other] for other in FACTS if other != fact)
            and not in_text(each, bare)
        }
        for fact in FACTS
    }


def with_odd_figures(name, path):
    """A shipped set in which every figure differs from all others."""
    values = load_set(name).file.model_dump(mode="json", by_alias=True)
    count = iter(range(1, 1000))

    def odd(value):
        if isinstance(value, bool) or not value:
            return value
        if isinstance(value, float):
            return float(f"{value * (1 + 0.00317 * next(count)):.5g}")
        if isinstance(value, int):
            return value + 2 * next(count) + 1
        if isinstance(value, list):
            return [odd(each) for each in value]
        if isinstance(value, dict):
            return {key: odd(each) for key, each in value.items()}
        return value

    fixed = {"epuck": ("max_wheel_speed",), "floor": ("field_of_view_deg",)}
    left_alone = ("n_rays", "ray_angles", *fixed.get(name, ()))
    values["robot"] = {
        key: own if key in left_alone else odd(own)
        for key, own in values["robot"].items()
    }
    for key in ("goal_tolerance", "dt", "movers", "disturbances", "bar", "cpu"):
        values[key] = odd(values[key])
    values["horizon"] = odd(values["horizon"])
    values["admission"] = odd({**values["admission"], "tries": 0}) | {"tries": 200}
    values["most_contacts"] = 0.0573
    path.write_text(json.dumps(values))
    return load_set(path)


@functools.cache
def shipped(name):
    return load_set(name)


def check(tasks, kind, own):
    """All figures are told; those of an omitted fact are not, nor are its words."""
    found, text = figures(tasks), question(tasks, kind)
    for fact in FACTS:
        missing = {each for each in found[fact] if not in_text(each, text)}
        assert not missing, (fact, missing)
    for fact in FACTS:
        text = question(tasks, kind, (fact,))
        told = {each for each in own[fact] if in_text(each, text)}
        assert not told, (fact, told)
        word = re.search(WORDS[fact], text)
        assert word is None, (fact, text[word.start() - 60 : word.end() + 60])
        for other in FACTS:
            lost = {each for each in own[other] if not in_text(each, text)}
            assert fact == other or not lost, (fact, other, lost)
        assert all(words in text for words in CONTRACT)


@pytest.mark.parametrize("kind", WORDINGS)
@pytest.mark.parametrize("name", SETS)
def test_what_a_question_omits_is_nowhere_in_it(name, kind):
    """On each shipped set, in both wordings."""
    tasks = shipped(name)
    check(tasks, kind, own_figures(tasks))


@pytest.mark.parametrize(
    "name", ["unknown", "lost", "moving", "crowd", "floor", "epuck"]
)
def test_no_figure_is_told_twice(name, tmp_path):
    """With figures that all differ, those of each fact are in it alone."""
    tasks = with_odd_figures(name, tmp_path / "odd.yaml")
    found, own = figures(tasks), own_figures(tasks)
    shared = set().union(*(found[fact] - own[fact] for fact in FACTS))
    # The sensors of an e-puck are what they are, and so is a scan all around.
    assert name == "epuck" or shared <= ({"1", "360"} if name == "floor" else set())
    for kind in WORDINGS:
        check(tasks, kind, own)


@pytest.mark.parametrize("kind", WORDINGS)
@pytest.mark.parametrize("name", SETS)
def test_the_words_of_facts_without_figures(name, kind):
    """Turns, axes, units, contacts, and what is told of disturbances."""
    tasks = shipped(name)
    text, metres = question(tasks, kind), tasks.file.shown_unit == "m"
    assert ("counter-clockwise" in text) == metres
    assert "clockwise" in text
    for words in ("x axis", "y axis", "first contact", "rad", "CPU", "GB", "-pi"):
        assert words in text or (words == "-pi" and "pose" not in tasks.file.observed)
    for key in tasks.file.observed:
        assert f"`{key}`" in text
    assert re.search(r"\d m\b" if metres else r"\d px\b", text)
    assert not re.search(r"\d px\b" if metres else r"\d m\b", text)
    assert not re.search(r"[Ee]-puck(?! )|TurtleBot", text)


@pytest.mark.parametrize("name", SETS)
def test_without_facts_the_contract_is_left(name):
    """`underspecified` on a set; it has neither numbers of the level nor words."""
    tasks = shipped(name)
    text = set_prompt(tasks, (), load_template("underspecified"))
    assert text == question(tasks, "facts", FACTS) == question(tasks, "facts-2", FACTS)
    assert all(words in text for words in CONTRACT)
    assert ("occupancy.npy" in text) == tasks.file.map
    for fact, words in WORDS.items():
        assert not re.search(words, text), fact
    assert "```json" not in text
    assert "## The robot" not in text
    shapes = dict(re.findall(r"^\| `(\w+)` \| (\([\d, ]*\)) \|", text, re.MULTILINE))
    full = set_prompt(tasks, (), PromptTemplate())
    same = re.findall(r"^\| `(\w+)` \| (\([\d, ]*\)) \|", full, re.MULTILINE)
    assert shapes == dict(same)


@pytest.mark.parametrize("name", SETS)
def test_params_json_shows_the_keys_of_told_facts(name):
    """Each key of the file belongs to facts, and is printed if all are told."""
    params = level_params(shipped(name).file)
    assert params.keys() <= KEYS.keys()
    assert params["robot"].keys() <= ROBOT_KEYS.keys()

    def printed(*omitted):
        text = question(shipped(name), "facts", omitted)
        return json.loads(text.partition("```json\n")[2].partition("\n```")[0])

    everything = printed()
    assert everything.keys() == params.keys()
    assert everything["robot"].keys() == params["robot"].keys()
    assert "radius" not in printed("radius")["robot"]
    assert "cpu" not in printed("budget")
    assert "ray_angles" not in printed("turning")["robot"]


@pytest.mark.parametrize("kind", WORDINGS)
@pytest.mark.parametrize("name", SETS)
def test_the_form_of_a_question(name, kind):
    """Items are on lines of their own; no blank line is doubled, no space is left."""
    text = question(shipped(name), kind)
    facts = text.partition("## The robot")[2].partition("## Observation")[0]
    assert not re.search(r" [.,;:]|\S- [A-Z`]|  \S+  |\n\n\n|\( ", facts.strip())
    assert max(map(len, facts.splitlines())) <= 96
    for line in facts.strip().splitlines()[1:]:
        assert line.startswith(("- ", "  "))


def test_names():
    """The name of a prompt carries what it omits, in the order of the list."""
    assert load_template("facts:omit=radius, turning").name == (
        "facts:omit=turning,radius"
    )
    assert load_template("facts-2").name == "facts-2"
    assert with_omitted(None, "") is None
    assert with_omitted("full", "") is None
    assert with_omitted(None, "axle").name == "facts:omit=axle"
    assert with_omitted("facts-2:omit=axle", "rays").name == "facts-2:omit=axle,rays"
    with pytest.raises(TaskError, match=r"no fact 'radus' \(did you mean 'radius'\?\)"):
        load_template("facts:omit=radus")
    with pytest.raises(TaskError, match="'underspecified' is not made of facts"):
        with_omitted("underspecified", "axle")
