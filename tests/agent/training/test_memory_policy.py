"""The recurrent policy whose layers see the observation, too."""

from importlib.util import find_spec

import pytest

pytestmark = pytest.mark.skipif(
    find_spec("sb3_contrib") is None, reason="no sb3_contrib"
)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "steps"), [(5, 12), (5, 1), (1, 12)])
def test_its_memory_is_that_of_sb3_contrib(count, steps):
    """Outputs, states and gradients, if some sequences begin with an episode."""
    import torch  # slow to import
    from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy

    from tdac_agent.episodes.memory_policy import MemoryPolicy

    lstm = torch.nn.LSTM(7, 16)
    features = torch.rand(count * steps, 7)
    states = torch.rand(1, count, 16), torch.rand(1, count, 16)
    starts = torch.zeros(count, steps)
    starts[::2, 0] = 1.0
    found = []
    for kind, seen in ((RecurrentActorCriticPolicy, 0), (MemoryPolicy, 7)):
        lstm.zero_grad()
        outputs, after = kind._process_sequence(
            features, states, starts.flatten(), lstm
        )
        outputs.square().sum().backward()
        gradients = [each.grad.clone() for each in lstm.parameters()]
        found.append([outputs.detach()[:, seen:], *after, *gradients])
        assert torch.equal(outputs[:, :seen], features[:, :seen])
    for expected, got in zip(*found, strict=True):
        torch.testing.assert_close(got, expected, rtol=1e-4, atol=1e-5)
