"""What is missing is installed from where the package itself came from."""

import json
import shlex
import shutil
import sys

import pytest

from tdac_envs.core.extras import install_command

ORIGINS = [
    ({"url": "file:///home/me/my%20tdac", "dir_info": {}}, "'/home/me/my tdac[sb3]'"),
    (
        {"url": "file:///home/me/tdac", "dir_info": {"editable": True}},
        "-e '/home/me/tdac[sb3]'",
    ),
    (
        {"url": "https://here/tdac.git", "vcs_info": {"vcs": "git", "commit_id": "1"}},
        "'tdac[sb3] @ git+https://here/tdac.git'",
    ),
    (
        {"url": "file:///tmp/tdac-1-py3-none-any.whl", "archive_info": {}},
        "'tdac[sb3] @ file:///tmp/tdac-1-py3-none-any.whl'",
    ),
    (None, "'tdac[sb3]'"),
]


@pytest.mark.parametrize(("origin", "words"), ORIGINS)
def test_an_extra_comes_from_the_same_place(tmp_path, monkeypatch, origin, words):
    """A folder, a repository, a file, or the index; as pip keeps it (PEP 610)."""
    info = tmp_path / "tdac-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: tdac\nVersion: 1\n")
    if origin is not None:
        (info / "direct_url.json").write_text(json.dumps(origin))
    monkeypatch.syspath_prepend(tmp_path)
    assert install_command("sb3").endswith(f" install {words}")
    assert install_command(None).endswith(
        f" install {shlex.join(shlex.split(words.replace('[sb3]', '')))}"
    )


def test_it_is_put_where_this_python_looks(tmp_path, monkeypatch):
    """`pip` alone only where that is this interpreter's."""
    monkeypatch.setenv("PATH", str(tmp_path))
    assert install_command("sb3").startswith(f"{sys.executable} -m pip install ")
    pip = tmp_path / "pip"
    pip.touch()
    pip.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    assert shutil.which("pip") == str(pip)
    assert install_command("sb3").startswith("pip install ")
