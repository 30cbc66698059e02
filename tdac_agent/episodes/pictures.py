"""Pictures of episodes in any environment."""

from __future__ import annotations

from tdac_agent.tasks.parts import Pictures
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import Setting


def pictures_of(setting: Setting) -> Pictures:
    """Returns an object that draws a task's episodes."""
    return environment(setting.nominal.env_id).pictures(setting)
