"""The judge: runs a controller's episodes and calls, and keeps what they cost."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import cached_property, partial
from pathlib import Path

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.errors import Fault
from tdac_agent.sandbox import (
    Child,
    ControllerFault,
    Limits,
)
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.blame import ours
from tdac_agent.verification.judge.children import Nursery
from tdac_agent.verification.judge.remote import Unit
from tdac_agent.verification.judge.suite_episode import (
    Brief,
    Order,
    SuiteCrew,
    drive,
    load_controller,
    not_driven,
    skipped,
)
from tdac_agent.verification.judge.time_limit import time_limit
from tdac_agent.verification.judge.turns import Turns
from tdac_agent.verification.judge.workers import SIZE, Crew
from tdac_agent.verification.suite.starts import JITTERS, spread_starts
from tdac_envs.drive.task import Pose

NAMES = ("nominal", *(f"jitter {number}" for number in range(1, JITTERS + 1)))
# As many as a suite has: the nominal one, the jittered ones, those of `run_episode`.
EPISODES = 1 + JITTERS + 3
WALL_SECONDS = 600.0

Key = tuple[str, int | None, str]
NOMINAL: Key = ("nominal", None, "policy")
OWN_LOOPS: tuple[Key, ...] = (
    ("nominal", None, "run_episode"),
    ("nominal", 50, "run_episode"),
    ("nominal", 20, "truncated run_episode"),
)


class Judge:
    """Everything a suite may ask about one controller on one task.

    Args:
        task: What the controller must do.
        source: Bytes of `controller.py`.
        workdir: Folder whose files the controller may read.
        tier: Sandbox tier, or `auto`.
        seed: Of the jittered starts.
        limits: Of each child; `cpu_seconds` is for all of them together.
        nursery: Where children are started ahead; one of its own by default.
        crew: Processes that drive; of its own by default, forked now.
        at_a_time: How many episodes may go on side by side.
        wall_seconds: How long all of it may take.

    Attributes:
        tier: Name of the tier that was used.
        cpu_seconds: CPU time of all children so far.
        seed: Of what is drawn for this run.
        fault: Why the sandbox failed, where it did.
    """

    def __init__(
        self,
        task: Task,
        source: bytes,
        workdir: Path,
        *,
        tier: str = "auto",
        seed: int = 0,
        limits: Limits | None = None,
        nursery: Nursery | None = None,
        crew: SuiteCrew | None = None,
        at_a_time: int = min(SIZE, EPISODES),
        wall_seconds: float = WALL_SECONDS,
    ) -> None:
        self.task = task
        self.source = source
        self.tier = tier
        self.cpu_seconds = 0.0
        self.fault: str | None = None
        self.seed = seed
        self._limits = limits or Limits()
        self._deadline = time.monotonic() + wall_seconds
        self._too_long = f"the verification took longer than {wall_seconds:g} s"
        self._brief = Brief(source, workdir, tier, self._limits, self._deadline)
        self._own = ExitStack()
        if nursery is None:
            nursery = Nursery(ahead=False)
            self._own.callback(nursery.close)
        self._nursery = nursery
        if crew is None:
            # Before the first thread.
            crew = Crew(partial(drive, task, nursery), nursery.close, at_a_time)
            self._own.callback(crew.close)
        self._crew = crew
        self._pool = ThreadPoolExecutor(max_workers=at_a_time)
        # The suite's own calls are made beside the episodes.
        self._turns = Turns(at_a_time + 1)
        self._lock = threading.Lock()
        self._episodes: dict[Key, Future[Rollout]] = {}
        self._wanted: set[Key] = set()
        self._unit: Unit | None = None
        self._import_fault: ControllerFault | None = None

    def unit(self) -> Unit:
        """The imported controller, for calls of its own functions.

        A call that ends its process spoils only the test that made it: the next one
        gets a fresh process.

        Raises:
            ControllerFault: It cannot be imported.
        """
        if self._unit is not None and self._unit.fault is not None:
            self._end_unit()
        if self._unit is None:
            with self._ours():
                self._unit = Unit(self._loaded(), self._deadline, self._ours)
        return self._unit

    def time_limit(self) -> AbstractContextManager[None]:
        """Ends a test when the verification has taken too long."""
        return time_limit(self._deadline, self._too_long)

    def call_may_pass(self) -> bool:
        """Whether the latest call took too long, and maybe by the machine's doing.

        Where it did, the episodes under way are waited for: what follows is alone.
        """
        fault = None if self._unit is None else self._unit.fault
        if fault is None or not fault.may_pass:
            return False
        wait(self._episodes.values())
        return True

    def rollout(
        self, name: str = "nominal", *, steps: int | None = None, drive: str = "policy"
    ) -> Rollout:
        """A judged episode; a second request for the same one does not run it again.

        Args:
            name: `nominal`, or `jitter 1` … `jitter 5`.
            steps: Stop after so many steps; the horizon by default.
            drive: `policy`; `run_episode` for the controller's own loop;
                `truncated run_episode`, where the environment ends that loop after
                `steps`, and has counted collisions before it.
        """
        if name not in NAMES:
            raise ValueError(
                f"expected 'nominal' or 'jitter N', N = 1 to {JITTERS}, got {name!r}"
            )
        key = (name, steps, drive)
        self._wanted.add(key)
        return self._submit(key).result()

    @property
    def rollouts(self) -> dict[Key, Rollout]:
        """The episodes that were asked for, by (name, steps, drive).

        Of those only begun, how many have ended by now is a matter of time.
        """
        return {
            key: future.result()
            for key, future in self._episodes.items()
            if key in self._wanted
            and not future.cancelled()
            and future.exception() is None
        }

    def begin(self, *, jitters: bool, own_loop: bool) -> None:
        """Starts the episodes that every suite asks for, beside its other tests.

        The short ones come last, so that all who drive have done at about one time.
        """
        whole, *short = OWN_LOOPS if own_loop else (NOMINAL,)
        jittered = [(name, None, "policy") for name in NAMES[1:]]
        for key in (NOMINAL, whole, *(jittered if jitters else ()), *short):
            self._submit(key)

    @contextmanager
    def _ours(self) -> Generator[None]:
        """Remembers what goes wrong meanwhile and is not the controller's doing.

        A test may catch the error, and no other test meets it again.
        """
        try:
            with ours():
                yield
        except Fault as fault:
            self.fault = self.fault or str(fault)
            raise

    def settle(self) -> None:
        """Waits for the episodes under way; after this all costs are known."""
        self._pool.shutdown(cancel_futures=True)
        self._end_unit()

    def close(self) -> None:
        """Settles, and ends what it has made itself."""
        self.settle()
        self._own.close()

    def _end_unit(self) -> None:
        if self._unit is not None:
            self._account(self._unit.close().cpu_seconds)
            self._unit = None

    def _account(self, cpu_seconds: float) -> None:
        with self._lock:
            self.cpu_seconds += cpu_seconds

    def _submit(self, key: Key) -> Future[Rollout]:
        """The episode's future, from the queue.

        The nominal episode comes first: the jittered ones wait for it, and in a
        queue it could stand behind them.
        """
        if key[0] != "nominal" and NOMINAL not in self._episodes:
            self._submit(NOMINAL)
        if key not in self._episodes:
            self._episodes[key] = self._pool.submit(self._run, *key)
        return self._episodes[key]

    def start_pose(self, name: str) -> Pose:
        """Start of a named episode."""
        return self.task.nominal.start if name == "nominal" else self._starts[name]

    @cached_property
    def _starts(self) -> dict[str, Pose]:
        starts = spread_starts(self.task.nominal, self.seed, JITTERS)
        return dict(zip(NAMES[1:], starts, strict=True))

    def _run(self, name: str, steps: int | None, drive: str) -> Rollout:
        with self._ours():
            return self._in_turn(name, steps, drive)

    def _in_turn(self, name: str, steps: int | None, drive: str) -> Rollout:
        if name != "nominal" and not self._submit(NOMINAL).result().reached:
            reason = "not run, since the nominal episode failed"
            order = self._order(name, steps, drive)
            return skipped(self.task, order, "not run", reason)
        with self._turns.beside():
            rollout = self.drive(name, steps, drive)
        if not rollout.may_pass:
            return rollout
        # It may be the machine's doing, or that of those beside it.
        with self._turns.alone():
            return self.drive(name, steps, drive, final=True)

    def drive(
        self,
        name: str,
        steps: int | None = None,
        drive: str = "policy",
        *,
        final: bool = False,
    ) -> Rollout:
        """Runs an episode in a fresh child.

        Args:
            name: As for `rollout`, as are the next two.
            steps: Most steps.
            drive: By what.
            final: It will not be tried once more.
        """
        order = self._order(name, steps, drive)
        try:
            self._may_start()
            driven = self._crew.do(self._brief, order)
        except ControllerFault as fault:
            return not_driven(self.task, order, fault)
        self.tier = driven.tier
        self._account(driven.cpu_seconds)
        if driven.import_fault is not None:
            self._remember(driven.import_fault, final=final)
        # Children side by side may together use more than each may by itself.
        if self.cpu_seconds > self._limits.cpu_seconds:
            reason = f"the controller {self._overspent()}"
            return skipped(self.task, order, "error", reason)
        return driven.rollout

    def _order(self, name: str, steps: int | None, drive: str) -> Order:
        return Order(name, self.start_pose(name), steps, drive)

    def _overspent(self) -> str:
        return f"used {self._limits.cpu_seconds} s of CPU time, all it may"

    def _loaded(self) -> Child:
        """A fresh child with the controller imported; what may pass is tried again."""
        try:
            with self._turns.beside():
                return self._load()
        except ControllerFault as fault:
            if not fault.may_pass:
                raise
        with self._turns.alone():
            return self._load(final=True)

    def _load(self, *, final: bool = False) -> Child:
        """A fresh child with the controller imported.

        Args:
            final: It will not be tried once more.

        Raises:
            ControllerFault: It cannot be imported; the same at each later request.
        """
        self._may_start()
        child = self._nursery.take(self._brief.tier, self._limits)
        self.tier = child.tier
        try:
            load_controller(child, self._brief)
        except ControllerFault as fault:
            self._account(child.close().cpu_seconds)
            self._remember(fault, final=final)
            raise
        return child

    def _may_start(self) -> None:
        """Whether to start a further child.

        Raises:
            ControllerFault: The controller could not be imported, or may use no more.
        """
        if self._import_fault is not None:
            raise self._import_fault.with_traceback(None)
        if self.cpu_seconds >= self._limits.cpu_seconds:
            raise ControllerFault(f"the controller {self._overspent()}", "import")
        if time.monotonic() > self._deadline:
            raise ControllerFault(self._too_long, "import")

    def _remember(self, fault: ControllerFault, *, final: bool) -> None:
        """An import that failed is not tried again, unless it may pass."""
        if final or not fault.may_pass:
            self._import_fault = fault


def rollout_key(name: str, steps: int | None, drive: str) -> str:
    """One episode's name in a report log."""
    return json.dumps([name, steps, drive])
