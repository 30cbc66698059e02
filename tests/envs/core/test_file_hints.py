"""What errors suggest."""

import pytest

from tdac_envs.core.errors import MapError, TaskError, WorldError, file_hint
from tdac_envs.ladder.task_sets import load_set
from tdac_envs.map2d.source import prepare
from tdac_envs.mapping.map_files import load_image
from tdac_envs.worlds.wbt.reader import load_world


@pytest.mark.parametrize(
    ("there", "typed", "named"),
    [
        (["arena.wbt", "maze.wbt"], "mace.wbt", "maze.wbt"),
        (["plan.yml"], "plan.yaml", "plan.yml"),
        (["plan-2.png", "plan-2.txt"], "plan2.png", "plan-2.png"),
        (["office.png"], "cellar.png", None),
        ([], "map.png", None),
    ],
)
def test_a_file_beside_the_one_that_is_missing_is_named(tmp_path, there, typed, named):
    """One with a similar name, or with the same name and another suffix."""
    for name in there:
        (tmp_path / name).touch()
    said = f" (did you mean {str(tmp_path / str(named))!r}?)" if named else ""
    assert file_hint(tmp_path / typed) == said
    assert file_hint(tmp_path / "no folder" / typed) == ""


@pytest.mark.parametrize(
    ("read", "name", "error"),
    [
        (prepare, "plan.png", MapError),
        (load_image, "plan.yaml", MapError),
        (load_world, "plan.wbt", WorldError),
        (load_set, "plan.yaml", TaskError),
    ],
)
def test_readers_of_files_name_it(tmp_path, read, name, error):
    (tmp_path / name.replace("plan", "plans")).touch()
    with pytest.raises(error, match=r"did you mean '.*plans\.\w+'\?"):
        read(tmp_path / name)
