"""The flags that name the task of a command, as one parameter of its function."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING, Any, Protocol, get_type_hints

from tdac_agent.cli.options import (
    FrameOption,
    Goal,
    Heading,
    Ignore,
    Instructions,
    MapOption,
    Metres,
    Movers,
    Polarity,
    Radius,
    RobotImage,
    Snap,
    Start,
    TaskOption,
    Threshold,
    WorldOption,
)

if TYPE_CHECKING:
    from tdac_agent.cli.flags import TaskFlags


class NamedTask(Protocol):
    """Type of the parameter `named_task`; a call imports `TaskFlags`, which is slow."""

    def __call__(self) -> TaskFlags:
        """The flags of the task."""


def task_flags(
    task: TaskOption = None,
    map_image: MapOption = None,
    world: WorldOption = None,
    ignore: Ignore = None,
    start: Start = None,
    goal: Goal = None,
    heading: Heading = None,
    robot_radius: Radius = None,
    robot_image: RobotImage = None,
    movers: Movers = None,
    snap: Snap = False,
    frame: FrameOption = None,
    metres: Metres = False,
    polarity: Polarity = None,
    threshold: Threshold = None,
    instructions: Instructions = None,
) -> TaskFlags:
    """The flags that name the task of a command."""
    from tdac_agent.cli.flags import TaskFlags, frame_of

    return TaskFlags(
        task=task,
        map_image=map_image,
        world=world,
        ignore=tuple(ignore or ()),
        start=start,
        goal=goal,
        heading=heading,
        robot_radius=robot_radius,
        robot_image=robot_image,
        movers=movers,
        snap=snap,
        frame=frame_of(frame, metres),
        polarity=polarity,
        threshold=threshold,
        instructions=instructions,
    )


Command = Callable[..., None]
ONLY_FOR_SYNTH = ("robot_image", "instructions")
"""Task flags that only `tdac synth` has."""


def takes_task(
    *, without: Collection[str] = ONLY_FOR_SYNTH
) -> Callable[[Command], Command]:
    """Replaces a command's parameter `named_task` by the flags of `task_flags`.

    Args:
        without: Names of flags that the command does not have.
    """
    flags = [flag for flag in _parameters(task_flags) if flag.name not in without]

    def with_flags(command: Command) -> Command:
        own = _parameters(command)
        at = [parameter.name for parameter in own].index("named_task")

        @functools.wraps(command)
        def called(**given: Any) -> None:
            named = {flag.name: given.pop(flag.name) for flag in flags}
            command(**given, named_task=functools.partial(task_flags, **named))

        # Typer reads the signature and the annotations.
        parameters = [*own[:at], *flags, *own[at + 1 :]]
        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        called.__annotations__ = {p.name: p.annotation for p in parameters}
        return called

    return with_flags


def _parameters(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """The parameters of a function, with evaluated annotations."""
    # `TaskFlags` is not imported at run time; only the return annotation names it.
    hints = get_type_hints(function, localns={"TaskFlags": object}, include_extras=True)
    return [
        parameter.replace(annotation=hints[name])
        for name, parameter in inspect.signature(function).parameters.items()
    ]
