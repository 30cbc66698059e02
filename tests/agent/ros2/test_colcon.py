"""`colcon`, the build tool of ROS 2, builds an exported package."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from tdac_agent.ros2.package.worker import check_files

COLCON = (
    *("colcon-core", "colcon-ros", "colcon-python-setup-py", "colcon-output"),
    *("colcon-library-path", "colcon-package-selection", "colcon-recursive-crawl"),
    "setuptools<80",
)


@pytest.mark.slow
def test_colcon_builds_it(package, tmp_path):
    """The installed package has the node, the launch files and the controller."""
    name = json.loads((package / "controller" / "settings.json").read_text())["package"]
    venv, ws = tmp_path / "venv", tmp_path / "ws"
    subprocess.run([sys.executable, "-m", "venv", venv], check=True)
    words = "-m", "pip", "install", "--quiet", *COLCON
    if subprocess.run([venv / "bin/python", *words], check=False).returncode:
        pytest.skip("colcon cannot be installed")
    shutil.copytree(package, ws / "src" / name)
    done = subprocess.run(
        [venv / "bin/colcon", "build", "--packages-select", name],
        capture_output=True, text=True, check=False, cwd=ws,
        env={**os.environ, "PATH": f"{venv / 'bin'}:{os.environ['PATH']}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    out = ws / "install" / name
    assert os.access(out / "lib" / name / "drive", os.X_OK)
    share = out / "share" / name
    check_files(share / "controller")
    expected = {
        *("package.xml", "README.md", "config/drive.yaml", "maps/map.yaml"),
        *("launch/drive.launch.py", "launch/smoother.launch.py", "rviz/drive.rviz"),
    }
    assert {file for file in expected if (share / file).is_file()} == expected
    index = out / "share" / "ament_index" / "resource_index" / "packages" / name
    assert index.is_file()
