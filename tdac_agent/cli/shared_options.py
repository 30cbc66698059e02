"""Options, and texts of options, that several commands share."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tdac_agent.option_fields import option, typed_fields
from tdac_agent.synthesis.options import ENGINES, SUITE

if TYPE_CHECKING:
    from tdac_agent.tasks.disturbance import Disturbance
    from tdac_agent.tasks.task import Task
    from tdac_envs.ladder.task_sets import TaskSet

VARIATION = (
    "Start poses: the task's own (nominal), within a body radius of it (jitter), "
    "jittered or any (mixed), any start and goal (random)."
)
WRAPPER = (
    "Observation wrapper, innermost first; repeatable: `goal-relative`, `closeness`, "
    "`guidance`, `map-view`, `flatten`, or `none`."
)
VIDEO = "Write a .mp4 or .gif video"
RANGE_NOISE = "Noise of each range, standard deviation relative to the range."
WHEEL_SLIP = "Noise of each wheel's speed, standard deviation relative to the speed."
MOTOR_LAG = "Time constant of the wheel speeds, s."
DELAY = "Number of steps until an action takes effect."
WHEEL_GAINS = (
    "Largest hidden relative error of each wheel's speed, constant in an episode."
)
AXLE_ERROR = "Largest hidden relative error of the axle length, constant in an episode."
RANGE_DROPOUT = "Probability that a ray reads its maximum range; only on maps."
WHEEL_RADII = "Largest hidden relative error of each wheel's radius."
POSE_NOISE = (
    "Standard deviation of the observed x and y, px or m as the task; this and the "
    "following only on maps."
)
HEADING_NOISE = "Standard deviation of the observed heading, rad."
POSE_CORRELATION = "Time constant of the errors of the pose, s."
POSE_JUMPS = "Jumps of the observed pose in a minute, to errors three times as large."
POSE_DELAY = "Number of steps by which the pose is late."
SCAN_DELAY = "Number of steps by which the ranges are late."
MESSAGE_DROP = "Probability that the pose and ranges of a step are lost."
DISTURBED = "Disturbance of verify -n, and of play --seed or --set"
BUDGET, MODELS = "Budget", "Models"
Profile = Literal["policy", "paper"]
Variation = Literal["nominal", "jitter", "mixed", "random"]

CONTROLLER = "Controller file, or run folder, which brings its own task."
JSON = "Print JSON instead of a table."
Json = Annotated[bool, typer.Option("--json", help=JSON)]
json_option = partial(option, False, JSON, "--json")
tier_option = partial(
    option, "auto", "Sandbox tier; `tdac doctor` lists them.", metavar="NAME"
)
out_option = partial(option, None, metavar="DIR")
suite_option = partial(option, None, SUITE, metavar="DIR")
trust_option = partial(
    option,
    False,
    "For this command only, let a folder or file from elsewhere run and contact what "
    "it names; each item is listed.",
)
seed_option = partial(
    option,
    None,
    "Seed of the jittered starts.  [default: derived from a secret of this "
    "installation]",
    least=0,
)
physics_option = partial(
    option,
    "exact",
    "What moves the robot: the exact step, or MuJoCo, a 3D contact solver (extra "
    "`physics`); mujoco-varied varies mass, friction, axle and wheels a little; "
    "mujoco-rays also measures the rays.",
    metavar=ENGINES,
)
profile_option = partial(
    option,
    None,
    "Functions that the controller must define: `policy(obs)` only, or those of the "
    "paper.  [default: the task's]",
)
speed_option = partial(
    option,
    None,
    "Speed of the video, relative to real time.  [default: 1; more if it would last "
    "longer than a minute]",
    least=0.01,
    most=1000.0,
)
wrappers_option = partial(option, None, metavar="NAME")
key_over_http_option = partial(
    option,
    False,
    "Allow sending an API key unencrypted to a server on another machine.",
    panel=MODELS,
)


def _part(text: str, default: str = "the task's, else 0") -> Any:
    """A part of a disturbance; None if it is not typed."""
    return option(None, f"{text}  [default: {default}]", panel=DISTURBED)


@dataclass(frozen=True, slots=True)
class NoiseFlags:
    """Sizes of the disturbances; None for a flag that is not typed."""

    range_noise: float | None = _part(RANGE_NOISE, "0.025")
    wheel_slip: float | None = _part(WHEEL_SLIP, "0.03")
    motor_lag: float | None = _part(MOTOR_LAG, "0")
    delay: int | None = _part(DELAY, "1")
    wheel_gains: float | None = _part(WHEEL_GAINS, "0")
    axle_error: float | None = _part(AXLE_ERROR, "0")
    range_dropout: float | None = _part(RANGE_DROPOUT, "0")
    wheel_radius_error: float | None = _part(WHEEL_RADII)
    pose_noise: float | None = _part(POSE_NOISE)
    heading_noise: float | None = _part(HEADING_NOISE)
    pose_correlation: float | None = _part(POSE_CORRELATION)
    pose_jumps: float | None = _part(POSE_JUMPS)
    pose_delay: int | None = _part(POSE_DELAY)
    scan_delay: int | None = _part(SCAN_DELAY)
    message_drop: float | None = _part(MESSAGE_DROP)

    @classmethod
    def of(cls, disturbance: Disturbance) -> NoiseFlags:
        """The flags to type for a disturbance: what differs from the defaults."""
        usual, wanted = asdict(type(disturbance)()), asdict(disturbance)
        return cls(**{name: v for name, v in wanted.items() if v != usual[name]})

    @property
    def sizes(self) -> dict[str, Any]:
        """The typed values, by name."""
        return {each.name: getattr(self, each.name) for each in typed_fields(self)}

    def on_set(self, tasks: TaskSet) -> TaskSet:
        """A task set with the typed values; the set itself without any.

        Raises:
            TaskError: A value is out of range, or the set's robot lacks it.
        """
        if not self.sizes:
            return tasks
        # Task sets need much that a task does not.
        from tdac_agent.problems.disturbed_set import disturbed_set

        return disturbed_set(tasks, self.sizes)

    def disturbance(self, task: Task) -> Disturbance:
        """The disturbance: the typed values, those of the task for the others.

        Raises:
            TaskError: A value is out of range, or the task's environment lacks it.
        """
        own = task.own_disturbance(**self.sizes)
        task.disturbed_options(own)
        return own
