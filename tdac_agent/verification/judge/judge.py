"""The judge: runs a controller's episodes and calls, and adds up their CPU time."""

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
    ChildUsage,
    ControllerFault,
    Limits,
    machine_is_to_blame,
)
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.blame import faults_of_judge
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.level import FIRST_WORLD, Level
from tdac_agent.verification.judge.remote import Unit
from tdac_agent.verification.judge.suite_episode import (
    EpisodeRequest,
    SuitePool,
    SuiteTask,
    VerificationSettings,
    drive,
    load_controller,
    not_driven,
    skipped,
)
from tdac_agent.verification.judge.time_limit import time_limit
from tdac_agent.verification.judge.turns import Turns
from tdac_agent.verification.judge.worker_pool import SIZE, WorkerPool
from tdac_agent.verification.suite.starts import JITTERS, episode_seed, spread_starts
from tdac_envs.drive.task import Pose
from tdac_envs.physics.moved import EXACT

NAMES = ("nominal", *(f"jitter {number}" for number in range(1, JITTERS + 1)))
# Number of episodes in a suite: nominal, jittered, and three of `run_episode`.
EPISODES = 1 + JITTERS + 3
WALL_SECONDS = 600.0

Key = tuple[str, int | None, str]
NOMINAL: Key = ("nominal", None, "policy")
OWN_LOOPS: tuple[Key, ...] = (
    ("nominal", None, "run_episode"),
    ("nominal", 50, "run_episode"),
    ("nominal", 20, "truncated run_episode"),
)


ONE_WORLD = (
    "the suite does not suit a task set: it needs rollout({0!r}, drive={1!r}), and a "
    "set has only rollout('nominal'), without jittered starts and without run_episode; "
    "mark such tests with pytest.mark.jitter or pytest.mark.paper"
)


class Judge:
    """Everything that a suite can ask about one controller on one task.

    Args:
        task: Task of the controller, or the first world of its task set.
        source: Bytes of `controller.py`.
        workdir: Folder whose files the controller may read.
        tier: Sandbox tier, or `auto`.
        seed: Seed of the jittered starts, and of movers.
        limits: Limits of each child; `cpu_seconds` is the total of all of them.
        child_pool: The child pool; a new one by default.
        worker_pool: Drives the episodes; by default a new one, forked now.
        at_a_time: Maximum number of concurrent episodes.
        wall_seconds: Time limit of the whole verification, s.
        level: The task set; None for a task.
        physics: What moves the robot in episodes.

    Attributes:
        tier: Name of the tier that was used.
        cpu_seconds: CPU time of all children so far.
        seed: Seed of everything that is drawn for this verification.
        fault: Why the sandbox or the judge failed; None if neither did.
    """

    def __init__(
        self,
        task: SuiteTask,
        source: bytes,
        workdir: Path,
        *,
        tier: str = "auto",
        seed: int = 0,
        limits: Limits | None = None,
        child_pool: ChildPool | None = None,
        worker_pool: SuitePool | None = None,
        at_a_time: int = min(SIZE, EPISODES),
        wall_seconds: float = WALL_SECONDS,
        level: Level | None = None,
        physics: str = EXACT,
    ) -> None:
        self.task = task
        self.source = source
        self.tier = tier
        self.cpu_seconds = 0.0
        self.fault: str | None = None
        self.seed = seed
        self._limits = limits or Limits()
        self._wall_seconds, self._at_a_time = wall_seconds, at_a_time
        # Of the episodes: time in a run queue, CPU time of children and of the judge.
        self._waited = self._driving_cpu = self._judge_cpu = 0.0
        self._cpu_before = time.process_time()
        self._deadline = time.monotonic() + wall_seconds
        self._too_long = f"the verification took longer than {wall_seconds:g} s"
        self._settings = VerificationSettings(
            source, workdir, tier, self._limits, self._deadline, level, physics
        )
        self._own = ExitStack()
        if child_pool is None:
            child_pool = ChildPool(ahead=False)
            self._own.callback(child_pool.close)
        self._child_pool = child_pool
        if worker_pool is None:
            # Forked before the first thread starts.
            worker_pool = WorkerPool(
                partial(drive, task, child_pool), child_pool.close, at_a_time
            )
            self._own.callback(worker_pool.close)
        self._worker_pool = worker_pool
        self._pool = ThreadPoolExecutor(max_workers=at_a_time)
        # One place more than episodes, for the suite's own calls.
        self._turns = Turns(at_a_time + 1)
        self._lock = threading.Lock()
        self._episodes: dict[Key, Future[Rollout]] = {}
        self._wanted: set[Key] = set()
        self._unit: Unit | None = None
        self._import_fault: ControllerFault | None = None

    def twin(self, physics: str) -> Judge:
        """A judge of the same controller, with limits of its own and another physics.

        It uses the pools of this one, which must stay open.
        """
        return Judge(
            self.task,
            self.source,
            self._settings.workdir,
            tier=self._settings.tier,
            seed=self.seed,
            limits=self._limits,
            child_pool=self._child_pool,
            worker_pool=self._worker_pool,
            at_a_time=self._at_a_time,
            wall_seconds=self._wall_seconds,
            physics=physics,
        )

    def unit(self) -> Unit:
        """The imported controller, whose functions can be called.

        A call that ends its process fails only the test that made it: the next test
        gets a fresh process.

        Raises:
            ControllerFault: The controller cannot be imported.
        """
        if self._unit is not None and self._unit.fault is not None:
            self._end_unit()
        if self._unit is None:
            with self._errors_as_faults():
                self._unit = Unit(
                    self._loaded(), self._deadline, self._errors_as_faults
                )
        return self._unit

    def time_limit(self) -> AbstractContextManager[None]:
        """Context that ends a test when the verification has taken too long."""
        return time_limit(self._deadline, self._too_long)

    def wait_before_retry(self) -> bool:
        """Whether the latest call timed out, maybe only because the machine is busy.

        If so, it first waits for the running episodes, so that a retry runs alone.
        """
        fault = None if self._unit is None else self._unit.fault
        if fault is None or not fault.is_retryable:
            return False
        wait(self._episodes.values())
        return True

    def rollout(
        self, name: str = "nominal", *, steps: int | None = None, drive: str = "policy"
    ) -> Rollout:
        """A judged episode; a second request for the same one does not run it again.

        Args:
            name: `nominal`, or `jitter 1` … `jitter 5`.
            steps: Maximum number of steps; the horizon by default.
            drive: `policy`; `run_episode` for the controller's own loop;
                `truncated run_episode`, where the environment truncates that loop after
                `steps`, and has already counted collisions when it begins.
        """
        if name not in NAMES:
            raise ValueError(
                f"expected 'nominal' or 'jitter N', N = 1 to {JITTERS}, got {name!r}"
            )
        if self._settings.level is not None and (name, drive) != NOMINAL[::2]:
            self.fault = self.fault or ONE_WORLD.format(name, drive)
            raise Fault(self.fault)
        key = (name, steps, drive)
        self._wanted.add(key)
        return self._submit(key).result()

    @property
    def rollouts(self) -> dict[Key, Rollout]:
        """The episodes that tests asked for, by (name, steps, drive).

        Others that `begin` started are left out: how many have ended depends on timing.
        """
        return {
            key: future.result()
            for key, future in self._episodes.items()
            if key in self._wanted
            and not future.cancelled()
            and future.exception() is None
        }

    def begin(self, *, jitters: bool, own_loop: bool) -> None:
        """Starts the episodes that every suite asks for, to run during other tests.

        The short ones come last, so that all processes finish at about the same time.
        """
        whole, *short = OWN_LOOPS if own_loop else (NOMINAL,)
        jittered = [(name, None, "policy") for name in NAMES[1:]]
        for key in (NOMINAL, whole, *(jittered if jitters else ()), *short):
            self._submit(key)

    @contextmanager
    def _errors_as_faults(self) -> Generator[None]:
        """Records the first fault in the block, since a test may catch the error."""
        try:
            with faults_of_judge():
                yield
        except Fault as fault:
            self.fault = self.fault or str(fault)
            raise

    def settle(self) -> None:
        """Waits for the running episodes; after this the CPU time is final."""
        self._pool.shutdown(cancel_futures=True)
        self._end_unit()
        late = time.monotonic() - self._deadline
        if late > 0.0 and self._machine_was_busy(self._wall_seconds + late):
            reason = f"its processes waited {self._waited:.0f} s for a CPU"
            fault = f"{self._too_long}, and {reason}: try again when less else runs"
            self.fault = self.fault or fault

    def _machine_was_busy(self, elapsed: float) -> bool:
        """Whether other work, and not the controller, used up the time.

        An episode's child may have waited for those of the other episodes, and for all
        other processes of the verification.
        """
        judge = self._judge_cpu + time.process_time() - self._cpu_before
        other = self.cpu_seconds - self._driving_cpu + judge
        siblings = (self._at_a_time - 1) * self._driving_cpu + self._at_a_time * other
        return machine_is_to_blame(elapsed, self._waited, siblings)

    def close(self) -> None:
        """Settles, and closes the pools that it made itself."""
        self.settle()
        self._own.close()

    def _end_unit(self) -> None:
        if self._unit is not None:
            self._account(self._unit.close())
            self._unit = None

    def _account(self, usage: ChildUsage) -> None:
        with self._lock:
            self.cpu_seconds += usage.cpu_seconds

    def _submit(self, key: Key) -> Future[Rollout]:
        """Queues an episode if it is new, and returns its future.

        The nominal episode is queued before the jittered ones, which wait for it.
        """
        if key[0] != "nominal" and NOMINAL not in self._episodes:
            self._submit(NOMINAL)
        if key not in self._episodes:
            self._episodes[key] = self._pool.submit(self._run, *key)
        return self._episodes[key]

    def start_pose(self, name: str) -> Pose:
        """Start of a named episode of a task."""
        return self.task.nominal.start if name == "nominal" else self._starts[name]

    @cached_property
    def _starts(self) -> dict[str, Pose]:
        task = self.task
        assert isinstance(task, Task)
        starts = spread_starts(task.nominal, self.seed, JITTERS, task.start_check())
        return dict(zip(NAMES[1:], starts, strict=True))

    def _run(self, name: str, steps: int | None, drive: str) -> Rollout:
        with self._errors_as_faults():
            return self._drive_with_retry(name, steps, drive)

    def _drive_with_retry(self, name: str, steps: int | None, drive: str) -> Rollout:
        if name != "nominal" and not self._submit(NOMINAL).result().reached:
            reason = "not run, since the nominal episode failed"
            request = self._request(name, steps, drive)
            return skipped(self.task, request, "not run", reason)
        with self._turns.beside():
            rollout = self.drive(name, steps, drive)
        if not rollout.is_retryable:
            return rollout
        # A busy machine may be the cause, so the retry runs alone.
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
        """Runs an episode in a fresh child; `final` if there is no further retry.

        The other arguments are as for `rollout`.
        """
        request = self._request(name, steps, drive)
        try:
            self._may_start()
            driven = self._worker_pool.do(self._settings, request)
        except ControllerFault as fault:
            return not_driven(self.task, request, fault)
        self.tier = driven.tier
        self._account(driven.usage)
        with self._lock:
            self._waited += driven.usage.waited_seconds
            self._driving_cpu += driven.usage.cpu_seconds
            self._judge_cpu += driven.judge_cpu
        if driven.import_fault is not None:
            self._remember(driven.import_fault, final=final)
        # Concurrent children may together use more than the limit of each.
        if self.cpu_seconds > self._limits.cpu_seconds:
            reason = f"the controller {self._overspent()}"
            return skipped(self.task, request, "error", reason)
        return driven.rollout

    def _request(self, name: str, steps: int | None, drive: str) -> EpisodeRequest:
        seed = episode_seed(self.seed, NAMES.index(name))
        if self._settings.level is not None:
            world = {"index": FIRST_WORLD}
            return EpisodeRequest(name, None, steps, drive, seed, world)
        return EpisodeRequest(name, self.start_pose(name), steps, drive, seed)

    def _overspent(self) -> str:
        return f"used up its limit of {self._limits.cpu_seconds} s of CPU time"

    def _loaded(self) -> Child:
        """A fresh child with the controller imported; a time-out is retried alone."""
        try:
            with self._turns.beside():
                return self._load()
        except ControllerFault as fault:
            if not fault.is_retryable:
                raise
        with self._turns.alone():
            return self._load(final=True)

    def _load(self, *, final: bool = False) -> Child:
        """A fresh child with the controller imported; `final`: without a retry.

        Raises:
            ControllerFault: The import failed; later requests raise the same fault.
        """
        self._may_start()
        child = self._child_pool.take(self._settings.tier, self._limits)
        self.tier = child.tier
        try:
            load_controller(child, self._settings)
        except ControllerFault as fault:
            self._account(child.close())
            self._remember(fault, final=final)
            raise
        return child

    def _may_start(self) -> None:
        """Checks that a further child may be started.

        Raises:
            ControllerFault: The import has failed, or CPU or wall time is used up.
        """
        if self._import_fault is not None:
            raise self._import_fault.with_traceback(None)
        if self.cpu_seconds >= self._limits.cpu_seconds:
            raise ControllerFault(f"the controller {self._overspent()}", "import")
        if time.monotonic() > self._deadline:
            raise ControllerFault(self._too_long, "import")

    def _remember(self, fault: ControllerFault, *, final: bool) -> None:
        """Records a failed import, unless it is to be retried."""
        if final or not fault.is_retryable:
            self._import_fault = fault


def rollout_key(name: str, steps: int | None, drive: str) -> str:
    """Key of an episode in a report log."""
    return json.dumps([name, steps, drive])
