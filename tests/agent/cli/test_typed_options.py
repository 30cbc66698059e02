"""Flags from the fields of dataclasses: one place for each flag of a command."""

import inspect
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal

import pytest
import typer

from tdac_agent.cli import synth_flags
from tdac_agent.cli.main import PARTS, command_line
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option, words_of
from tdac_agent.synthesis.options import SynthOptions
from tdac_envs.core.errors import TaskError


@dataclass(frozen=True)
class Options:
    """Options of every kind."""

    place: tuple[float, float] | None = option(None, "A place.", metavar="X Y")
    names: tuple[str, ...] = option((), "Names.", "--name")
    many: tuple[Path, ...] = option((), "Files.", argument=True)
    count: int = option(0, "How many, if at all.", "-n", "--count", least=8)
    speed: float = option(1.5, "How fast.")
    mode: Literal["a", "b"] = option("a", "How.", needs="--count N")
    refine: bool = option(True, "Whether.", "--refine/--no-refine")
    as_json: bool = option(False, "Whether.", "--json")


def parsed(*words, **look):
    """The options that a command line stands for."""
    got = []

    @typed_options(**look)
    def command(options: Options) -> None:
        got.append(options)

    app = typer.Typer()
    app.command()(command)
    app(list(words), standalone_mode=False)
    return got[0]


ALL = (
    *("--place", "-1", "2.25", "--name", "x", "--name", "y", "-n", "9"),
    *("--speed", "2", "--mode", "b", "--no-refine", "--json"),
)


def test_each_field_is_a_flag_and_back():
    """Values have the types of the fields; words of an object give it again."""
    assert parsed() == Options()
    typed = parsed("a.py", "b.py", *ALL)
    assert typed == Options(
        (-1.0, 2.25), ("x", "y"), (Path("a.py"), Path("b.py")), 9, 2.0, "b", False, True
    )
    assert words_of(typed) == [*ALL]
    assert words_of(Options()) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--speed inf", "--speed must be finite, got inf"),
        ("--place 1 nan", "--place must be finite, got 1.0 nan"),
        ("--mode b", "--mode needs --count N"),
    ],
)
def test_values_that_no_command_wants(words, message):
    with pytest.raises(TaskError, match=f"^{message}$"):
        parsed(*words.split())


def test_a_field_can_be_left_out():
    with pytest.raises(Exception, match="No such option"):
        parsed("--speed", "2", without=("speed",))
    assert parsed("-n", "8", without=("speed",)).count == 8


@pytest.mark.parametrize("words", ["--task maze", "--set known"])
def test_a_flag_of_synth_is_declared_once(monkeypatch, words):
    """A field of the options is a flag, and reaches the library."""

    @dataclass(frozen=True, slots=True)
    class Louder(SynthOptions):
        loud: bool = option(False, "Say everything twice.")

        def changed(self, **values):
            raise TypeError(f"loud: {self.loud}")

    declared = synth_flags.synth.__wrapped__
    monkeypatch.setitem(declared.__annotations__, "options", Louder)
    app = typer.Typer()
    app.command()(typed_options("synth:run")(declared))
    with pytest.raises(TypeError, match=r"^loud: True$"):
        app([*words.split(), "--loud", "--out", "unused"], standalone_mode=False)
    assert not Path("unused").exists()


def commands():
    """Each command of the command line that has options."""
    for part in PARTS:
        for value in vars(import_module(f"tdac_agent.cli.{part}")).values():
            if getattr(value, "_work", None):
                yield value


def test_each_command_has_its_work():
    """It is a function with the parameters of the command."""
    assert len(list(commands())) > 15
    for command in commands():
        module, _, name = command._work.partition(":")
        work = getattr(import_module(f"tdac_agent.cli.{module}"), name)
        declared = inspect.signature(command.__wrapped__).parameters
        assert {*inspect.signature(work).parameters} == {*declared}, name


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_a_shell_completes_flags(tdac, monkeypatch, shell):
    """It asks with the words so far; without flags of its own, `tdac` has none."""
    monkeypatch.setenv("_TDAC_COMPLETE", f"complete_{shell}")
    monkeypatch.setenv("COMP_WORDS", "tdac verify --robu")
    monkeypatch.setenv("COMP_CWORD", "2")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", "tdac verify --robu")
    code, out, _ = tdac()
    assert (code, "--robust" in out) == (0, True)


def test_completion_can_be_installed(tdac, tmp_path, monkeypatch):
    """The files of the shell are in the user's home."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    code, _, err = tdac("--install-completion", "bash")
    assert (code, err) == (0, "")
    assert (tmp_path / ".bashrc").is_file()


def test_only_the_parts_of_a_command_are_read():
    """So that other commands' flags cost nothing."""
    [part] = command_line(["doctor"]).registered_groups
    names = {info.callback.__name__ for info in part.typer_instance.registered_commands}
    assert names == {"doctor", "warm"}
