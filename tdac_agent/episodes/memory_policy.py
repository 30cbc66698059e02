"""A recurrent policy that acts on its memory and on the present observation.

Needs the extra `tdac[sb3]`, so import this module only where it is used.
"""

from __future__ import annotations

from typing import Any

import torch
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor

_States = tuple[torch.Tensor, torch.Tensor]
"""Hidden and cell states, each (layers, sequences, units)."""


class MemoryPolicy(RecurrentActorCriticPolicy):
    """sb3-contrib's `MlpLstmPolicy`, whose layers see the observation, too.

    Without this, all that the robot sees has to pass through the memory. The critic
    needs an LSTM: its own, or that of the actor.
    """

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = MlpExtractor(
            self.features_dim + self.lstm_output_dim,
            net_arch=self.net_arch,
            activation_fn=self.activation_fn,
            device=self.device,
        )

    @staticmethod
    def _process_sequence(  # type: ignore[override]  # its annotation is wrong
        features: torch.Tensor,
        lstm_states: _States,
        episode_starts: torch.Tensor,
        lstm: Any,
    ) -> tuple[torch.Tensor, _States]:
        """Runs an LSTM along sequences that begin at most one episode, at their start.

        sb3-contrib's buffer cuts them so. Its own function calls the LSTM once per step
        if an episode starts in any sequence, which takes up to twenty times as long.

        Args:
            features: Shape (sequences * steps, features), sequence after sequence.
            lstm_states: States before the first steps.
            episode_starts: Shape (sequences * steps,); 1 only at first steps.
            lstm: The LSTM.

        Returns:
            Features and outputs, shape (sequences * steps, features + units), and the
            states after the last steps.
        """
        hidden, cell = lstm_states
        count = hidden.shape[1]
        kept = 1.0 - episode_starts.reshape(count, -1)[:, 0].view(1, count, 1)
        steps = features.reshape(count, -1, lstm.input_size).swapaxes(0, 1)
        outputs, after = lstm(steps, (kept * hidden, kept * cell))
        memory = outputs.swapaxes(0, 1).flatten(end_dim=1)
        return torch.cat([features, memory], dim=1), after
