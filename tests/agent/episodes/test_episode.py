"""What is reckoned of one episode."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tdac_agent.episodes.episode import late

TIMES = st.floats(0.0, 1e4)


@given(arrays(np.float64, st.integers(1, 300), elements=TIMES))
def test_the_late_calls_are_numpys_percentile(times):
    """Between two calls where the percentile falls between them."""
    assert late(times) == pytest.approx(float(np.percentile(times, 99)))
