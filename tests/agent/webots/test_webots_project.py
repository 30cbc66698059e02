"""What a Webots controller gets of its project, and that it gets nothing else."""

import os

import pytest
from worlds_for_controllers import OPEN

from tdac_agent.sandbox.inner.program import PROJECT
from tdac_agent.webots.copying import DEEPEST, MOST_NOTES, Copier, NoSpaceError
from tdac_agent.webots.project import copier_of, copy_files, copy_folders, has_module
from tdac_agent.webots.run import run_controller
from tdac_envs.webots.stage import open_stage

STEP = "from controller import Robot\nRobot().step(32)\n"


@pytest.fixture
def project(tmp_path):
    """A function of files by path, that makes a project with a secret beside it."""
    (tmp_path / "secret.py").write_text("KEY = 7\n")

    def make(files):
        for name, content in files.items():
            path = tmp_path / "project" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content)
        return tmp_path / "project"

    return make


@pytest.fixture
def run(project):
    """A function of a program and further files; returns the report."""

    def run(program, **files):
        root = project({"controllers/mine/mine.py": program, "w.wbt": OPEN} | files)
        stage = open_stage(root / "w.wbt")
        path = root / "controllers" / "mine" / "mine.py"
        return run_controller(path, stage, stage.make_env(steps=2)).report

    return run


def copied(root, tmp_path):
    """What is copied of a project to the folder of `controllers/mine/mine.py`."""
    controller, work = root / "controllers" / "mine" / "mine.py", tmp_path / "work"
    work.mkdir()
    copier = copier_of(controller)
    copy_files(work, controller, copier)
    copy_folders(work, controller, copier)
    return sorted(p.name for p in work.rglob("*") if p.is_file()), copier.notes


def test_the_libraries_of_the_project_can_be_imported(run):
    """Packages, modules of their folders; a note says what Webots needs for it."""
    files = {
        "libraries/kit/__init__.py": "from kit.inner import ONE\n",
        "libraries/kit/inner.py": "ONE = 1\n",
        "libraries/bare/two.py": "TWO = 2\n",
    }
    report = run(f"import kit, two\nprint(kit.ONE, two.TWO)\n{STEP}", **files)
    assert (report.error, report.output) == (None, "1 2\n")
    assert any("runtime.ini" in note for note in report.notes)


def test_paths_within_the_project_are_as_in_webots(run):
    """`../OTHER` and `../../libraries` lead to other controllers and to libraries."""
    program = (
        "import os, sys\nsys.path.append('..')\nfrom other import shared\n"
        "print(os.path.basename(os.getcwd()), shared.THREE,"
        " open('../../libraries/data.txt').read())\n"
    )
    files = {
        "controllers/other/shared.py": "THREE = 3\n",
        "controllers/other/large.csv": "1,2\n",
        "libraries/data.txt": "four",
    }
    report = run(program + STEP, **files)
    assert (report.error, report.output) == (None, "mine 3 four\n")


def test_a_library_hides_no_other_module(run):
    """A library called as a module of Python or of tdac is not imported instead."""
    trap = dict.fromkeys(
        ("libraries/json.py", "libraries/random/__init__.py", "libraries/controller.py",
         "libraries/numpy/__init__.py"),
        "print('trap')\nraise SystemExit\n",
    )  # fmt: skip
    report = run(f"import json, random, numpy\nprint(json.dumps(1))\n{STEP}", **trap)
    assert (report.error, report.output) == (None, "1\n")


def test_a_module_elsewhere_in_the_project_is_named(run):
    """The error says where it is, and does not advise to install it."""
    report = run(f"import tools\n{STEP}", **{"controllers/tools/__init__.py": ""})
    assert "controllers/tools of the project is not on Python's path" in report.error
    assert "pip" not in report.error


def test_links_out_of_the_project_are_left_out(project, tmp_path):
    """Files and folders, beside the controller and in libraries; notes name them."""
    root = project({"controllers/mine/mine.py": "", "libraries/good.py": ""})
    for place in ("controllers/mine", "libraries"):
        (root / place / "key.py").symlink_to(tmp_path / "secret.py")
        (root / place / "all").symlink_to(tmp_path)
        (root / place / "root").symlink_to("/")
    names, notes = copied(root, tmp_path)
    assert names == ["good.py", "mine.py"]
    told = [
        note for note in notes if "a link that leads out of the copied folders" in note
    ]
    assert len(told) == 6


def test_a_project_may_be_in_a_home(project, tmp_path):
    """Links to other files of the project's folder, such as keys, are left out, too."""
    root = project({"controllers/mine/mine.py": "", ".ssh/id": "", "data.txt": ""})
    (root / "libraries").mkdir()
    (root / "libraries" / "id").symlink_to("../.ssh/id")
    (root / "controllers" / "mine" / "data").symlink_to("../../data.txt")
    (root / "controllers" / "mine" / "home").symlink_to("../..")
    names, notes = copied(root, tmp_path)
    assert (names, len(notes)) == (["mine.py"], 3)


def test_a_whole_folder_of_libraries_may_be_a_link(project, tmp_path):
    """It is left out, too, if it leads out of the copied folders."""
    root = project({"controllers/mine/mine.py": ""})
    (root / "libraries").symlink_to(tmp_path)
    names, notes = copied(root, tmp_path)
    assert names == ["mine.py"]
    assert "libraries is not copied" in notes[0]


def test_links_in_the_project_are_followed_but_not_without_end(project, tmp_path):
    """Links to folders above, and to themselves, copy nothing."""
    root = project({"controllers/mine/mine.py": "", "libraries/good.py": ""})
    (root / "controllers" / "mine" / "same.py").symlink_to("../../libraries/good.py")
    (root / "libraries" / "itself").symlink_to("itself")
    (root / "libraries" / "kit").mkdir()
    for name in ("a", "b", "c"):
        (root / "libraries" / name).symlink_to(".")
        (root / "libraries" / "kit" / name).symlink_to("..")
    names, notes = copied(root, tmp_path)
    assert (names, len(notes)) == (["good.py", "mine.py", "same.py"], 1)


def test_only_files_are_copied(project, tmp_path):
    """Pipes are not opened; a file that is too large leaves its folder out."""
    root = project({"controllers/mine/mine.py": "", "libraries/good.py": ""})
    os.mkfifo(root / "libraries" / "pipe.py")
    os.mkfifo(root / "controllers" / "mine" / "pipe.py")
    (root / "controllers" / "large").mkdir()
    with (root / "controllers" / "large" / "large.py").open("wb") as file:
        file.truncate(1 << 30)
    names, notes = copied(root, tmp_path)
    assert names == ["good.py", "mine.py"]
    assert any("controllers/large is not copied" in note for note in notes)


def test_names_that_the_sandbox_uses_itself_are_left_out(run, tmp_path):
    """Files and folders called as the package `controller`, or as the project."""
    names = ("controllers/mine/controller", "controllers/mine/" + PROJECT,
             "controllers/controller/x.py", "controllers/mine/build/x.py")  # fmt: skip
    assert run(STEP, **dict.fromkeys(names, "x")).error is None


def test_a_deep_folder_is_cut_off(project, tmp_path):
    """A note says where."""
    deep = "libraries/" + "d/" * DEEPEST
    root = project(
        {"controllers/mine/mine.py": "", f"{deep}/d/x.py": "", f"{deep}y": ""}
    )
    names, notes = copied(root, tmp_path)
    assert names == ["mine.py", "y"]
    assert f"more than {DEEPEST} folders deep" in notes[0]


def test_notes_are_few_and_printable(tmp_path):
    """Names may have escapes; a thousand links are not a thousand notes."""
    copier = Copier(tmp_path, (tmp_path,))
    for k in range(99):
        link = tmp_path / f"\x1b[31m{k}.py"
        link.symlink_to("/etc/hostname")
        copier.file(link, tmp_path / "copy")
    assert len(copier.notes) == MOST_NOTES + 1
    assert all(note.isprintable() for note in copier.notes)


def test_the_room_is_for_all_files_together(tmp_path):
    """What no longer fits raises; a folder that does not fit takes no room."""
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "x").write_text("12345")
    copier = Copier(tmp_path, (tmp_path,), room=9)
    copier.file(tmp_path / "in" / "x", tmp_path / "x")
    assert not copier.folder(tmp_path / "in", tmp_path / "out")
    assert (copier.room, (tmp_path / "out").exists()) == (4, False)
    with pytest.raises(NoSpaceError):
        copier.file(tmp_path / "in" / "x", tmp_path / "y")


def test_where_a_project_has_a_module(project):
    """In other controllers, libraries, or at its top; nowhere without a project."""
    root = project(
        {"libraries/kit.py": "", "top.py": "", "controllers/a/__init__.py": ""}
    )
    places = [has_module(root, name) for name in ("kit", "top", "a", "numpy")]
    assert places == ["libraries/kit.py", "top.py", "controllers/a", ""]
    assert has_module(None, "kit") == ""
