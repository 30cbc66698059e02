"""Serve the judge's requests to one controller."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from .decode import decode
from .describe import FILE_NAME, describe, type_name
from .encode import encode
from .layout import Layout
from .link import Link
from .program import run_program
from .wire import Handle, Kind, WireError, is_name

MAX_HANDLES = 10_000
MAX_NAMES = 1000


class Server:
    """Serves one controller module, and keeps the objects that it hands out.

    Args:
        link: The channel to the judge.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._objects: list[object] = []
        self._numbers: dict[int, int] = {}
        self._module = ModuleType("controller")
        self._source = ""
        self._sequence = 0
        self._layout: Layout | None = None

    def run(self) -> None:
        """Answer requests until the judge closes the channel."""
        while True:
            kind, self._sequence, payload = self._link.receive()
            try:
                answer = self._answer(kind, self._value(kind, payload))
                self._send(Kind.VALUE, answer)
            except BaseException as error:
                described = describe(error, self._source)
            else:
                continue
            self._send(Kind.ERROR, described)

    def _value(self, kind: int, payload: bytes) -> Any:
        """Decode a request; observations, which are frequent, use a layout."""
        if kind == Kind.POLICY and self._layout is not None:
            observation = self._layout.decode(payload)
            if observation is not None:
                return observation
        value = decode(payload, 0, self._object)
        if kind == Kind.POLICY:
            self._layout = Layout.of(value)
        return value

    def _send(self, kind: Kind, value: object) -> None:
        self._link.send(kind, self._sequence, encode(value, self._keep))

    def _answer(self, kind: int, value: Any) -> Any:
        if kind == Kind.POLICY:
            return self._module.policy(value)
        if kind == Kind.RESET:
            reset = getattr(self._module, "reset", None)
            if reset is not None:
                reset(value)
            return None
        if kind in (Kind.CALL, Kind.CALL_EACH, Kind.GET):
            return self._use(kind, *value)
        if kind == Kind.RUN_EPISODE:
            return self._module.run_episode(Env(self), value)
        if kind == Kind.LOAD:
            return self._load()
        if kind == Kind.RUN_PROGRAM:
            name, arguments = value
            return run_program(self._read_source(), name, arguments, Env(self))
        raise WireError(f"not a request: {kind}")

    def _use(self, kind: int, owner: object, name: str | None, *rest: Any) -> Any:
        """Get a value, call a function once, or call it for each argument tuple."""
        target = self._target(owner, name)
        if kind == Kind.GET:
            return target
        if kind == Kind.CALL:
            args, kwargs = rest
            return target(*args, **kwargs)
        return [target(*args) for args in rest[0]]

    def _target(self, owner: object, name: str | None) -> Any:
        holder = self._module if owner is None else owner
        return holder if name is None else getattr(holder, name)

    def _read_source(self) -> bytes:
        with open(FILE_NAME, "rb") as file:  # raw read: within the sandbox
            source = file.read()
        self._source = source.decode("utf-8", "replace")
        return source

    def _load(self) -> dict[str, str]:
        source = self._read_source()
        code = compile(source, FILE_NAME, "exec", dont_inherit=True)
        self._module.__file__ = FILE_NAME
        sys.modules["controller"] = self._module
        exec(code, self._module.__dict__)
        members = vars(self._module)
        names = [name for name in members if is_name(name) and name[:1] != "_"]
        return {name: type_name(members[name]) for name in names[:MAX_NAMES]}

    def _keep(self, value: object) -> Handle:
        number = self._numbers.get(id(value))
        if number is None:
            number = len(self._objects)
            if number >= MAX_HANDLES:
                raise WireError(f"more than {MAX_HANDLES} objects handed out")
            self._objects.append(value)
            self._numbers[id(value)] = number
        return Handle(number, type_name(value))

    def _object(self, handle: Handle) -> object:
        return self._objects[handle.id]

    def ask(self, kind: Kind, value: object) -> Any:
        """Send a controller's request to the judge's environment; return the reply.

        Raises:
            RuntimeError: The environment refused it.
        """
        self._send(kind, value)
        kind_back, self._sequence, payload = self._link.receive()
        reply = decode(payload, 0, self._object)
        if kind_back == Kind.ENV_REFUSAL:
            raise RuntimeError(reply)
        return reply


class Env:
    """The judge's environment as `run_episode` sees it; the judge makes every step.

    Args:
        server: Carries the requests.
    """

    def __init__(self, server: Server) -> None:
        self._server = server

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> Any:
        """Return the first observation and info; the judge sets seed and options."""
        del seed, options
        return self._server.ask(Kind.ENV_RESET, None)

    def step(self, action: Any) -> Any:
        """Return observation, reward, terminated, truncated and info of one step."""
        return self._server.ask(Kind.ENV_STEP, action)

    def render(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing: the judge closes the environment."""
