"""An environment of somebody else's: a robot whose wheels are connected crosswise."""

from pathlib import Path

from tdac_agent.environments.map2d.entry import Map2DEnvironment
from tdac_agent.environments.map2d.setting import Map2DSetting, open_map_task
from tdac_envs.map2d.env import Map2DEnv


class CrossedEnv(Map2DEnv):
    """The first entry of an action is the right wheel's."""

    def step(self, action):
        return super().step(action[::-1])


class CrossedSetting(Map2DSetting):
    def make_env(self, **options):
        return CrossedEnv(**{**self.env_kwargs(), **options})


class Crossed(Map2DEnvironment):
    id = "Toy-Crossed-v0"
    folder = Path(__file__).parent

    def open(self, spec, base):
        name, own = open_map_task(spec, base)
        parts = own.params, own.nominal, own.image, own.robot_image
        return name, CrossedSetting(*parts)


CROSSED = Crossed()
