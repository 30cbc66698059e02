"""Tables of a user's folder: read as they are, or refused in one line."""

import os
from pathlib import Path

import pandas as pd
import pytest

from tdac_agent.bench.shown import _table as read_bench
from tdac_agent.errors import RunError
from tdac_agent.metrics import load_reported
from tdac_agent.storage.csv_file import read_rows
from tdac_agent.training.curve import CURVE_FILE, read_curve

CURVE = (
    "steps,seconds,success_rate,collision_rate,mean_return,mean_length,"
    "train_success_rate"
)
WORLDS = "set,entrant,file,success,index,time_score"
TABLES = {
    "worlds.csv": (WORLDS, "known,builtin,0,True,4,0.5", read_bench),
    CURVE_FILE: (CURVE, "10,1.5,0.5,0.1,2.0,30.0,0.4", read_curve),
    "paper.csv": ("task,tau", "maze,1 2", lambda at: load_reported(at / "paper.csv")),
}


def missing(path, heading, row):
    wrong = heading.replace("success,", "other,").replace("tau", "x")
    path.write_text(f"{wrong.replace('steps', 'other')}\n{row}\n")


def short(path, heading, row):
    path.write_text(f"{heading}\n{row.rpartition(',')[0]}\n")


def twice_named(path, heading, row):
    path.write_text(f"{heading},{heading.partition(',')[0]}\n{row},1\n")


def no_text(path, heading, row):
    path.write_bytes(f"{heading}\n{row}".encode() + b"\xff\n")


def quoted(path, heading, row):
    path.write_text(f'{heading}\n"{row}\n')


def sparse(path, heading, row):
    path.touch()
    os.truncate(path, 8 * 10**9)


def pipe(path, heading, row):
    os.mkfifo(path)


def device(path, heading, row):
    path.symlink_to("/dev/zero")


ATTACKS = (missing, short, twice_named, no_text, quoted, sparse, pipe, device)


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("attack", ATTACKS, ids=lambda one: one.__name__)
def test_a_table_is_refused(tmp_path, name, attack):
    """One line that names the file, whatever is wrong; the whole one is read."""
    heading, row, read = TABLES[name]
    (tmp_path / name).write_text(f"{heading}\n{row}\n")
    assert read(tmp_path) is not None
    (tmp_path / name).unlink()
    attack(tmp_path / name, heading, row)
    with pytest.raises(RunError, match=name) as caught:
        read(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ("known,builtin,0,False,4,0.25", "line 3: a second row for set known"),
        ("known,builtin,0,x,5,0.25", "could not convert string to float"),
        ("known,builtin,0,True,5,", "a row without success or time_score"),
        ("known,builtin,0,True,5,1", ""),
    ],
)
def test_rows_of_a_bench(tmp_path, row, problem):
    """A second row for an episode, or one without figures, would count as another."""
    heading, whole, read = TABLES["worlds.csv"]
    (tmp_path / "worlds.csv").write_text(f"{heading}\n{whole}\n{row}\n")
    if problem:
        with pytest.raises(RunError, match=problem):
            read(tmp_path)
    else:
        assert len(read(tmp_path)) == 2


def test_values_are_kept_as_they_are(tmp_path):
    """Line ends within quotes, a comma, an empty value; as pandas wrote them."""
    table = pd.DataFrame({"a": ["x,y", 'z"', "two\nlines"], "b": ["", "é", "1"]})
    table.to_csv(tmp_path / "t.csv", index=False)
    assert read_rows(tmp_path / "t.csv") == table.to_dict("records")
    assert read_rows(Path(tmp_path / "t.csv"), ["a"], ["a", "b"])[0]["a"] == "x,y"
