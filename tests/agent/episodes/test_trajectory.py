"""Trajectories on disk: they come back as they were, or are refused in one line."""

import io
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from damage import torn
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import RunError
from tdac_agent.verification.verify import load_trajectories

ARRAYS = ("poses", "actions", "path_distances", "ranges")
STEPS = 20


@pytest.fixture(scope="module")
def trajectory():
    """An episode of 20 steps with 3 rays."""
    random = np.random.default_rng(0)
    return Trajectory(
        random.normal(size=(STEPS + 1, 3)),
        random.normal(size=(STEPS, 2)).astype(np.float32),
        random.random(STEPS + 1),
        random.random((STEPS + 1, 3)).astype(np.float32),
        2,
        0.05,
    )


@pytest.fixture(scope="module")
def whole(trajectory, tmp_path_factory):
    """Bytes of its file."""
    path = tmp_path_factory.mktemp("trajectory") / "nominal.npz"
    trajectory.save(path)
    return path.read_bytes()


@pytest.fixture(scope="module")
def moving(trajectory):
    """The same episode with two movers."""
    discs = np.random.default_rng(1).random((STEPS + 1, 2, 3)).astype(np.float32)
    return replace(trajectory, movers=discs)


def same(one, other):
    """Equal to the last bit, types included."""
    if (one.movers is None) != (other.movers is None):
        return False
    names = ARRAYS if one.movers is None else (*ARRAYS, "movers")
    pairs = [(getattr(one, name), getattr(other, name)) for name in names]
    exact = all(a.dtype == b.dtype and np.array_equal(a, b) for a, b in pairs)
    return exact and (one.collisions, one.dt) == (other.collisions, other.dt)


def test_a_trajectory_comes_back(trajectory, whole, tmp_path):
    """Saved and loaded, every number and type is the same."""
    (tmp_path / "nominal.npz").write_bytes(whole)
    assert same(load_trajectories(tmp_path)["nominal"], trajectory)


def test_movers_come_back(moving, whole, tmp_path):
    """A file has them if, and only if, there were any."""
    moving.save(tmp_path / "nominal.npz")
    assert same(load_trajectories(tmp_path)["nominal"], moving)
    assert "movers.npy" in zipfile.ZipFile(tmp_path / "nominal.npz").namelist()
    assert "movers.npy" not in zipfile.ZipFile(io.BytesIO(whole)).namelist()


@pytest.mark.parametrize("shape", [(STEPS, 2, 3), (STEPS + 1, 2, 2), (STEPS + 1, 3)])
def test_movers_of_another_shape(trajectory, tmp_path, shape):
    """They are refused."""
    replace(trajectory, movers=np.zeros(shape, np.float32)).save(tmp_path / "x.npz")
    with pytest.raises(RunError, match="expected movers as floats"):
        Trajectory.load(tmp_path / "x.npz")


def check(trajectory, whole, folder, data):
    raw = whole
    for _ in range(data.draw(st.integers(1, 3))):
        raw = data.draw(torn(raw))
    path = folder / "torn.npz"
    path.write_bytes(raw)
    try:
        loaded = Trajectory.load(path)
    except RunError as error:
        reason = str(error)
    else:
        assert same(loaded, trajectory)
        return
    assert "\n" not in reason
    assert reason.startswith(f"{path} is not a trajectory: ")
    assert not reason.endswith(": ")


@pytest.mark.slow
@settings(deadline=None, max_examples=200)
@given(st.data())
def test_a_torn_trajectory(trajectory, whole, tmp_path_factory, data):
    """It is refused with one line, or nothing that matters was hit."""
    check(trajectory, whole, tmp_path_factory.getbasetemp(), data)


@pytest.mark.slow
@settings(deadline=None, max_examples=10_000)
@given(st.data())
def test_many_torn_trajectories(trajectory, whole, tmp_path_factory, data):
    """The same, often."""
    check(trajectory, whole, tmp_path_factory.getbasetemp(), data)


def repacked(whole, **changes):
    """The file with some arrays changed, or taken out where None."""
    with np.load(io.BytesIO(whole)) as data:
        arrays = {**data, **changes}
    file = io.BytesIO()
    np.savez(file, **{k: v for k, v in arrays.items() if v is not None})
    return file.getvalue()


@pytest.mark.parametrize(
    "changes",
    [
        {"schema_version": 2},
        {"poses": None},
        {"poses": np.zeros((STEPS, 3))},
        {"poses": np.zeros((STEPS + 1, 2))},
        {"poses": np.zeros((STEPS + 1, 3), int)},
        {"poses": np.array("text")},
        {"poses": np.array([1.0, None])},
        {"actions": np.zeros((STEPS + 1, 2))},
        {"path_distances": np.zeros(STEPS)},
        {"ranges": np.zeros(STEPS + 1)},
        {"ranges": np.zeros(())},
        {"collisions": np.zeros(2)},
        {"dt": np.array("text")},
    ],
)
def test_arrays_that_do_not_belong_together(whole, tmp_path, changes):
    """A file of another version, or with other arrays than `save` writes, is none."""
    path = tmp_path / "a.npz"
    path.write_bytes(repacked(whole))
    Trajectory.load(path)
    path.write_bytes(repacked(whole, **changes))
    with pytest.raises(RunError, match=r"a\.npz is not a trajectory: ") as caught:
        Trajectory.load(path)
    assert "\n" not in str(caught.value)


def test_what_is_no_archive(tmp_path):
    """Missing files, folders, plain arrays and other archives are refused alike."""
    np.save(tmp_path / "array.npy", np.zeros(3))
    (tmp_path / "folder").mkdir()
    with zipfile.ZipFile(tmp_path / "other.npz", "w") as archive:
        archive.writestr("poses.npy", b"\x93NUMPY\x01\x00\xff\xff{")
    for name in ("missing", "array.npy", "folder", "other.npz"):
        with pytest.raises(RunError, match="is not a trajectory: "):
            Trajectory.load(tmp_path / name)
