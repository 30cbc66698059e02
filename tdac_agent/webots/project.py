"""The project of a Webots controller: which of its files the controller gets.

Webots starts a controller in `PROJECT/controllers/NAME`. The sandbox has the same
folders, so that `../../libraries` and `../OTHER` lead to the same files as in Webots.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from tdac_agent.errors import ControllerFileError
from tdac_agent.sandbox.inner.program import CONTROLLERS, LIBRARIES, PACKAGE, PROJECT
from tdac_agent.webots.copying import LARGEST, Copier, NoSpaceError

_NOT_COPIED = (PACKAGE, PROJECT, "__pycache__", "build")


def project_of(controller: Path) -> Path | None:
    """The project's folder, if the controller is in `PROJECT/controllers/NAME`."""
    above = controller.resolve().parent.parent
    return above.parent if above.name == CONTROLLERS else None


def copier_of(controller: Path) -> Copier:
    """A copier for the files that the controller may have."""
    project, own = project_of(controller), controller.resolve().parent
    if project is None:
        return Copier(own, (own,))
    return Copier(project, (project / CONTROLLERS, project / LIBRARIES))


def copy_files(folder: Path, controller: Path, copier: Copier) -> None:
    """Copies all files of the controller's folder.

    Raises:
        ControllerFileError: The files cannot be listed, or are too large.
    """
    own = controller.resolve().parent
    try:
        for entry in sorted(own.iterdir()):
            if entry.is_file() and entry.name not in _NOT_COPIED:
                copier.file(entry, folder / entry.name)
    except NoSpaceError:
        raise ControllerFileError(
            f"{own} has more than {LARGEST >> 20} MB; put the controller in a folder "
            "of its own"
        ) from None
    except OSError as error:
        raise ControllerFileError(
            f"cannot copy the folder of {controller}: {error}"
        ) from error


def copy_folders(work: Path, controller: Path, copier: Copier) -> None:
    """Copies the folders beside the controller, then the rest of its project.

    Args:
        work: Working folder of the sandboxed program.
        controller: The controller.
        copier: The copier that copied the controller's files.
    """
    own = controller.resolve().parent
    for folder in _folders(own):
        copier.folder(folder, work / folder.name)
    project = project_of(controller)
    if project is None:
        return
    place = work / PROJECT
    (place / CONTROLLERS).mkdir(parents=True)
    _copy_libraries(project / LIBRARIES, place / LIBRARIES, copier)
    for folder in _folders(own.parent):
        if folder != own:
            copier.folder(folder, place / CONTROLLERS / folder.name, suffix=".py")


def _copy_libraries(source: Path, target: Path, copier: Copier) -> None:
    """Copies the project's libraries, whose modules Webots itself does not find."""
    if source.is_dir() and copier.folder(source, target) and any(target.rglob("*.py")):
        copier.notes.append(
            "modules of the project's folder libraries can be imported here; in Webots "
            "this needs sys.path, or PYTHONPATH in runtime.ini"
        )


def has_module(project: Path | None, name: str) -> str:
    """Where the project has a Python module, relative to it; empty if nowhere."""
    if project is None:
        return ""
    for folder in (CONTROLLERS, LIBRARIES, "."):
        for path in (project / folder / name, project / folder / f"{name}.py"):
            with suppress(OSError):  # such as a name that is too long
                if path.exists():
                    return str(path.relative_to(project))
    return ""


def is_beside(controller: Path, name: str) -> bool:
    """Whether a Python module is in the folder above the controller's own."""
    above = controller.resolve().parent.parent
    with suppress(OSError):  # such as a name that is too long
        return (above / name).is_dir() or (above / f"{name}.py").is_file()
    return False


def _folders(folder: Path) -> list[Path]:
    try:
        entries = sorted(folder.iterdir())
    except OSError:
        return []
    return [
        entry
        for entry in entries
        if entry.is_dir() and entry.name not in _NOT_COPIED and entry.name[0] != "."
    ]
