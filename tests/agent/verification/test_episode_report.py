"""Reports of many episodes: those of earlier versions are read, too."""

import json

import pytest

from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.store import read_report

TEST = {"accept_at": 0.9, "limit": 100, "margin": 0.05, "alpha": 0.05, "beta": 0.05}
RATES = {"rate": 0.9, "accepted": 0.9, "rejected": 0.05, "undecided": 0.05}
RATES |= {"mean_episodes": 40.0}
COMMON = {
    "controller_sha256": "c",
    "sandbox": "bubblewrap",
    "limits": {"cpu_seconds": 9.0},
    "versions": {"tdac": "0.1.0"},
}
SEED = {"outcome": "reached", "steps": 9, "collisions": 0, "d0": 50.0, "d_min": 2.0}
SEED |= {"cause": None, "step": None, "x": None, "y": None, "side": None}
ROBUST = {
    "schema_version": 1,
    "provenance": {
        **COMMON,
        "task": "maze",
        "task_sha256": "t",
        "unit": "px",
        "map_sha256": "m",
        "params_sha256": "p",
        "sensors_sha256": "s",
        "disturbance": {"range_noise": 0.025, "delay": 1},
        "first_seed": 7,
    },
    "episodes": 3,
    "successes": 2,
    "rate": 2 / 3,
    "interval": {"low": 0.1, "high": 0.9, "confidence": 0.95},
    "outcomes": {"reached": 2, "collision": 1},
    "time_outs": 0,
    "failed_seeds": [8],
    "worst": [
        {
            **SEED,
            "seed": 8,
            "outcome": "collision",
            "collisions": 1,
            "cpu_seconds": 1.0,
        },
        {**SEED, "seed": 7, "cpu_seconds": 1.0},
    ],
    "child_cpu_seconds": 3.0,
    "seconds": 1.0,
}
WORLD = {
    "index": 0,
    "generator": "rooms",
    "outcome": "reached",
    "steps": 9,
    "horizon": 90,
    "time_score": 0.5,
    "path_score": 0.6,
    "barn_score": 0.4,
    "d_min": 1.0,
    "length": 40.0,
    "least_steps": 5.0,
    "gap": 1.2,
    "detour": 1.0,
    "in_sight": 0.5,
    "density": 0.2,
    "cpu_seconds": 0.1,
}
ON_SET = {
    "schema_version": 1,
    "provenance": {**COMMON, "set": "known", "set_sha256": "k", "split": "dev"},
    "tests": {"test_source_parses": "passed"},
    "worlds": 1,
    "successes": 1,
    "interval": {"low": 0.1, "high": 1.0, "confidence": 0.95},
    "scores": {"success": 1.0, "time": 0.5, "path": 0.6, "barn": 0.4},
    "by_generator": {},
    "causes": {},
    "told": [],
    "episodes": [WORLD],
    "sequential": {
        "decision": "accepted",
        "test": TEST,
        "refuse_at": 0.85,
        "at_refused_rate": RATES,
        "at_accepted_rate": RATES,
    },
    "child_cpu_seconds": 0.1,
    "seconds": 1.0,
}


@pytest.mark.parametrize(
    ("file", "values", "counts", "numbers"),
    [("robust.json", ROBUST, (3, 2), [8, 7]), ("set.json", ON_SET, (1, 1), [0])],
)
def test_files_of_version_1_are_read(tmp_path, file, values, counts, numbers):
    """By name, and what is written of them is read again."""
    (tmp_path / file).write_text(json.dumps(values))
    report = read_report(tmp_path)
    assert (report.count, report.successes) == counts
    assert [each.number for each in report.episodes] == numbers
    assert report.provenance.name in ("maze", "known")
    assert len(report.failures) == counts[0] - counts[1]
    assert EpisodeReport.model_validate_json(report.model_dump_json()) == report


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"failed_seeds": 1}', "\udcff"])
def test_a_file_that_is_none_is_no_report(tmp_path, text):
    """Whatever a folder has under this name."""
    (tmp_path / "set.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    assert read_report(tmp_path) is None
    assert read_report(tmp_path / "nowhere") is None
