"""Installed packages and the files beside a Webots controller."""

import pytest
from worlds_for_controllers import OPEN

STEP = "from controller import Robot\nRobot().step(32)\n"


@pytest.mark.slow
def test_installed_packages_can_be_imported(drive):
    """Those of tdac's environment, without a screen: plots are drawn, windows not."""
    report = drive(
        "import cv2\nimport numpy as np\n"
        "import matplotlib\nmatplotlib.use('TkAgg')\n"
        "import matplotlib.pyplot as plt\n"
        "plt.plot([1, 2]); plt.show(); plt.pause(0.1); plt.savefig('plot.png')\n"
        "cv2.imshow('eye', np.zeros((3, 3, 3), np.uint8))\n"
        "print(cv2.waitKey(1), cv2.imread('plot.png').ndim)\n" + STEP,
        OPEN,
        steps=2,
    ).report
    assert report.error is None, report.traceback
    assert report.output.splitlines() == [
        "tdac: matplotlib.pyplot.show() is not supported; it has no effect",
        "tdac: matplotlib.pyplot.pause() is not supported; it has no effect",
        "tdac: cv2.imshow() is not supported; it has no effect",
        "tdac: cv2.waitKey() is not supported; it has no effect",
        "-1 3",
    ]


def test_packages_are_read_only(drive):
    """A controller cannot change what other programs import."""
    report = drive(
        "import os, yaml\n"
        "try:\n    open(os.path.join(os.path.dirname(yaml.__file__), 'x'), 'w')\n"
        "except OSError:\n    print('refused')\n" + STEP,
        OPEN,
        steps=2,
    ).report
    assert report.error is None, report.traceback
    assert report.output.split() == ["refused"]


@pytest.mark.parametrize(
    ("module", "package"), [("no_such", "no_such"), ("sklearnx", "sklearnx")]
)
def test_a_missing_package_is_named_with_its_command(drive, module, package):
    """The report says how to install it."""
    report = drive(f"import {module}.part\n" + STEP, OPEN, steps=2).report
    assert f"No module named '{module}'" in report.error
    assert f"pip install {package}, in the environment of tdac" in report.error


def test_subfolders_are_copied(drive, tmp_path):
    """A package in a folder beside the controller can be imported."""
    helpers = tmp_path / "mine" / "helpers"
    helpers.mkdir(parents=True)
    (helpers / "speed.py").write_text("FAST = 7\n")
    report = drive(
        "from helpers.speed import FAST\nprint(FAST)\n" + STEP, OPEN, steps=2
    ).report
    assert report.error is None, report.traceback
    assert report.output.split() == ["7"]
