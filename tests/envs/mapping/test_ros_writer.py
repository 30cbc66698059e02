"""A grid as a ROS map is the same grid when it is read back."""

import numpy as np
import pytest

from tdac_envs import MapError, OccupancyGrid, preprocess
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.ros_writer import write_ros_map


def test_it_is_read_back(tmp_path):
    """Also by `preprocess`, with resolution and origin."""
    rng = np.random.default_rng(0)
    cells = rng.random((40, 60)) < 0.3
    origin = (-1.5, 2.25, 0.1)
    yaml, picture = write_ros_map(tmp_path, OccupancyGrid(cells), 0.05, origin)
    assert (yaml.name, picture.name) == ("map.yaml", "map.pgm")
    image = load_image(yaml)
    np.testing.assert_array_equal(image.occupied, cells)
    assert (image.resolution, image.origin) == (0.05, origin)
    grid, params = preprocess(yaml)
    np.testing.assert_array_equal(grid.cells, cells)
    assert params.resolution == 0.05


def test_a_folder_that_cannot_be_written(tmp_path):
    grid = OccupancyGrid(np.zeros((9, 9), bool))
    with pytest.raises(MapError, match="cannot be written"):
        write_ros_map(tmp_path / "missing", grid, 0.05)
