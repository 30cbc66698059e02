"""Schema of `set.yaml`: worlds, robot, observations and disturbances of a task set."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationError,
    model_validator,
)

from tdac_envs.core.errors import TaskError, first_problem, hint, one_line_reason
from tdac_envs.core.hashing import sha256_of
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, read_file
from tdac_envs.core.strict_model import StrictModel
from tdac_envs.drive.disturbances import Disturbances
from tdac_envs.epuck.kernels import WHEEL_RADIUS
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.ladder.files.spec import FilesSpec
from tdac_envs.ladder.generators.plates import Plates
from tdac_envs.ladder.generators.registry import AnyParameters
from tdac_envs.ladder.moving import MoversOfSet
from tdac_envs.ladder.plate_worlds import PlatesSpec
from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_disturbances import ONLY_ON_MAPS, DisturbanceSpec
from tdac_envs.ladder.set_limits import AdmissionSpec, CpuSpec, HorizonSpec
from tdac_envs.ladder.set_robot import metres_per_px, with_named_robot
from tdac_envs.ladder.worlds import WorldSpec
from tdac_envs.mapping.params import Length, RobotParams
from tdac_envs.robots.bundled import placed_robot

Observed = Literal[
    "pose", "goal", "wheel_speeds", "ranges", "odometry", "ps", "encoders"
]
"""Observation keys that a set may have."""
_ALL_ROBOTS = {"pose", "goal", "wheel_speeds", "odometry"}
_CERTAIN = {
    *("motor_lag", "delay", "pose_delay", "scan_delay"),
    *("max_acceleration", "range_min", "pose_correlation"),
}
"""Disturbances that draw no numbers."""
Split = Literal["train", "dev", "test", "hidden"]
LEVEL_ROBOT = RobotParams(
    radius=8.0,
    axle_length=11.0,
    max_wheel_speed=30.0,
    n_rays=18,
    field_of_view_deg=110.0,
    range_max=60.0,
)
"""The robot of the levels on maps, and the default of a set."""
SLIP_STEP = 0.1
"""Duration of the step for which `wheel_slip` of a set is stated, s."""


def _distinct(keys: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(keys)) < len(keys):
        raise ValueError("expected each key once")
    return keys


MOST_CONTACTS = 0.05


def _robot_of(given: Any) -> Any:
    """The robot of a file: an e-puck if it has a `kind`, else that of maps."""
    if not isinstance(given, dict):
        return given
    model = EPuckRobotParams if "kind" in given else RobotParams
    try:
        return model.model_validate(given)
    except ValidationError as error:
        # The validation error names the key `robot`.
        raise ValueError(first_problem(error, model)) from None


class SetFile(StrictModel):
    """Contents of `set.yaml`, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    name: str = Field(min_length=1, max_length=60, pattern=r"^[A-Za-z0-9][\w.-]*$")
    description: str = Field("", max_length=2000)
    worlds: tuple[
        Annotated[AnyParameters | Plates, Field(discriminator="name")], ...
    ] = Field(max_length=16, description="Generators, with equal shares.")
    files: FilesSpec | None = Field(
        None, description="Worlds from files; `worlds: {folder: …}` is short for it."
    )
    robot: Annotated[RobotParams | EPuckRobotParams, BeforeValidator(_robot_of)] = (
        LEVEL_ROBOT
    )
    resolution: Length | None = Field(
        None, description="Metres per px of the worlds: the robot observes metres."
    )
    dt: float = Field(0.1, ge=0.01, le=1, description="Duration of a step, s.")
    goal_tolerance: Length = Field(4.0, le=100, description="px or m")
    observed: Annotated[tuple[Observed, ...], AfterValidator(_distinct)] = Field(
        ("pose", "goal", "wheel_speeds", "ranges"), min_length=1
    )
    frame: Literal["map", "start"] = Field(
        "start", description="Whose origin and heading poses and the goal refer to."
    )
    map: bool = Field(False, description="Whether the map is given.")
    movers: tuple[MoversOfSet, ...] = Field((), max_length=8)
    disturbances: DisturbanceSpec = DisturbanceSpec()
    horizon: HorizonSpec = HorizonSpec()
    admission: AdmissionSpec = AdmissionSpec()
    cpu: CpuSpec = CpuSpec()
    bar: float = Field(
        0.95, gt=0.05, lt=1, description="Success rate of a verified controller."
    )
    worlds_of: str = Field(
        "",
        pattern=r"^([0-9a-f]{64})?$",
        description="Hash of the set whose public worlds it has; empty for its own.",
    )
    most_contacts: float = Field(
        MOST_CONTACTS,
        gt=0.01,
        lt=1,
        description="Share of episodes with a contact at which none is verified.",
    )

    @model_validator(mode="before")
    @classmethod
    def _worlds_or_files(cls, values: Any) -> Any:
        """Moves `worlds`, if it has the keys of `FilesSpec`, to `files`.

        The name of a robot stands for the values of its file.
        """
        if isinstance(values, dict) and isinstance(values.get("robot"), str):
            try:
                values = with_named_robot(values)
            except TaskError as error:
                raise ValueError(f"robot: {error}") from None
        if isinstance(values, dict) and isinstance(values.get("worlds"), dict):
            return {**values, "worlds": (), "files": values["worlds"]}
        return values

    @model_validator(mode="after")
    def _check(self) -> Self:
        own = self.disturbances
        if bool(self.worlds) == (self.files is not None):
            raise ValueError("worlds: expected generators, or a folder of maps")
        if self.files is not None and self.admission != AdmissionSpec():
            raise ValueError("`admission` is for generators, not for worlds of files")
        try:
            reception = own.reception
        except TaskError as error:
            raise ValueError(str(error)) from None
        if reception.has_errors and "pose" not in self.observed:
            raise ValueError("errors of the pose need `pose` in `observed`")
        if "odometry" not in self.observed and (
            own.odometry_scale or own.odometry_noise
        ):
            raise ValueError("errors of the odometry need `odometry` in `observed`")
        if self.map and self.frame != "map":
            raise ValueError("a set with `map: true` needs `frame: map`")
        if self.files is not None and self.files.runs > 1 and not self._is_random:
            raise ValueError(
                "`runs` needs `disturbances` that are random, such as range_noise: "
                "without them, all runs on a world are the same"
            )
        self._check_robot()
        for number in range(len(self.worlds)):
            self.spec(number)  # checks the sizes of the robot and of a step
        return self

    @property
    def _is_random(self) -> bool:
        """Whether two episodes in a world differ."""
        values = self.disturbances.model_dump(exclude=_CERTAIN)
        return any(values.values()) or bool(self.movers)

    def _check_robot(self) -> None:
        """Checks that worlds and observations are those of the robot."""
        epuck = self.is_epuck
        whose = "an e-puck" if epuck else "a robot on maps"
        if epuck and self.resolution is not None:
            raise ValueError("`resolution` is for robots on maps")
        if epuck and (self.files is not None or self.map):
            raise ValueError("an e-puck drives in generated worlds, without a map")
        if any(isinstance(each, Plates) != epuck for each in self.worlds):
            raise ValueError("`robot: {kind: epuck}` and the worlds plates go together")
        own = {"ps", "encoders"} if epuck else {"ranges"}
        for key in self.observed:
            if key not in _ALL_ROBOTS | own:
                raise ValueError(f"{whose} does not observe `{key}`")
        if epuck and self.movers:
            raise ValueError("`movers` are for robots on maps")
        for name in ONLY_ON_MAPS:
            if epuck and getattr(self.disturbances, name):
                raise ValueError(
                    f"disturbances.{name}: an e-puck has no ranges and no localiser; "
                    "expected `robot.sensor_noise` or `robot.wheel_radius_error`"
                )

    @property
    def is_epuck(self) -> bool:
        """Whether the robot is an e-puck, which drives in Webots worlds."""
        return isinstance(self.robot, EPuckRobotParams)

    @property
    def unit(self) -> Literal["px", "m"]:
        """Unit of lengths here, of worlds and of reports."""
        return "m" if self.is_epuck else "px"

    @property
    def shown_unit(self) -> Literal["px", "m"]:
        """Unit of lengths that the robot observes, and that are printed."""
        return self.unit if self.resolution is None else "m"

    @property
    def per_unit(self) -> float:
        """Size of a unit of lengths here in the shown one."""
        return 1.0 if self.resolution is None else self.resolution

    @property
    def units(self) -> MapUnits:
        """The shown units, to convert lengths of a set on maps."""
        return PIXELS if self.resolution is None else metres_per_px(self.resolution)

    @property
    def full_step(self) -> float:
        """Distance of one step at full speed, px or m."""
        rim = WHEEL_RADIUS if isinstance(self.robot, EPuckRobotParams) else 1.0
        return self.robot.max_wheel_speed * rim * self.dt

    @property
    def largest_side(self) -> float:
        """Largest width or height of a generated world, px or m."""
        return max(
            each.sides[1] if isinstance(each, Plates) else max(each.width, each.height)
            for each in self.worlds
        )

    @property
    def slip(self) -> float:
        """Relative standard deviation of a wheel's slip in a step of `dt`."""
        return self.disturbances.wheel_slip * math.sqrt(SLIP_STEP / self.dt)

    @property
    def errors(self) -> Disturbances:
        """The disturbances of wheels and odometry."""
        own, robot = self.disturbances, self.robot
        return Disturbances(
            wheel_slip=self.slip,
            wheel_gains=own.wheel_gains,
            axle_error=own.axle_error,
            odometry="odometry" in self.observed,
            odometry_scale=own.odometry_scale,
            odometry_noise=own.odometry_noise,
            wheel_radius_error=(
                robot.wheel_radius_error
                if isinstance(robot, EPuckRobotParams)
                else own.wheel_radius_error
            ),
        )

    def spec(self, index: int) -> WorldSpec | PlatesSpec:
        """What generated world `index` is like; generators take turns."""
        generator, own = self.worlds[index % len(self.worlds)], self.admission
        if isinstance(generator, Plates):
            detour = {} if own.detour is None else {"min_detour": own.detour}
            return PlatesSpec(
                generator=generator,
                step=self.full_step,
                dt=self.dt,
                tolerance=self.goal_tolerance,
                min_gap=own.gap,
                min_steps=own.steps,
                tries=own.tries,
                **detour,
            )
        return WorldSpec(
            generator=generator,
            radius=self.robot.radius,
            step=self.full_step,
            tolerance=self.goal_tolerance,
            min_gap=own.gap,
            min_steps=own.steps,
            min_detour=own.detour,
            tries=own.tries,
        )

    def sha256(self, files_sha256: str | None = None) -> str:
        """SHA-256 of the canonical JSON of all values but the description.

        Args:
            files_sha256: Hash of the worlds, if they come from files: it stands for
                the place of the files.
        """
        out = {"description", "files"}
        # Sets without them keep the hash that they had before.
        unused = "movers", "resolution", "worlds_of"
        out |= {name for name in unused if not getattr(self, name)}
        if self.most_contacts == MOST_CONTACTS:
            out.add("most_contacts")
        values = self.model_dump(mode="json", by_alias=True, exclude=out)
        values["disturbances"] = self.disturbances.written()
        if self.files is not None:
            splits = list(self.files.splits)
            values["files"] = {"sha256": files_sha256, "splits": splits}
            if self.files.tests or self.files.runs > 1:
                more = {"tests": list(self.files.tests), "runs": self.files.runs}
                values["files"] |= more
        return sha256_of(json.dumps(values, sort_keys=True, separators=(",", ":")))


def read_set_file(path: Path) -> SetFile:
    """Reads a `set.yaml`.

    Without a `name`, the set has that of its file, or of the folder of a `set.yaml`.

    Raises:
        TaskError: The file cannot be read, or a value is not valid.
    """
    try:
        values: Any = parse_yaml(read_file(path, TEXT_BYTES))
        if not isinstance(values, dict):
            raise ValueError("expected keys with values, such as `worlds: [...]`")
        name = path.absolute().parent.name if path.stem == "set" else path.stem
        return SetFile.model_validate({"name": name, **_placed(values, path)})
    except ValidationError as error:
        problem = first_problem(error, SetFile).replace("files.", "worlds.")
        raise TaskError(f"{path}: {problem}") from None
    except (OSError, ValueError) as error:
        raise TaskError(f"{path}: {one_line_reason(error)}") from None


def _placed(values: dict[Any, Any], path: Path) -> dict[Any, Any]:
    """The values of a set, with the places of its files relative to its own."""
    own = path.absolute().parent
    if isinstance(robot := values.get("robot"), str):
        values = {**values, "robot": str(placed_robot(robot, own))}
    key = "worlds" if isinstance(values.get("worlds"), dict) else "files"
    files = values.get(key)
    if not isinstance(files, dict):
        return values
    placed = {
        name: str(own / value)
        if name in ("folder", "barn") and isinstance(value, str)
        else value
        for name, value in files.items()
    }
    return {**values, key: placed}


BUILT_IN = Path(__file__).parent / "sets"
"""Folder of the sets that come with the package."""


def set_names() -> tuple[str, ...]:
    """Names of the levels, the easiest first."""
    return "known", "unknown", "lost", "moving", "crowd", "epuck", "floor"


def shipped_names() -> tuple[str, ...]:
    """Names of all sets that come with the package: the levels, then others."""
    return *set_names(), "barn", "barn-slow"


def find_set_file(name: str | Path) -> SetFile:
    """The set of a name or of a path of a `set.yaml`.

    Raises:
        TaskError: There is none, or it is not valid.
    """
    names = shipped_names()
    if not isinstance(name, str | Path):
        raise TaskError(f"expected the name or path of a task set, got {name!r:.100}")
    if str(name) in names:
        return read_set_file(BUILT_IN / f"{name}.yaml")
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        return read_set_file(path)
    if (path / "set.yaml").is_file():
        return read_set_file(path / "set.yaml")
    raise TaskError(
        f"unknown task set {str(name)!r}; expected {', '.join(names)} or the path of "
        f"a set.yaml or its folder{hint(str(name), names)}"
    )
