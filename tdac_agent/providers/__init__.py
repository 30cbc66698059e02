"""Who may be asked to write controllers, chosen by a string such as `openai:MODEL`."""

from tdac_agent.providers.choice import Options, choose_model, choose_models

__all__ = ["Options", "choose_model", "choose_models"]
