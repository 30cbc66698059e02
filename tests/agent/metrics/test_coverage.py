"""How often the intervals hold what they are made for: computed, whatever it is."""

import pytest
from numpy.testing import assert_allclose

from benchmarks.coverage import exact_coverage, kaplan_meier_coverage, rate_coverage

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("runs", [5, 10, 20])
def test_the_exact_interval_holds_it_at_least_as_often_as_it_says(runs):
    """For any probability; summed over all outcomes."""
    for percent in range(2, 100, 4):
        assert exact_coverage(percent / 100, runs) >= 0.95


def test_resampled_runs_are_too_narrow_when_few():
    """As the stated assumption warns; with 20 runs it is near to what it says."""
    few, many = rate_coverage(0.5, 5, trials=400), rate_coverage(0.5, 20, trials=400)
    assert few < many
    assert 0.85 <= many <= 0.99


def test_kaplan_meier_is_near_to_what_it_says():
    """With every fourth iteration stopped by something else."""
    assert_allclose(kaplan_meier_coverage(0.4, 20, 0.25, trials=400), 0.95, atol=0.05)
