"""Retirement dates of models: who is named, from when on, and with which successor."""

from datetime import timedelta

import pytest

from tdac_agent.models.lifecycle import (
    SOON_DAYS,
    load_lifecycle,
    model_warnings,
    retired,
)
from tdac_agent.models.prices import load_prices

ENDS = load_lifecycle().ends


@pytest.mark.parametrize("model", list(ENDS))
def test_dates_decide(model):
    """A model is named from SOON_DAYS before its date, and retired on that date."""
    end = ENDS[model]
    assert retired([model], end) == [model]
    assert retired([model], end - timedelta(days=1)) == []
    assert retired([model], end - timedelta(days=30), within_days=30) == [model]
    assert retired([model], end - timedelta(days=31), within_days=30) == []
    (late,) = model_warnings([model, model], end)
    assert f"{model} was retired on {end}" in late
    (soon,) = model_warnings([model], end - timedelta(days=SOON_DAYS))
    assert f"{model} will be retired on {end}" in soon
    assert model_warnings([model], end - timedelta(days=SOON_DAYS + 1)) == []


def test_a_model_without_a_date_is_not_named():
    assert model_warnings(["openai:nobody"]) == retired(["openai:nobody"]) == []


def test_successors_stay():
    """A successor has a price and no date; the warning about the old model names it."""
    successors = load_lifecycle().successors
    assert successors
    for model, successor in successors.items():
        assert successor in load_prices().models
        assert successor not in ENDS
        assert model_warnings([model], ENDS[model]) == [
            f"{model} was retired on {ENDS[model]} (as of {load_lifecycle().dated}); "
            f"its successor is {successor}"
        ]
