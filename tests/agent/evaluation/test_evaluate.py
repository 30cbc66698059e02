"""Evaluation: the same episodes for all, whoever drives, and what is said of them."""

import base64
import io
import json
import math
import pickle
import re
import shutil
import signal
import subprocess
import sys
import zipfile
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom
from small import QUICK, write_small_task

import tdac_agent
from tdac_agent import load_task
from tdac_agent.episodes.learned import Learned
from tdac_agent.episodes.sb3_file import SavedPolicy, read_policy, write_metadata
from tdac_agent.evaluation.evaluate import NO_DISTURBANCE, episode_seeds, evaluate
from tdac_agent.evaluation.evaluation_report import compare
from tdac_agent.evaluation.overlay import COLOURS
from tdac_agent.evaluation.policies import Entrant, entrants_of
from tdac_agent.evaluation.replay import drive_episode
from tdac_agent.metrics.exact import sign_test
from tdac_agent.problems.part import Part
from tdac_agent.sandbox import ControllerFault
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.locks import LOCK_FILE, hold
from tdac_agent.verification.diagnosis.measures import (
    shortest_path_length,
    spectral_arc_length,
)
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.store import ROWS_FILE, UNFINISHED
from tdac_envs.core.errors import TaskError
from tdac_envs.drawing.canvas import MOVER
from tdac_envs.learning.wrappers import wrap
from tdac_envs.map2d.env import Map2DEnv

GIVES_UP = """
def reset(obs):
    if float(obs["pose"][2]) > 0.0:
        raise ValueError("not with this heading")


def policy(obs):
    return 1.0, 1.0
"""
THREE_WHEELS = """
def policy(obs):
    return 1.0, 1.0, 1.0
"""
HANGS = """
def policy(obs):
    while True:
        pass
"""
WRAPPERS = ("goal-relative", "guidance", "flatten")


def seeds_of(seed, count):
    return np.random.SeedSequence(seed).generate_state(count).tolist()


@pytest.fixture
def controllers(tmp_path, good_source):
    """Files of controllers that solve the small task, or fail in some way."""
    texts = {"good": good_source, "gives_up": GIVES_UP, "three": THREE_WHEELS}
    for name, text in {**texts, "hangs": HANGS}.items():
        (tmp_path / f"{name}.py").write_text(text)
    return tmp_path


@pytest.fixture(scope="module")
def ours(small_task, warm):
    """Our own policies on the small task."""
    names = ["reference", "go-to-goal", "random", "follow-guidance"]
    return evaluate(names, [small_task], 6, judge=warm)


def drive_alone(policy, task, seed):
    """The row of an episode."""
    part = Part((seed,), disturbance=NO_DISTURBANCE)
    return drive_episode(Entrant("it", policy), task, part).row


def episodes_of(result):
    """What does not depend on the machine."""
    return [each.model_copy(update={"cpu_seconds": 0.0}) for each in result.episodes]


def row(found, policy):
    return next(row for row in found.rows if row.policy == policy)


@pytest.mark.slow
def test_what_our_policies_are_worth(ours):
    """Who knows the way gets there, who does not hits the wall; and it is said so."""
    for name, knows in (("reference", "privileged"), ("follow-guidance", "+ guidance")):
        assert row(ours, name).knows == knows
        assert row(ours, name).successes == 6
        assert row(ours, name).clearance_min >= 0.0
    blind = row(ours, "go-to-goal")
    assert (blind.successes, blind.collided, blind.knows) == (0, 6, "sensors")
    assert blind.path_ratio is blind.time_ratio is blind.smoothness is None
    assert row(ours, "random").knows == "nothing"
    assert {row.sandbox for row in ours.rows} == {"none"}
    best = row(ours, "reference")
    assert 0.99 <= best.path_ratio <= 1.05
    assert best.time_ratio > best.path_ratio
    assert best.spl == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("kind", ["reference", "follow-guidance"])
def test_who_knows_the_way_gets_there_in_a_world_too(kind):
    """In metres, with y up: every seed reaches the goal and touches nothing."""
    task = load_task("epuck-crates")
    for seed in range(3):
        figures = drive_alone(PolicySpec(kind), task, seed)
        assert figures.success
        assert 0.97 <= figures.path_ratio <= 1.15
        assert 1.0 <= figures.time_ratio <= 1.6


@pytest.mark.slow
def test_two_evaluations_with_one_seed_are_equal_to_the_last_byte(
    ours, small_task, warm
):
    """JSON and CSV are; a policy's episodes do not depend on who else drives."""
    names = [policy.name for policy in ours.policies]
    again = evaluate(names, [small_task], 6, judge=warm)
    assert again.model_dump_json() == ours.model_dump_json()
    assert again.to_frame().to_csv() == ours.to_frame().to_csv()
    alone = evaluate(["random"], [small_task], 6, judge=warm)
    assert episodes_of(alone.results[0]) == episodes_of(ours.results[2])
    other = evaluate(["random"], [small_task], 6, seed=1, judge=warm)
    assert episodes_of(other.results[0]) != episodes_of(ours.results[2])


def test_the_frame_is_tidy(ours):
    """A row for each episode; what is said of a policy follows from them."""
    frame = ours.to_frame()
    assert len(frame) == 4 * 6
    assert frame.groupby("policy")["seed"].apply(tuple).nunique() == 1
    assert frame["seed"].head(6).tolist() == seeds_of(0, 6)
    reference = frame[frame["policy"] == "reference"]
    told = row(ours, "reference")
    assert reference["success"].sum() == told.successes
    assert reference["path_ratio"].median() == pytest.approx(told.path_ratio)
    assert reference["clearance_min"].min() == told.clearance_min
    assert reference["smallest_gap"].min() == told.smallest_gap
    assert reference["too_close"].sum() == told.too_close
    assert set(ours.timing_frame()["policy"]) == set(frame["policy"])


@pytest.mark.slow
def test_controllers_drive_the_episodes_of_the_environment(
    controllers, small_task, warm
):
    """Start and outcome of a seed are those of `reset(seed=…)`, without any noise."""
    files = [controllers / f"{name}.py" for name in ("good", "gives_up", "three")]
    found = evaluate([*files, "go-to-goal"], [small_task], 8, judge=warm)
    env = small_task.make_env(variation="jitter")
    headings = [float(env.reset(seed=seed)[0]["pose"][2]) for seed in seeds_of(0, 8)]
    assert row(found, str(files[0])).successes == 8
    refused = row(found, str(files[1]))
    assert refused.outcomes["error"] == sum(heading > 0.0 for heading in headings)
    (reason,) = refused.reasons
    assert "ValueError at reset" in reason
    assert "not with this heading" in reason
    wrong = row(found, str(files[2]))
    assert wrong.outcomes == {"error": 8}
    assert "expected" in str(wrong.reasons) or "two finite numbers" in str(
        wrong.reasons
    )
    assert row(found, "go-to-goal").outcomes == {"collision": 8}
    assert row(found, str(files[0])).sandbox != "none"


@pytest.mark.slow
def test_a_saved_policy_competes_with_others(tmp_path, small_task, warm):
    """In the judge's process, as in this one."""
    sb3 = pytest.importorskip("stable_baselines3")
    file = tmp_path / "model.zip"
    save(file, sb3.PPO, wrap(small_task.make_env(), WRAPPERS))
    found = evaluate(
        [file, "reference"], [small_task], 2, wrappers=WRAPPERS, judge=warm
    )
    assert row(found, str(file)).outcomes.get("error", 0) == 0
    assert row(found, "reference").successes == 2


@pytest.mark.slow
def test_time_outs_end_a_policy_and_not_the_evaluation(controllers, small_task, warm):
    """After three of them the rest is not waited for; it counts as failed."""
    hangs = controllers / "hangs.py"
    found = evaluate([hangs, "reference"], [small_task], 12, limits=QUICK, judge=warm)
    late = row(found, str(hangs))
    assert late.successes == 0
    assert late.outcomes == {"error": 12}
    assert any("3 earlier episodes timed out" in reason for reason in late.reasons)
    assert row(found, "reference").successes == 12


@pytest.mark.slow
def test_what_is_builtin_is_what_synth_delivers(small_task, warm):
    """The controller is verified, sandboxed, and named by its hash."""
    found = evaluate(["builtin"], [small_task], 3, judge=warm)
    builtin = row(found, "builtin")
    assert builtin.successes == 3
    assert builtin.knows == "+ map"
    assert builtin.note is None
    assert len(builtin.controller_sha256) == 64


@pytest.mark.slow
def test_random_starts_and_goals(small_task, warm):
    """The privileged reference solves what is drawn; nominal starts are all one."""
    found = evaluate(
        ["reference", "follow-guidance"],
        [small_task],
        5,
        variation="random",
        judge=warm,
    )
    assert row(found, "reference").successes == 5
    frame = found.to_frame()
    assert frame[frame["policy"] == "reference"]["length"].nunique() == 5
    same = evaluate(
        ["reference"], [small_task], 3, variation="nominal", judge=warm
    ).to_frame()
    assert same["driven"].nunique() == 1


def save(path, algo, env, **options):
    model = algo(
        "MultiInputPolicy" if hasattr(env.observation_space, "spaces") else "MlpPolicy",
        env,
        device="cpu",
        seed=1,
        **options,
    )
    model.save(path)
    return model


@pytest.mark.slow
@pytest.mark.parametrize("algo", ["PPO", "SAC", "TD3"])
def test_a_saved_policy_drives_as_its_model_does(algo, tmp_path, small_task):
    """Step for step as `model.predict` in the wrapped environment."""
    sb3 = pytest.importorskip("stable_baselines3")
    torch = pytest.importorskip("torch")
    kind = getattr(sb3, algo)
    wrappers = WRAPPERS if algo != "SAC" else WRAPPERS[:2]
    env = wrap(small_task.make_env(variation="jitter"), wrappers)
    options = {"policy_kwargs": {"net_arch": [16], "activation_fn": torch.nn.ELU}}
    file = tmp_path / "model.zip"
    model = save(file, kind, env, **(options if algo == "PPO" else {}))
    write_metadata(file, SavedPolicy(algo=algo.lower(), wrappers=wrappers))
    who = PolicySpec("sb3", file, read_policy(file).saved.wrappers)
    assert who.knows == "+ guidance"
    for seed in range(3):
        episode = drive_alone(who, small_task, seed)
        observation, _ = env.reset(seed=seed)
        places, ended = [env.unwrapped.pose()[:2]], False
        while not ended:
            action, _ = model.predict(observation, deterministic=True)
            observation, _, terminated, truncated, info = env.step(action)
            places.append(env.unwrapped.pose()[:2])
            ended = terminated or truncated
        length = sum(math.dist(one, two) for one, two in pairwise(places))
        assert episode.steps == len(places) - 1
        assert episode.collisions == info["collisions"]
        assert episode.driven == pytest.approx(length, abs=1e-2)


@pytest.mark.slow
def test_a_batch_drives_the_episodes_of_an_evaluation(tmp_path, small_task):
    """Rates are the same as those of the judge, for the same seeds."""
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecMonitor

    from tdac_agent.training.learning import evaluate_batch
    from tdac_agent.training.plan import make_batch, make_plan

    file, seeds = tmp_path / "model.zip", episode_seeds(3, 4)
    model = save(file, sb3.PPO, wrap(small_task.make_env(), WRAPPERS))
    plan = make_plan((str(write_small_task(tmp_path / "small")),))
    envs = VecMonitor(make_batch(plan, 4), info_keywords=("collision",))
    found = evaluate_batch(model, envs, seeds)
    envs.close()
    who = PolicySpec("sb3", file, WRAPPERS)
    episodes = [drive_alone(who, small_task, seed) for seed in seeds]
    assert found.collision_rate == np.mean([e.collisions > 0 for e in episodes])
    assert found.success_rate == np.mean([e.success for e in episodes])
    # A network rounds a batch otherwise than a single observation.
    lengths = np.mean([e.steps for e in episodes])
    assert found.mean_length == pytest.approx(lengths, abs=1.0)


@pytest.mark.slow
def test_nothing_of_a_saved_policy_is_run(tmp_path, small_task):
    """Pickled code in it stays what it is: bytes."""
    sb3 = pytest.importorskip("stable_baselines3")
    env = wrap(small_task.make_env(), WRAPPERS)
    honest, evil = tmp_path / "honest.zip", tmp_path / "evil.zip"
    save(honest, sb3.PPO, env)
    trace = tmp_path / "trace"

    class Bomb:
        def __reduce__(self):
            return open, (str(trace), "w")

    with zipfile.ZipFile(honest) as old, zipfile.ZipFile(evil, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "data":
                data = json.loads(content)
                code = base64.b64encode(pickle.dumps(Bomb())).decode()
                for value in data.values():
                    if isinstance(value, dict) and ":serialized:" in value:
                        value[":serialized:"] = code
                content = json.dumps(data).encode()
            new.writestr(name, content)
    env = small_task.make_env()
    driver = Learned(evil, WRAPPERS, env)
    observation, _ = env.reset(seed=1)
    assert np.array_equal(
        driver.policy(observation),
        Learned(honest, WRAPPERS, env).policy(observation),
    )
    assert not trace.exists()
    pickle.loads(pickle.dumps(Bomb())).close()
    assert trace.exists()


@pytest.mark.slow
def test_a_policy_of_other_observations_is_refused_by_name(tmp_path, small_task):
    """As are settings that are code, and algorithms that are not known."""
    sb3 = pytest.importorskip("stable_baselines3")
    file, env = tmp_path / "model.zip", small_task.make_env()
    save(file, sb3.PPO, wrap(env, WRAPPERS))
    with pytest.raises(ControllerFault, match="trained on other observations"):
        Learned(file, ("goal-relative",), env)
    for change, match in (
        ({"policy_kwargs": {"features_extractor_class": "<class 'x.Y'>"}}, "is code"),
        ({"policy_class": {"__module__": "sb3_contrib.tqc.policies"}}, "cannot be"),
    ):
        other = tmp_path / f"{next(iter(change))}.zip"
        with zipfile.ZipFile(file) as old, zipfile.ZipFile(other, "w") as new:
            data = json.loads(old.read("data"))
            new.writestr("data", json.dumps(data | change))
            new.writestr("policy.pth", old.read("policy.pth"))
        with pytest.raises(ControllerFault, match=match):
            Learned(other, WRAPPERS, env)


@pytest.mark.slow
def test_metadata_is_read_inside_and_beside(tmp_path, small_task):
    """Written again it replaces what was there; nonsense is refused."""
    sb3 = pytest.importorskip("stable_baselines3")
    file = tmp_path / "model.zip"
    save(file, sb3.PPO, wrap(small_task.make_env(), WRAPPERS))
    assert read_policy(file).saved is None
    saved = SavedPolicy(algo="ppo", wrappers=WRAPPERS, tasks=("small",), steps=10)
    file.with_suffix(".json").write_text(saved.model_dump_json())
    assert read_policy(file).saved == saved
    hashes = {entrants_of([file])[0].sha256}
    other = saved.model_copy(update={"wrappers": WRAPPERS[:1]})
    file.with_suffix(".json").write_text(other.model_dump_json())
    hashes.add(entrants_of([file])[0].sha256)
    hashes.add(sha256_of(file.read_bytes()))
    assert len(hashes) == 3  # a network with other observations is another policy
    for steps in (11, 12):
        write_metadata(file, saved.model_copy(update={"steps": steps}))
        assert read_policy(file).saved.steps == steps
    sb3.PPO.load(file, device="cpu")
    assert entrants_of([file])[0].sha256 == sha256_of(file.read_bytes())
    folder = tmp_path / "training"
    folder.mkdir()
    shutil.copy(file, folder / "policy.zip")
    assert entrants_of([folder])[0].policy.file == folder / "policy.zip"
    other = shutil.copy(file, tmp_path / "other.zip")
    with zipfile.ZipFile(other) as archive:
        assert archive.namelist().count("tdac.json") == 1


@given(st.integers(0, 60), st.integers(0, 60))
def test_mcnemar_is_exact(one, other):
    """Twice the smaller tail of a fair coin, at most 1."""
    total = one + other
    tail = binom.cdf(min(one, other), total, 0.5)
    assert sign_test(one, other) == pytest.approx(min(1.0, 2.0 * tail))
    assert sign_test(one, other) == sign_test(other, one)


def test_pairs_are_compared_on_the_same_seeds(ours):
    """Counts add up to the episodes; equal information is said, and comes first."""
    assert len(ours.comparisons) == 6
    for pair in ours.comparisons:
        assert pair.both + pair.only_one + pair.only_other + pair.neither == 6
        assert pair.p == sign_test(pair.only_one, pair.only_other)
        assert pair.equal_information is None
    twin = replace(ours.results[0], policy="twin")
    assert compare(ours.results[0], twin).equal_information == "privileged"
    less = twin.report.model_copy(update={"episodes": twin.episodes[1:]})
    short = replace(twin, report=less)
    with pytest.raises(ValueError, match="drove different episodes"):
        compare(ours.results[0], short)


def test_smoothness_is_that_of_its_authors():
    """SPARC of their example, to their five digits; see `spectral_arc_length`."""
    times = np.arange(-1, 1, 0.01)
    stroke = np.exp(-5 * times**2)
    assert round(spectral_arc_length(stroke, 0.01), 5) == -1.41403
    assert spectral_arc_length(7 * stroke, 0.01) == pytest.approx(
        spectral_arc_length(stroke, 0.01)
    )
    twice = np.concatenate([stroke, stroke])
    assert spectral_arc_length(twice, 0.01) < spectral_arc_length(stroke, 0.01) - 0.5
    assert spectral_arc_length(np.zeros(5), 0.01) == 0.0


@pytest.mark.parametrize("goal", [(130.0, 100.0), (31.0, 95.0), (110.0, 40.0)])
def test_the_shortest_way_over_open_ground_is_straight(goal):
    """Not that of a grid in eight directions, which is up to 8 % longer."""
    env = Map2DEnv(np.zeros((120, 160), bool), (30.0, 30.0), goal, robot_radius=6)
    assert shortest_path_length(env.nominal) == pytest.approx(
        math.dist((30.0, 30.0), goal), rel=5e-3
    )


def test_the_command_writes_what_it_says(done, controllers, tmp_path):
    """A table, a CSV, a picture, and JSON that is the same in each call."""
    folder, out = write_small_task(tmp_path / "task"), tmp_path / "out"
    words = ["evaluate", "reference", "go-to-goal", "--task", folder, "--episodes", 4]
    text = done(*words, "--out", out, "--csv", tmp_path / "all.csv")
    told = " ".join(text.split())
    assert told.startswith("small (map ")
    assert "): 4 episodes each, jittered starts, seed 0 " in told
    assert "reference ~ go-to-goal" in text or "reference > go-to-goal" in text
    frame = pd.read_csv(tmp_path / "all.csv")
    assert frame["success"].tolist() == [True] * 4 + [False] * 4
    assert (out / "episodes.csv").read_bytes() == (tmp_path / "all.csv").read_bytes()
    picture = cv2.cvtColor(cv2.imread(str(out / "small.png")), cv2.COLOR_BGR2RGB)
    for colour in COLOURS[:2]:
        off = np.abs(picture.astype(int) - colour).max(axis=2)
        assert (off < 40).sum() > 200
    again = done(*words, "--json")
    assert again == (out / "evaluation.json").read_text()
    assert json.loads(again)["rows"][0]["interval"]["method"] == "Clopper-Pearson"


@pytest.mark.slow
def test_the_picture_has_the_movers(tmp_path):
    """They are drawn where they were at the end of the first episode."""
    post = {"kind": "route", "points": [[110, 30]], "radius": 5}
    task, out = write_small_task(tmp_path / "task", movers=[post]), tmp_path / "out"
    evaluate(["go-to-goal"], [task], episodes=1, out=out)
    picture = cv2.cvtColor(cv2.imread(str(out / "small.png")), cv2.COLOR_BGR2RGB)
    above_the_legend = picture[: -picture.shape[0] // 8].astype(int)
    assert (np.abs(above_the_legend - MOVER).max(axis=2) < 40).sum() > 40


def test_a_folder_whose_name_is_not_utf_8(done, tmp_path):
    folder, out = write_small_task(tmp_path / "task"), tmp_path / "\udcff"
    words = ["evaluate", "go-to-goal", "--task", folder, "--episodes", 1]
    done(*words, "--out", out)
    assert (out / "evaluation.json").is_file()


@pytest.mark.slow
def test_a_finished_evaluation_is_not_driven_again(tdac, done, tmp_path):
    """The same command prints it from its folder; a missing picture is drawn anew."""
    folder, out = write_small_task(tmp_path / "task"), tmp_path / "out"
    words = ["evaluate", "reference", "random", "--task", folder, "--episodes", 2]
    _, first, _ = tdac(*words, "--out", out)
    kept = files_in(out)
    again = done(*words, "--out", out)
    assert "out already has this evaluation; nothing was driven" in again
    assert again.partition("knows: ")[0] == first.partition("knows: ")[0]
    _, text, _ = tdac(*words, "--out", out, "--json", "--csv", tmp_path / "all.csv")
    assert text == (out / "evaluation.json").read_text()
    assert (tmp_path / "all.csv").read_bytes() == (out / "episodes.csv").read_bytes()
    assert files_in(out) == kept
    (out / "small.png").unlink()
    _, text, _ = tdac(*words, "--out", out)
    assert "already has this evaluation" in text
    assert (out / "small.png").read_bytes() == kept[out / "small.png"]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("words", "differs"),
    [
        (["random", "--episodes", "2"], "--episodes"),
        (["random", "--seed", "3"], "--seed"),
        (["random", "--variation", "nominal"], "--variation"),
        (["go-to-goal"], "policies"),
    ],
)
def test_another_evaluation_is_not_overwritten(tdac, refused, tmp_path, words, differs):
    """One line says what is there, what differs, and what to do."""
    folder, out = write_small_task(tmp_path / "task"), tmp_path / "out"
    rest = ["--task", folder, "--out", out]
    tdac("evaluate", "random", "--episodes", 1, *rest)
    kept = files_in(out)
    words = words if "--episodes" in words else [*words, "--episodes", "1"]
    errors = refused("evaluate", *words, *rest)
    assert "already has an evaluation, of random on small (1 episode each, " in errors
    assert f"it differs in {differs}: give another folder with --out" in errors
    assert files_in(out) == kept


def test_a_changed_task_or_a_foreign_file_in_the_folder(tdac, refused, tmp_path):
    folder, out = write_small_task(tmp_path / "task"), tmp_path / "out"
    words = ["evaluate", "random", "--episodes", 1, "--task", folder, "--out", out]
    tdac(*words)
    write_small_task(folder, goal=[130, 90])
    errors = refused(*words)
    assert "it differs in the settings of the tasks" in errors
    (out / "evaluation.json").write_text("[1]")
    errors = refused(*words)
    assert "evaluation.json cannot be read" in errors


def files_in(out):
    """Contents of the files in a folder."""
    return {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}


def kept_in(out):
    """The lines of finished episodes of a policy that was interrupted."""
    (file,) = out.glob(f"**/{UNFINISHED}/{ROWS_FILE}")
    return file, file.read_bytes().splitlines(keepends=True)


@pytest.mark.slow
def test_an_interrupted_evaluation_goes_on(small_task, warm, tmp_path):
    """No finished episode is driven again, and the results are those of one piece."""
    words = (["reference", "go-to-goal"], [small_task], 5)
    out = tmp_path / "out"

    def interrupt(_task, policy, count, _successes):
        if policy == "go-to-goal" and count >= 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate(*words, out=out, judge=warm, watch=interrupt)
    file, kept = kept_in(out)
    assert len(kept) >= 2
    with file.open("ab") as rows:  # the next one was not written completely
        rows.write(kept[-1][:-20])
    seen = []
    found = evaluate(*words, out=out, judge=warm, watch=lambda *now: seen.append(now))
    counts = [count for _, policy, count, _ in seen if policy == "go-to-goal"]
    assert counts[:2] == [0, len(kept)]
    assert [count for _, policy, count, _ in seen if policy == "reference"] == [0]
    assert not list(out.glob(f"**/{UNFINISHED}"))
    whole = evaluate(*words, judge=warm)
    assert found.model_dump_json() == whole.model_dump_json()
    assert (out / "evaluation.json").read_text() == (
        whole.model_dump_json(indent=2) + "\n"
    )


KILLED = """
import os, signal, sys
from pathlib import Path
from tdac_agent import evaluate

def watch(task, policy, count, successes):
    if count >= 3:
        os.kill(os.getpid(), signal.SIGKILL)

evaluate(["go-to-goal"], [sys.argv[1]], 6, out=Path(sys.argv[2]), watch=watch)
"""


@pytest.mark.slow
def test_a_killed_evaluation_goes_on(tdac, done, tmp_path):
    """The same command uses what a process left that was killed with -9."""
    folder, out = write_small_task(tmp_path / "task"), tmp_path / "out"
    child = [sys.executable, "-c", KILLED, str(folder), str(out)]
    assert subprocess.run(child, check=False).returncode == -signal.SIGKILL
    kept = len(kept_in(out)[1])
    assert kept >= 3
    words = ["evaluate", "go-to-goal", "--task", folder, "--episodes", 6, "--out", out]
    with hold(out / LOCK_FILE):
        code, _, errors = tdac(*words)
    assert (code, "another evaluation is at work on" in errors) == (2, True)
    text = done(*words)
    assert f"{kept} finished episodes of an interrupted evaluation" in text
    assert len(pd.read_csv(out / "episodes.csv")) == 6


@pytest.mark.slow
def test_who_only_crashes_is_exit_1(tdac, rejected, controllers, tmp_path):
    """With the reason; beside a policy that drives, it is a row like others."""
    folder = write_small_task(tmp_path / "task")
    words = ["evaluate", controllers / "three.py", "--task", folder, "--episodes", 2]
    text = rejected(*words)
    assert "must return two finite numbers" in " ".join(text.split())
    assert text.splitlines()[-1] == "every policy crashed in every episode"
    assert tdac(*words, "random")[0] == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["plan.png"], "no policy: give files, run folders"),
        (["syntax.py"], r"'syntax.py' is not a controller: .*'\(' was never closed"),
        (["image.py"], "'image.py' is not a controller: the source does not parse"),
        (["none.py"], "'none.py' is not a controller: it defines no function policy"),
        (["os.py"], "that tdac verify accepts: line 1: import of 'os'; allowed modul"),
        (["reference", "reference"], "the policy 'reference' is given twice"),
        (["referenc"], "no policy 'referenc': .*did you mean 'reference'"),
        (["empty"], "no controller.py in 'empty'"),
        (
            ["world"],
            "world was written for TDAC-EPuck-v0; the task 'maze' is of TDAC-M",
        ),
        (["text.zip"], "'text.zip' is not a stable-baselines3 policy"),
        (["plain.zip"], "does not say which observations .* --wrapper NAME"),
        (["random", "--wrapper", "flat"], "unknown wrapper 'flat'; expected some of"),
        (["random", "--wrapper", "none", "--wrapper", "flatten"], "cannot be combined"),
        (["random", "--csv", "no/where.csv"], "cannot write no/where.csv"),
        (["random", "--task", "maze", "--task", "maze"], "two tasks are called 'maze'"),
        (["random", "--tier", "strong"], "unknown sandbox tier 'strong'"),
    ],
)
def test_usage_errors_are_one_line(refused, words, message, tmp_path):
    """Said before anything is driven, with exit code 2."""
    here = tmp_path / "here"
    (here / "empty").mkdir()
    (here / "world").mkdir()
    (here / "world" / "task.yaml").write_text("env: TDAC-EPuck-v0")
    (here / "world" / "controller.py").write_text("def policy(obs): return 0, 0")
    (here / "text.zip").write_text("no zip")
    for name in ("plan.png", "image.py"):
        (here / name).write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    policy = "def policy(obs): return 0, 0"
    for name, source in (
        ("syntax.py", "def policy(obs:"),
        ("none.py", "x = 1"),
        ("os.py", f"import os\n{policy}"),
    ):
        (here / name).write_text(source)
    with zipfile.ZipFile(here / "plain.zip", "w") as archive:
        weights = io.BytesIO()
        with zipfile.ZipFile(weights, "w") as inner:
            inner.writestr("archive/data.pkl", pickle.dumps({}, protocol=2))
        archive.writestr("data", "{}")
        archive.writestr("policy.pth", weights.getvalue())
    errors = refused("evaluate", *words)
    assert re.search(message, errors)


def test_it_is_there_from_python(tmp_path):
    """`tdac_agent.evaluate` takes names of tasks, too, and refuses nonsense."""
    assert tdac_agent.evaluate is evaluate
    task = load_task(write_small_task(tmp_path / "task"))
    for wrong, match in (
        ({"policies": [], "tasks": [task]}, "at least one policy"),
        ({"policies": ["random"], "tasks": []}, "at least one task"),
        ({"policies": ["random"], "tasks": [task], "episodes": 0}, "episodes"),
        ({"policies": ["random"], "tasks": [task], "episodes": 10**18}, "to 1000000"),
        ({"policies": ["random"], "tasks": [task], "variation": "x"}, "variation"),
    ):
        with pytest.raises(TaskError, match=match):
            evaluate(**wrong)
