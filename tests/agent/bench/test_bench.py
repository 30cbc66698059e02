"""Entrants on the same worlds: rows, resumption, hidden worlds, folders together."""

import json
import re
import stat
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import yaml
from script import AHEAD, STILL
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

from tdac_agent.bench.arena import entry_of
from tdac_agent.bench.bench import RESULTS, WORLD_TABLE, bench
from tdac_agent.bench.compared import Driven
from tdac_agent.bench.entrants import named
from tdac_agent.bench.page import MOST_WORLDS
from tdac_agent.bench.record import Bench
from tdac_agent.bench.shown import merged, read, reveal
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.executors.local import executor_of
from tdac_agent.verification.store import mark_rows
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.frozen import FROZEN
from tdac_envs.ladder.set_file import BUILT_IN
from tdac_envs.ladder.space_time import earliest_arrival

RAISES = "def policy(obs):\n    raise ValueError('no')\n"


@pytest.fixture
def files(tmp_path):
    """Controllers: one stands, one drives ahead, one raises."""
    sources = {"still": STILL, "ahead": AHEAD, "raises": RAISES}
    for name, source in sources.items():
        (tmp_path / f"{name}.py").write_text(source)
    return [f"{name}={tmp_path / f'{name}.py'}" for name in sources]


@pytest.mark.slow
def test_rows_are_what_verify_says(warm, tmp_path, files):
    """Scores, contacts and intervals; a broken entrant is a row with its reason."""
    out = tmp_path / "out"
    found = bench(["builtin", *files], ["known"], "dev", 2, out=out, judge=warm)
    own, still, ahead, broken = found.rows
    alone = verify_episodes(
        files[1].partition("=")[2], load_set("known"), 2, split="dev", judge=warm
    )
    assert ahead.time.value == pytest.approx(alone.scores.time)
    assert ahead.path == pytest.approx(alone.scores.path)
    assert (ahead.success.low, ahead.success.high) == (
        alone.interval.low, alone.interval.high,
    )  # fmt: skip
    assert (own.success.value, own.kind, own.knows) == (1.0, "builtin", "+ map")
    assert (still.late, still.errors, still.contacts) == (2, 0, {})
    assert ahead.contacts == {"wall": 2}
    assert ahead.causes == alone.causes
    assert (ahead.time.value, ahead.time.high) == (0.0, ahead.success.high)
    assert (broken.time, broken.worlds) == (None, 0)
    assert "ValueError" in broken.problem
    assert found.of_set("known")[0].entrant == "builtin"
    assert {(pair.one, pair.other) for pair in found.pairs} == {
        ("builtin", "still"), ("builtin", "ahead"), ("still", "ahead"),
    }  # fmt: skip
    first = found.pairs[0]
    assert first.ahead.value == pytest.approx(own.time.value)
    assert (first.only_one, first.only_other, first.better) == (2, 0, 1.0)
    assert first.p_holm >= first.p
    assert read(out) == found
    table = pd.read_csv(out / "worlds.csv")
    assert len(table) == 6
    assert (out / "scores.svg").read_text().rstrip().endswith("</svg>")
    mean = table[table.entrant == "builtin"].time_score.mean()
    assert mean == pytest.approx(own.time.value)


@pytest.mark.slow
def test_several_sets_have_equal_weight(warm, tmp_path, level, files):
    """An entrant that does not drive on all of them is in no row over all."""
    other = tmp_path / "other.yaml"
    other.write_text(level.read_text().replace("few", "other"))
    found = bench(
        ["orca", *files], [level, other], "dev", 2, out=tmp_path / "out", judge=warm
    )
    assert {row.entrant for row in found.overall} == {"still", "ahead"}
    for row in found.overall:
        own = [each.time.value for each in found.rows if each.entrant == row.entrant]
        assert row.time.value == pytest.approx(np.mean(own))
    values = [row.time.value for row in found.overall]
    assert values == sorted(values, reverse=True)
    assert {pair.set for pair in found.pairs} == {"other", "few", None}


@pytest.mark.slow
def test_it_goes_on_after_an_interruption(warm, tmp_path, level, files):
    """What has been driven is not driven again, and the results are the same."""
    out, driven = tmp_path / "out", []

    def interrupt(name, entrant, episodes, successes):
        if entrant == "ahead":
            raise KeyboardInterrupt

    def note(name, entrant, episodes, successes):
        driven.append(entrant)

    given = {"split": "dev", "worlds": 2, "judge": warm}
    with pytest.raises(KeyboardInterrupt):
        bench(files, [level], out=out, watch=interrupt, **given)
    first = bench(files, [level], out=out, watch=note, **given)
    assert set(driven) == {"ahead", "raises"}
    driven.clear()
    assert bench(files, [level], out=out, watch=note, **given) == first
    assert driven == []
    assert bench(files, [level], out=tmp_path / "other", **given) == first


@pytest.mark.slow
def test_hidden_worlds(warm, tmp_path, level, files, monkeypatch):
    """A salt is drawn when the entrants are on record, and revealed at the end."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    out, given = tmp_path / "out", {"split": "hidden", "worlds": 2, "judge": warm}

    def recorded(name, entrant, episodes, successes):
        entries = json.loads((out / "entrants.json").read_text())
        assert [entry["entrant"] for entry in entries] == ["still", "ahead"]

    found = bench(files[:2], [level], out=out, watch=recorded, **given)
    salt = bytes.fromhex((out / "salt.hex").read_text())
    assert len(salt) == 32
    assert len(pd.read_csv(out / "worlds.csv")) == 4
    assert found.sets[0].salt_sha256 is not None
    assert [file.hidden for row in found.rows for file in row.files] == [1, 1]
    with pytest.raises(RunError, match="a salt that was drawn for other entrants"):
        bench(files, [level], out=out, **given)
    assert bench(files[:2], [level], out=out, **given) == found


@pytest.mark.slow
def test_sealed_worlds(warm, tmp_path, level, files, monkeypatch):
    """With a salt of one's own, no row of a world is shown until it is revealed."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    salt, out = tmp_path / "salt", tmp_path / "out"
    salt.write_bytes(bytes(range(32)))
    given = {"split": "hidden", "worlds": 2, "judge": warm, "salt_file": salt}
    found = bench(files[:2], [level], out=out, **given)
    names = {path.name for path in out.iterdir()}
    shown = {"bench.json", "bench.html", "timing.csv", "scores.svg"}
    assert names - {".lock"} == {*shown, "sealed"}
    assert "Replays" not in (out / "bench.html").read_text()
    assert stat.S_IMODE((out / "sealed").stat().st_mode) == 0o700
    other = tmp_path / "other"
    entered = ["again=" + files[0].partition("=")[2], f"new={tmp_path / 'new.py'}"]
    (tmp_path / "new.py").write_text(f"{AHEAD}# another file\n")
    before, new = bench(entered, [level], out=other, **given).rows
    assert before.time is None
    assert "was driven on these hidden worlds before" in before.problem
    assert new.worlds == 2
    (tmp_path / "wrong").write_bytes(bytes(32))
    with pytest.raises(TaskError, match="is not the salt of"):
        reveal(out, tmp_path / "wrong")
    reveal(out, salt)
    assert bytes.fromhex((out / "salt.hex").read_text()) == salt.read_bytes()
    reveal(other, out / "salt.hex")
    assert (other / "salt.hex").read_text() == (out / "salt.hex").read_text()
    both = merged([out, other])
    assert [row.time is None for row in both.rows] == [False, False, True, False]
    table = pd.read_csv(out / "worlds.csv")
    for row in found.rows:
        own = table[table.entrant == row.entrant]
        assert own.time_score.mean() == pytest.approx(row.time.value)


@pytest.mark.slow
def test_levels_are_in_the_order_of_the_ladder(warm, tmp_path, files):
    """However the folders were given; sets of one's own come last."""
    for name in ("moving", "known"):
        out = tmp_path / name
        bench(files[:1], [name], "dev", worlds=1, out=out, judge=warm)
    found = merged([tmp_path / "moving", tmp_path / "known"])
    assert [own.name for own in found.sets] == ["known", "moving"]
    assert [row.set for row in found.rows] == ["known", "moving"]


@pytest.mark.slow
def test_folders_together(warm, tmp_path, level, files):
    """Two benches on the same worlds are one; on others they are refused."""
    given = {"split": "dev", "judge": warm}
    both = bench(files[:2], [level], worlds=3, out=tmp_path / "both", **given)
    for number in (0, 1):
        folder = tmp_path / str(number)
        bench(files[number : number + 1], [level], worlds=3, out=folder, **given)
    assert merged([tmp_path / "0", tmp_path / "1"]) == both
    bench(files[1:2], [level], worlds=2, out=tmp_path / "2", **given)
    with pytest.raises(
        RunError, match=r"'few' differs .* in its number of worlds \(2, not 3\)"
    ):
        merged([tmp_path / "0", tmp_path / "2"])
    text = level.read_text().replace("clutter", "aisles")
    level.write_text(text)
    bench(files[1:2], [level], worlds=3, out=tmp_path / "3", **given)
    with pytest.raises(RunError, match=r"'few' differs .* in its version"):
        merged([tmp_path / "0", tmp_path / "3"])


@pytest.mark.slow
def test_processes_of_an_executor(
    refused, done, warm, tmp_path, level, files, monkeypatch
):
    """The same bytes as one after another; a broken file is a row here, too."""
    monkeypatch.chdir(tmp_path)
    words = ["builtin", *files, "lost.zip"]
    (tmp_path / "lost.zip").write_bytes(b"")
    bench(words, [level], worlds=2, out=tmp_path / "alone", judge=warm)
    given = ("--set", str(level), "-n", "2", "--out", str(tmp_path / "spread"))
    spread = ("--executor", "local", "--workers", "2")
    out = done("bench", *words, *given, *spread)
    assert "lost.zip" in out
    for name in (RESULTS, WORLD_TABLE):
        one, other = (tmp_path / part / name for part in ("alone", "spread"))
        assert one.read_bytes() == other.read_bytes()
    err = refused("bench", "builtin", *given, "--workers", "2")
    assert "--workers needs --executor" in err


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed")
def test_a_ray_cluster(warm, tmp_path, level, files):
    """As without one."""
    found = [
        bench(["builtin", *files], [level], worlds=2, out=tmp_path / name, **spread)
        for name, spread in (
            ("alone", {"judge": warm}),
            ("ray", {"executor": executor_of("ray"), "workers": 2}),
        )
    ]
    assert found[0] == found[1]


@pytest.mark.slow
def test_seeds_of_a_training(warm, tmp_path, level, files):
    """Several files under one name are one entrant, resampled by file and world."""
    paths = [file.partition("=")[2] for file in files[:2]]
    found = bench(
        [f"both={','.join(paths)}", files[0]],
        [level],
        "dev",
        3,
        out=tmp_path / "out",
        judge=warm,
    )
    both, still = found.rows
    assert len(both.files) == 2
    assert both.late + sum(both.contacts.values()) + both.errors == 6
    assert found.pairs[0].p_success is None
    assert still.files[0] in both.files


@pytest.mark.slow
def test_a_privileged_planner_stands_apart(warm, tmp_path, files, monkeypatch):
    """It plans on the same worlds, after the others, and is compared with none."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    given = {"worlds": 2, "judge": warm}
    words, tasks = ["privileged", files[0]], load_set("moving")
    found = bench(words, ["moving", "known"], split="dev", out=tmp_path / "a", **given)
    first, last = found.of_set("moving")
    assert (last.entrant, last.kind, last.knows) == ("privileged", "privileged", "all")
    assert first.kind == "controller"
    assert not [pair for pair in found.pairs if pair.set == "moving"]
    assert "1 by definition" in found.of_set("known")[-1].problem
    table = pd.read_csv(tmp_path / "a/worlds.csv").set_index(["set", "entrant"])
    for index, row in enumerate(table.loc[("moving", "privileged")].itertuples()):
        arrival = earliest_arrival(tasks.task("dev", index))
        assert row.steps == arrival.steps
        assert row.time_score == pytest.approx(row.least_steps / arrival.steps)
    again = bench(words, ["moving"], split="dev", out=tmp_path / "b", **given)
    assert merged([tmp_path / "b"]) == again
    hidden = bench(words[:1], ["crowd"], split="hidden", out=tmp_path / "c", **given)
    assert hidden.rows[0].worlds == 2


@pytest.mark.slow
def test_runs_on_the_same_world(warm, tmp_path, files):
    """The unit is a world: a success rate with several runs has no exact interval."""
    short = {"factor": 1.0, "least": 40, "most": 40}
    barn = {"barn": str(BUILT_IN / "barn" / "worlds.json"), "splits": ["test"]}
    barn |= {"tests": [], "runs": 2}
    path = tmp_path / "twice.yaml"
    own = {"goal_tolerance": 40, "horizon": short, "disturbances": {"wheel_slip": 0.01}}
    path.write_text(yaml.safe_dump({"worlds": barn, **own}))
    assert load_set(path).runs("test", 500) == 2
    found = bench(files[:2], [path], "test", 3, out=tmp_path / "a", judge=warm)
    assert {row.worlds for row in found.rows} == {3}
    episodes = [SimpleNamespace(time_score=k, success=k > 2) for k in range(6)]
    driven = Driven.of("one", [episodes], 2)
    assert driven.time.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert driven.success.tolist() == [[0, 0, 0], [1, 1, 1]]
    with pytest.raises(TaskError, match="expected a multiple of 250"):
        bench(files[:2], [path], "test", 300, out=tmp_path / "b", judge=warm)


@pytest.mark.parametrize(
    ("entrants", "sets", "split", "error", "message"),
    [
        ([], ["known"], "test", TaskError, "at least one entrant"),
        (
            ["no.py"],
            ["known"],
            "test",
            ControllerFileError,
            r"no entrant 'no\.py': there is no such file",
        ),
        (["dwaa"], ["known"], "test", ControllerFileError, "did you mean 'dwa'"),
        (["a=builtin", "a=dwa"], ["known"], "test", TaskError, "'a' is given twice"),
        (["builtin"], ["known", "known"], "test", TaskError, "'known' is given twice"),
        (["builtin"], [], "test", TaskError, "at least one task set"),
        (["builtin"], ["knwon"], "test", TaskError, "did you mean 'known'"),
        (["builtin"], ["known"], "train", TaskError, "expected split to be one of"),
    ],
)
def test_what_is_refused(tmp_path, entrants, sets, split, error, message):
    with pytest.raises(error, match=message):
        bench(entrants, sets, split, out=tmp_path / "out")
    assert not (tmp_path / "out" / "bench.json").exists()


def test_the_command(tdac, done, tmp_path, level, files):
    """`run` may be left out; `show` prints the same again."""
    out = tmp_path / "out"
    words = (*files, "--set", level, "--split", "dev", "-n", "2", "--out", out)
    code, said, progress = tdac("bench", *words)
    assert code == 0
    assert "few: still, 0 of 2 reached" in progress
    for text in ("worlds 0 to 1 of dev", "raises did not drive", "wrote bench.json"):
        assert text in said
    assert tdac("bench", "run", *words)[1] == said
    again = done("bench", "show", out)
    assert said.startswith(again.rstrip())
    record = Bench.model_validate_json(tdac("bench", *words, "--json")[1])
    assert record == read(out)
    (watch,) = re.findall("watch the first failure: (.*)", said)
    assert (
        watch
        == f"tdac play {out.parent / 'still.py'} --set {level} --split dev --index 0"
    )
    assert all(len(line) <= 80 for line in said.splitlines() if "0.000 (" in line)


@pytest.mark.slow
def test_fewer_entrants_than_before(tdac, refused, done, tmp_path, level, files):
    """It is said, and nothing is lost; `show --out` writes them elsewhere."""
    out, both = tmp_path / "out", tmp_path / "both"
    given = ("--set", level, "--split", "dev", "-n", "1", "--out", out)
    tdac("bench", *files[:2], *given)
    said = done("bench", files[0], *given)
    assert "These results replace those of ahead." in " ".join(said.split())
    said = done("bench", *files[:2], *given)
    assert "These results replace" not in said
    said = done("bench", "show", out, "--out", both)
    assert "wrote bench.json, worlds.csv, scores.svg, bench.html" in said
    for name in (RESULTS, WORLD_TABLE):
        assert (both / name).read_bytes() == (out / name).read_bytes()
    error = refused("bench", "show", both, "--out", out)
    assert "has a bench of its own: give another --out" in error
    said = done("bench", files[0], *given[:-3], "2", "--out", out)
    assert "replace those on 1 world of dev of few" in " ".join(said.split())


def test_names_and_seeds(tmp_path, files, monkeypatch):
    """A policy has the name of its training; seeds are of one kind."""
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "policy.zip").touch()
    words = named(["a/policy.zip", "b", "x=dwa,still.py"])
    assert [each.name for each in words] == ["a", "b", "x"]
    problem = entry_of(words[-1], load_set("known")).reason
    assert problem == "its files are not seeds of one training: planner, controller"
    (twice,) = named(["twice=still.py,still.py"])
    assert entry_of(twice, load_set("known")).reason == "two of its files are the same"
    with pytest.raises(ControllerFileError, match="it has neither contr"):
        named([str(tmp_path)])


def test_nobody_drives(tdac, refused, tmp_path, level, files):
    """Exit code 1, and no traceback."""
    code, said, _ = tdac(
        "bench", files[2], "--set", level, "-n", "1", "--out", tmp_path / "out"
    )
    assert (code, "did not drive" in said) == (1, True)
    err = refused("bench", "show", tmp_path)
    code, _, err = tdac("bench", files[2])
    assert (code, "at least one task set or task" in err) == (2, True)


@pytest.mark.slow
def test_tasks_on_the_command_line(tdac, done, tmp_path):
    """A task is driven from jittered starts; hidden worlds are of sets alone."""
    words = "bench", "builtin", "go-to-goal", "--task", "maze", "-n", "2"
    said = done(*words, "--set", "known", "--out", tmp_path / "out")
    assert "jittered starts 0 to 1" in said
    assert "worlds 0 to 1 of test" in said
    code, _, err = tdac(*words, "--split", "hidden", "--out", tmp_path / "no")
    assert (code, "tasks have no hidden worlds" in err) == (2, True)


@pytest.mark.slow
def test_an_interrupted_file_goes_on(warm, tmp_path, level, files):
    """Not only whole files, but each of their episodes is driven once."""
    out, seen = tmp_path / "out", []

    def interrupt(name, entrant, episodes, successes):
        if episodes >= 2:
            raise KeyboardInterrupt

    def note(name, entrant, episodes, successes):
        seen.append(episodes)

    given = {"split": "dev", "worlds": 6, "judge": warm}
    with pytest.raises(KeyboardInterrupt):
        bench(files[:1], [level], out=out, watch=interrupt, **given)
    (rows,) = out.glob("driven/few/*/unfinished/episodes.jsonl")
    kept = rows.read_text().splitlines()
    assert len(kept) >= 2
    changed = json.loads(kept[0]) | {"time_score": 0.5}
    rows.write_text("\n".join([json.dumps(changed), kept[1], kept[1][:20]]))
    mark_rows(rows.parent)
    found = bench(files[:1], [level], out=out, watch=note, **given)
    # The first episode is the one that was kept, the broken line is driven again.
    assert found.rows[0].time.value == pytest.approx(0.5 / 6)
    assert not rows.parent.exists()
    assert len(list(out.glob("driven/few/*/trajectories/*.npz"))) == 6
    assert len(pd.read_csv(out / "worlds.csv")) == 6


@pytest.mark.slow
def test_the_page(warm, tmp_path, level, files):
    """Tables, and replays of all entrants on the same worlds; none of hidden ones."""
    out = tmp_path / "out"
    found = bench(["go-to-goal", *files], [level], "dev", 8, out=out, judge=warm)
    html = (out / "bench.html").read_text()
    for row in found.rows[:2]:
        assert f"{row.time.value:.3f}" in html
    assert "did not drive: " in html
    shown = json.loads(re.search(r'id="episodes-1">(.*?)</script>', html)[1])
    scenes = json.loads(re.search(r'id="scenes">(.*?)</script>', html)[1])
    assert len(shown) == 3 * MOST_WORLDS
    assert {episode["label"] for episode in shown} == {"go-to-goal", "still", "ahead"}
    table = pd.read_csv(out / "worlds.csv").set_index(["entrant", "index"])
    for episode in shown:
        index = int(episode["name"].removeprefix("world "))
        row = table.loc[(episode["label"], index)]
        points = np.array(episode["points"]).reshape(-1, 4).sum(axis=0)
        assert points[0] == episode["steps"] == row.steps
        assert episode["outcome"] == row.outcome
        scene = scenes[episode["scene"]]
        assert 0 <= points[1] / 4 <= scene["width"]
        assert 0 <= points[2] / 4 <= scene["height"]
        assert (episode["contact"] is None) == (row.outcome != "collision")


@pytest.mark.slow
def test_the_page_in_a_browser(browser, warm, tmp_path, level, files):
    """Another entrant is shown in the same world, another world has its own map."""
    out = tmp_path / "out"
    bench(files[:2], [level], "dev", 2, out=out, judge=warm)
    browser.get((out / "bench.html").as_uri())
    script = "return document.querySelector('canvas').toDataURL()"
    pictures = [browser.execute_script(script)]
    for name, choice in (("candidate", "ahead"), ("episode", None)):
        select = Select(browser.find_element(By.CSS_SELECTOR, f"select.{name}"))
        if choice is None:
            select.select_by_index(1)
        else:
            select.select_by_visible_text(choice)
        WebDriverWait(browser, 20).until(
            lambda opened: opened.execute_script(script) not in pictures
        )
        pictures.append(browser.execute_script(script))
    entrant = Select(browser.find_element(By.CSS_SELECTOR, "select.candidate"))
    assert entrant.first_selected_option.text == "ahead"
    assert browser.get_log("browser") == []


@pytest.mark.slow
def test_tasks_beside_sets(warm, tmp_path, files, level, small_task):
    """Programs and planners drive on both, and are compared over all of them."""
    out = tmp_path / "out"
    given = {"tasks": [small_task.folder], "out": out, "judge": warm}
    found = bench(["dwa", files[0]], [level], "dev", 2, **given)
    assert [each.split for each in found.sets] == ["dev", "jitter"]
    by = {(row.set, row.entrant): row for row in found.rows}
    name = found.sets[1].name
    assert by[name, "dwa"].success.value == 1.0
    assert {each.entrant for each in found.overall} == set(found.entrants)
    assert (out / "bench.html").read_text().count("seed ") > 0
    with pytest.raises(TaskError, match="tasks have no hidden worlds"):
        bench(["dwa"], [level], "hidden", 2, **given)


@pytest.mark.parametrize(
    ("name", "dynamics", "what"),
    [
        ("known", "", "known: before Ladder 1.0, with the same dynamics"),
        ("epuck", "", "epuck: before Ladder 1.0"),
        ("epuck", FROZEN["epuck"].dynamics, "epuck: Ladder 1.0"),
        ("known", "0" * 64, "known: other dynamics than Ladder 1.0"),
    ],
)
def test_results_say_to_which_ladder_they_belong(done, tmp_path, name, dynamics, what):
    """An e-puck of before had another axle; nothing has changed on maps."""
    own = {"name": name, "sha256": FROZEN[name].sha256, "dynamics": dynamics}
    own |= {"split": "test", "worlds": 100, "salt_sha256": None}
    if not dynamics:
        del own["dynamics"]
    rows = [{"set": name, "entrant": "one", "problem": "it broke"}]
    record = {"versions": {}, "sets": [own], "entrants": ["one"], "rows": rows}
    (tmp_path / RESULTS).write_text(json.dumps(record))
    lines = done("bench", "show", tmp_path).splitlines()
    assert what in [line.strip() for line in lines]


@pytest.mark.parametrize("name", ["known", "epuck"])
def test_results_on_equal_dynamics_are_put_together(tmp_path, name):
    """Also those of before Ladder 1.0, if nothing has changed since."""
    own = {"name": name, "sha256": FROZEN[name].sha256, "salt_sha256": None}
    own |= {"split": "test", "worlds": 100}
    for folder, dynamics in (("old", ""), ("new", FROZEN[name].dynamics)):
        rows = [{"set": name, "entrant": folder, "problem": "it broke"}]
        sets = [own | {"dynamics": dynamics}]
        record = {"versions": {}, "sets": sets, "entrants": [folder], "rows": rows}
        (tmp_path / folder).mkdir()
        (tmp_path / folder / RESULTS).write_text(json.dumps(record))
        columns = "set,entrant,file,index,success,time_score\n"
        (tmp_path / folder / WORLD_TABLE).write_text(columns)
    folders = [tmp_path / "new", tmp_path / "old"]
    if name == "epuck":
        with pytest.raises(RunError, match=r"in its dynamics \(unknown, not \w{8}\)"):
            merged(folders)
        return
    (both,) = merged(folders).sets
    assert both.ladder == "before Ladder 1.0, with the same dynamics"
