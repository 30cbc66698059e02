"""ORCA beside pyrvo, an independent implementation in single precision."""

import numpy as np
import pytest

from tdac_envs.movers.orca import velocity_among

pyrvo = pytest.importorskip("pyrvo", reason="no wheel for this Python")

HORIZON, DT, FASTEST = 2.0, 0.1, 1.0


def scene(random):
    """Up to eleven discs in a hall or a throng, and a preferred velocity."""
    count = random.integers(2, 12)
    side = random.choice([3.0, 6.0, 12.0])
    places = random.uniform(-side, side, (count, 2))
    speeds = random.uniform(-1.0, 1.0, (count, 2)) * random.choice([0.5, 1.0])
    radii = random.uniform(0.3, 0.6, count)
    discs = np.column_stack([places, speeds, radii])
    preferred = random.uniform(-1.0, 1.0, 2)
    return discs.astype(np.float32).astype(float), np.float32(preferred).astype(float)


def simulator(discs):
    simulator = pyrvo.RVOSimulator()
    simulator.set_time_step(DT)
    for x, y, vx, vy, radius in discs.tolist():
        most = len(discs)
        simulator.add_agent(
            (x, y), 1000.0, most, HORIZON, HORIZON, radius, FASTEST, (vx, vy)
        )
    return simulator


def own_velocity(discs, first, preferred):
    """The velocity of one disc among the others, which come by their distances."""
    far = np.hypot(*(discs[:, :2] - discs[first, :2]).T)
    far[first] = -1.0
    out = np.empty(2)
    ordered = discs[np.argsort(far, kind="stable")]
    velocity_among(ordered, preferred, HORIZON, FASTEST, DT, out)
    return out


def differences(seeds):
    for seed in seeds:
        discs, preferred = scene(np.random.default_rng(seed))
        oracle = simulator(discs)
        oracle.set_agent_pref_velocity(0, tuple(preferred.tolist()))
        oracle.do_step()
        velocity = oracle.get_agent_velocity(0)
        found = own_velocity(discs, 0, preferred)
        yield np.abs(found - [velocity.x, velocity.y]).max()


def test_one_step():
    """Where many discs press, rounding may choose another corner: one in a thousand."""
    off = np.array(list(differences(range(2000))))
    assert (off > 1e-4).sum() <= 2


@pytest.mark.slow
def test_many_steps():
    off = np.array(list(differences(range(100_000))))
    assert (off > 1e-4).mean() <= 1e-3


@pytest.mark.parametrize("count", [2, 3, 4])
def test_discs_that_cross(count):
    """They walk across a circle, each to a goal a little off the opposite side."""
    angles = 2 * np.pi * np.arange(count) / count
    places, goals = (
        8.0 * np.column_stack([np.cos(each), np.sin(each)])
        for each in (angles, angles + np.pi + 0.4)
    )
    discs = np.column_stack([places, np.zeros((count, 2)), np.full(count, 0.5)])
    oracle = simulator(discs)
    nearest = np.inf
    for _ in range(200):
        wish = goals - discs[:, :2]
        far = np.maximum(np.hypot(*wish.T), 1.0)
        wish /= far[:, None]
        for k in range(count):
            oracle.set_agent_pref_velocity(k, tuple(wish[k].tolist()))
        oracle.do_step()
        chosen = [own_velocity(discs, k, wish[k]) for k in range(count)]
        discs[:, 2:4] = chosen
        discs[:, :2] += DT * discs[:, 2:4]
        between = discs[:, None, :2] - discs[None, :, :2]
        apart = np.hypot(*np.moveaxis(between, 2, 0))[np.triu_indices(count, 1)]
        nearest = min(nearest, apart.min())
        there = [oracle.get_agent_position(k) for k in range(count)]
        np.testing.assert_allclose(discs[:, :2], [(p.x, p.y) for p in there], atol=1e-3)
    assert 0.99 < nearest < 4.0
    assert np.hypot(*(discs[:, :2] - goals).T).max() < 0.2
