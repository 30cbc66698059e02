"""Runs a controller in a world, in the sandbox."""

from pathlib import Path

import pytest

from tdac_agent.webots.run import LIMITS, run_controller
from tdac_envs.webots.stage import open_stage

CONTROLLERS = Path(__file__).parent / "controllers"


@pytest.fixture
def drive(tmp_path):
    """A function of a controller (its name here, or its text) and a world's text."""

    def run(controller, world, steps=None, files=(), limits=LIMITS, **options):
        folder = tmp_path / "mine"
        folder.mkdir(exist_ok=True)
        source = controller
        if "\n" not in controller:
            source = (CONTROLLERS / f"{controller}.py").read_text()
        (folder / "mine.py").write_text(source)
        for name, content in dict(files).items():
            (folder / name).write_text(content)
        file = tmp_path / "world.wbt"
        file.write_text(world)
        stage = open_stage(file, options.pop("goal", None))
        env = stage.make_env(steps=steps, **options)
        return run_controller(folder / "mine.py", stage, env, limits=limits)

    return run
