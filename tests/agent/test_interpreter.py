"""No module of the folder in which a process works ever runs."""

import os
import shutil
import subprocess
import sys
import textwrap

import pytest

from tdac_agent.interpreter import given_environment, safe_environment

SECONDS = 120
PLANTED = (
    *("subprocess", "json", "numpy", "yaml", "pydantic", "typer", "threading"),
    *("pathlib", "signal", "socket", "sitecustomize", "usercustomize", "conftest"),
    *("multiprocessing", "pytest", "numba", "cv2", "inner", "sensors"),
    *("tdac_agent/__init__", "tdac_agent/__main__", "tdac_envs/__init__"),
)
STARTS = {
    "a command": """
        import sys
        from tdac_agent.__main__ import main
        sys.argv[1:] = ["runs", "."]
        main()
    """,
    "a job of the studio": """
        import time
        from pathlib import Path
        from tdac_agent.studio.jobs import start
        job = start(Path.cwd(), ["runs", "."], "x")
        while job.running:
            time.sleep(0.01)
        assert job.code == 0, job.output()
    """,
    "a module": """
        import subprocess
        from tdac_agent.interpreter import python, safe_environment
        words = python("-m", "tdac_agent", "runs", ".")
        subprocess.run(words, check=True, env=safe_environment())
    """,
    "a process of multiprocessing": """
        import multiprocessing
        from tdac_agent.interpreter import make_safe
        if __name__ == "__main__":
            make_safe()
            process = multiprocessing.get_context("spawn").Process(target=print)
            process.start()
            process.join()
            assert process.exitcode == 0
    """,
    "a trial": """
        from tdac_agent.cli.trials import attempt
        assert attempt("video")[0], attempt("video")
    """,
    "a judge": """
        from tdac_agent.verification.judge.warm import WarmJudge
        with WarmJudge() as judge:
            judge._worker(lambda: None)
    """,
    "a sandbox": """
        from tdac_agent.sandbox.launch import start
        start(tier="rlimits").close()
    """,
    "a worker": """
        import os, subprocess
        from pathlib import Path
        from tdac_agent.executors.executor import Work
        from tdac_agent.executors.local import run_locally

        class Job:
            name = "one"

            def to_json(self):
                return "{}"

        given = [Job()]
        work = Work("none_such", {}, 1, Path(os.environ["OUT"]), dict, lambda *a: a)
        told = list(run_locally(work, lambda: given.pop() if given else None))
        assert "none_such" in str(told[-1]), told
    """,
    "a verification": """
        from tdac_agent.builtin.provider import template_of
        from tdac_agent import load_task
        from tdac_agent.verification.verify import verify
        task = load_task("maze")
        template = template_of(task.setting)
        assert verify(template.render(template.kind()), task, paper=True).passed
    """,
}
FAST = {"a job of the studio", "a process of multiprocessing"}


def plant(folder, target):
    """Modules that leave a sign when they are imported."""
    for name in PLANTED:
        file = folder / f"{name}.py"
        file.parent.mkdir(exist_ok=True)
        sign = f"open({str(target)!r}, 'a').write({name!r} + ' ')"
        file.write_text(f"{sign}\nraise ImportError({name!r})\n")
    return folder


@pytest.fixture
def planted(tmp_path):
    """A folder with modules, and the file that they write to."""
    folder = tmp_path / "folder"
    folder.mkdir()
    target = tmp_path / "came"
    return plant(folder, target), target


def signs(target):
    """The modules that ran."""
    return target.read_text() if target.exists() else ""


KINDS = [
    pytest.param(kind, marks=() if kind in FAST else pytest.mark.slow)
    for kind in STARTS
]


@pytest.mark.parametrize("kind", KINDS)
def test_no_planted_module_runs(kind, planted, tmp_path):
    """Whatever we start there, even with a PYTHONPATH that has the working directory.

    The first process is the user's: here nothing is on its path.
    """
    folder, target = planted
    script = tmp_path / "bin" / "tdac.py"
    script.parent.mkdir()
    preset = "import os\nos.environ['PYTHONPATH'] = '.:'\n"
    script.write_text(preset + textwrap.dedent(STARTS[kind]))
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=folder,
        env={**os.environ, "OUT": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert signs(target) == ""
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("path", ["src/..", "", ".", ":/none"])
def test_the_first_process_imports_nothing_from_a_relative_path(planted, path):
    """All modules count that Python has not loaded by itself before."""
    folder, target = planted
    (folder / "src").mkdir()
    for name in ("typing", "collections", "importlib/abc", "re", "__future__"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / f"{name}.py").write_text(
            f"open({str(target)!r}, 'a').write({name!r})"
        )
    for name in ("sitecustomize", "usercustomize"):  # those come too early for us
        (folder / f"{name}.py").unlink()
    for package in ("tdac_agent", "tdac_envs"):
        shutil.rmtree(folder / package)
    code = "import sys\nfrom tdac_agent.__main__ import main\nmain()\n"
    script = folder.parent / "tdac"
    script.write_text(code)
    done = subprocess.run(
        [sys.executable, str(script), "runs", "."],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert signs(target) == ""
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("given", "paths"),
    [
        ({}, None),
        ({"PYTHONPATH": ""}, None),
        ({"PYTHONPATH": "."}, None),
        ({"PYTHONPATH": ":/a::/b:"}, "/a:/b"),
        ({"PYTHONPATH": "src:/a:../b", "PYTHONSAFEPATH": "1"}, "/a"),
    ],
)
def test_a_program_of_the_user_has_the_users_environment(given, paths):
    """Ours have only absolute folders on their path, and so have their children."""
    safe = safe_environment({"HOME": "/h", **given})
    assert safe.get("PYTHONPATH") == paths
    assert safe["PYTHONSAFEPATH"]
    assert safe_environment(safe) == safe
    assert given_environment(safe) == {"HOME": "/h", **given}
