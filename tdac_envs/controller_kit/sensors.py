"""Map, robot and range sensor of this task, for use by `controller.py`.

Needs only the standard library and numpy. Pixel frame: x to the right, y DOWN,
heading in radians from +x towards +y, so a robot of heading 0 looks right and a
positive turn goes clockwise on the screen. Arrays are indexed [y, x]. Pixel (i, j)
is the square [i - 1/2, i + 1/2) x [j - 1/2, j + 1/2); everything outside the map is
occupied. File names without a folder are looked up beside this file.

Where `frame` in params.json is "metres", places, lengths and headings are in metres and
radians of the map's frame instead, with y UP, and a positive turn goes to the left. The
map stays an array of pixels: `to_cell`, `to_point` and `to_pixels` convert.

Of an e-puck in a world (`world.wbt`), only `HERE`, `load_params` and `show` are of use.
"""

import functools
import json
import math
import os
import struct
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent


def load_occupancy(path: str | Path = "occupancy.npy") -> NDArray[np.bool_]:
    """The map: shape (height, width), bool, indexed [y, x], True = occupied.

    Args:
        path: A `.npy` array, or a `.png` (8-bit grey or RGB, dark = occupied).
    """
    file = HERE / path
    if file.suffix.lower() == ".npy":
        return np.asarray(np.load(file, allow_pickle=False), np.bool_)
    return np.asarray(_read_png(file).mean(axis=2) < 128)


def load_params(path: str | Path = "params.json") -> dict[str, Any]:
    """The task, lengths in px (or m, as `frame` says), angles in rad unless named so.

    Returns:
        `start` [x, y], `heading`, `goal` [x, y], `width`, `height`, `inflation`
        (margin proposed for planning), `frame` ("pixels" or "metres"), `resolution`
        (metres per pixel or None), `origin` (pose of the map's lower-left corner, m and
        rad) and `robot`, a dict of `radius`, `axle_length`, `max_wheel_speed` (px/s or
        m/s), `n_rays`, `field_of_view_deg`, `range_max` and `ray_angles` (from the
        heading, in the order of `ranges`); and how the map was made.
    """
    params: dict[str, Any] = json.loads((HERE / path).read_text(encoding="utf-8"))
    robot = params.get("robot", {})
    if "n_rays" in robot and "ray_angles" not in robot:  # from an earlier version
        angles = _even_fan(robot["n_rays"], robot["field_of_view_deg"])
        robot["ray_angles"] = (angles if _is_down(params) else -angles).tolist()
    return params


def to_pixels(x: float, y: float, heading: float = 0.0) -> tuple[float, float, float]:
    """A place or pose in pixels; the same if `frame` is "pixels"."""
    frame = _frame()
    if frame is None:
        return x, y, heading
    resolution, height, x0, y0, yaw = frame
    right = math.cos(yaw) * (x - x0) + math.sin(yaw) * (y - y0)
    up = math.cos(yaw) * (y - y0) - math.sin(yaw) * (x - x0)
    return right / resolution - 0.5, height - 0.5 - up / resolution, yaw - heading


def to_cell(x: float, y: float) -> tuple[int, int]:
    """The pixel (i, j) that contains a place; the map there is `occ[j, i]`."""
    u, v, _ = to_pixels(x, y)
    return math.floor(u + 0.5), math.floor(v + 0.5)


def to_point(i: float, j: float) -> tuple[float, float]:
    """The centre of pixel (i, j), in the frame of this task."""
    frame = _frame()
    if frame is None:
        return float(i), float(j)
    resolution, height, x0, y0, yaw = frame
    right, up = (i + 0.5) * resolution, (height - 0.5 - j) * resolution
    x = x0 + math.cos(yaw) * right - math.sin(yaw) * up
    return x, y0 + math.sin(yaw) * right + math.cos(yaw) * up


def ray_ends(
    ranges: Sequence[float], pose: Sequence[float] = (0.0, 0.0, 0.0)
) -> NDArray[np.float64]:
    """Where the rays of a scan end; it accounts for `scanner_offset`.

    Args:
        ranges: The scan, in the order of `ray_angles`; no hit ends at `range_max`.
        pose: x, y, heading of the robot. Without it, places are relative to the robot:
            ahead of its centre, and to the side of positive angles.

    Returns:
        Shape (n_rays, 2), px or m.
    """
    return _ends(ranges, pose, *_scanner())


class Ultrasonic:
    """The robot's range sensor: a fan of exact rays over the occupancy grid.

    Ray i points at `heading + angles[i]`. With the number of rays and the angle of
    params.json, these are its `ray_angles`. Otherwise they are even: `ranges[0]` is the
    robot's LEFTMOST ray, `ranges[-1]` its rightmost, at -fov/2 and +fov/2 in pixels (y
    points down), at +fov/2 and -fov/2 in metres; the rays of a full circle begin behind
    the robot and are 360/n degrees apart. A single ray points straight ahead.

    Args:
        occ: Shape (height, width), bool, True = occupied.
        n_rays: Number of rays.
        field_of_view_deg: Whole angle of the fan, degrees.
        range_max: Reading of a ray that hits nothing, px or m.
    """

    def __init__(
        self,
        occ: NDArray[np.bool_],
        n_rays: int = 18,
        field_of_view_deg: float = 110.0,
        range_max: float = 220.0,
    ) -> None:
        occ = np.asarray(occ, dtype=np.bool_)
        self.height, self.width = occ.shape
        self.range_max = float(range_max)
        frame = _frame()
        self.angles = _ray_angles(n_rays, field_of_view_deg)
        turns = self.angles if frame is None else -self.angles
        self._ways = [(math.cos(turn), math.sin(turn)) for turn in turns.tolist()]
        self._pixel = 1.0 if frame is None else frame[0]
        self._reach = self.range_max / self._pixel
        ahead, aside = _scanner_offset(n_rays, field_of_view_deg)
        aside = aside if frame is None else -aside  # to the left in metres
        self._offset = ahead / self._pixel, aside / self._pixel
        # A rim of obstacles stands for the outside; bytes are quick to index.
        self._cells = np.pad(occ, 1, constant_values=True).tobytes()

    def ranges(self, x: float, y: float, heading: float) -> NDArray[np.float32]:
        """Distances to the first obstacle along each ray, for the robot at a pose.

        They are from the robot's centre, or from its `scanner_offset` in params.json.

        Returns:
            Shape (n_rays,), float32, px or m; `range_max` without a hit, and 0 where
            the rays would start in an obstacle.
        """
        x, y, heading = to_pixels(float(x), float(y), float(heading))
        c, s = math.cos(heading), math.sin(heading)
        ahead, aside = self._offset
        x, y = x + ahead * c - aside * s, y + ahead * s + aside * c
        hits = [self._cast(x, y, c * a - s * b, s * a + c * b) for a, b in self._ways]
        return np.array(hits, np.float32) * np.float32(self._pixel)

    def _cast(self, x: float, y: float, dx: float, dy: float) -> float:
        """Walks from pixel to pixel in the order in which the ray enters them."""
        u, v = x + 1.5, y + 1.5  # in the map with its rim
        i, j = math.floor(u), math.floor(v)
        if not (0 <= i < self.width + 2 and 0 <= j < self.height + 2):
            return 0.0
        cells, pitch = self._cells, self.width + 2
        if cells[j * pitch + i]:
            return 0.0
        step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        ahead_x, ahead_y = (1 if dx > 0 else 0), (1 if dy > 0 else 0)
        per_x, per_y = (1 / dx if dx else math.inf), (1 / dy if dy else math.inf)
        next_x = (i + ahead_x - u) * per_x if dx else math.inf
        next_y = (j + ahead_y - v) * per_y if dy else math.inf
        while True:
            if next_x < next_y:
                distance, i = next_x, i + step_x
                next_x = (i + ahead_x - u) * per_x
            else:
                distance, j = next_y, j + step_y
                next_y = (j + ahead_y - v) * per_y
            if distance >= self._reach:
                return self._reach
            if cells[j * pitch + i]:
                return max(distance, 0.0)


class Graphics:
    """A pygame window: map, goal, trail, rays and the robot. Optional, for people.

    Args:
        occ: Shape (height, width), bool, True = occupied.
        params: From `load_params`.
        robot_image: Picture of the robot looking right; a disc where it is missing.
    """

    def __init__(
        self,
        occ: NDArray[np.bool_],
        params: Mapping[str, Any],
        robot_image: str | Path = "robot.png",
    ) -> None:
        try:
            import pygame
        except ImportError:
            hint = "Graphics needs pygame: pip install pygame-ce"
            raise ImportError(hint) from None
        self._pygame, self._robot = pygame, params["robot"]
        height, width = occ.shape
        self._scale = scale = min(1200 / width, 850 / height, 4.0)
        pygame.display.init()
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        self._screen = pygame.display.set_mode(size)
        pygame.display.set_caption("TDAC-Map2D")
        colours = np.where(occ.T[..., None], (51, 60, 76), (248, 247, 243))
        picture = pygame.surfarray.make_surface(colours.astype(np.uint8))
        self._map = pygame.transform.scale(picture, size)
        for point, colour in (
            (params["start"], "gray55"),
            (params["goal"], "seagreen"),
        ):
            if point is not None:
                pygame.draw.circle(self._map, colour, self._to_screen(*point), 7, 3)
        self._body = None
        if (HERE / robot_image).exists():
            self._body = pygame.image.load(str(HERE / robot_image)).convert_alpha()
        self._trail: list[tuple[float, float]] = []

    def _to_screen(self, x: float, y: float) -> tuple[float, float]:
        u, v, _ = to_pixels(x, y)
        return (u + 0.5) * self._scale, (v + 0.5) * self._scale

    def draw(self, pose: Sequence[float], ranges: Sequence[float] = ()) -> bool:
        """Shows the robot at `pose` (x, y, heading) with its rays.

        Returns:
            False once the window has been closed.
        """
        pygame, screen = self._pygame, self._screen
        x, y, heading = (float(value) for value in pose)
        centre = self._to_screen(x, y)
        self._trail.append(centre)
        screen.blit(self._map, (0, 0))
        rays = len(ranges), self._robot["field_of_view_deg"]
        scanner = _ray_angles(*rays), _scanner_offset(*rays)
        begins = _ends([0.0] * len(ranges), pose, *scanner).tolist()
        for begin, end in zip(
            begins, _ends(ranges, pose, *scanner).tolist(), strict=True
        ):
            ends = self._to_screen(*begin), self._to_screen(*end)
            pygame.draw.aaline(screen, (226, 150, 70), *ends)
        if len(self._trail) > 1:
            pygame.draw.lines(screen, (98, 84, 190), False, self._trail, 2)
        self._draw_body(centre, to_pixels(x, y, heading)[2])
        pygame.display.flip()
        return all(event.type != pygame.QUIT for event in pygame.event.get())

    def _draw_body(self, centre: tuple[float, float], heading: float) -> None:
        frame = _frame()
        pixel = 1.0 if frame is None else frame[0]
        pygame = self._pygame
        radius = max(self._robot["radius"] / pixel * self._scale, 3.0)
        if self._body is not None:
            zoom = 2 * radius / self._body.get_width()
            turned = pygame.transform.rotozoom(self._body, -math.degrees(heading), zoom)
            self._screen.blit(turned, turned.get_rect(center=centre))
            return
        nose_x = centre[0] + radius * math.cos(heading)
        nose_y = centre[1] + radius * math.sin(heading)
        pygame.draw.circle(self._screen, (40, 110, 180), centre, radius)
        pygame.draw.line(self._screen, "white", centre, (nose_x, nose_y), 2)

    def close(self) -> None:
        """Closes the window."""
        self._pygame.display.quit()


def show(
    policy: Callable[[dict[str, Any]], Any],
    reset: Callable[[dict[str, Any]], Any] | None = None,
) -> None:
    """Runs one episode of this folder's task with `policy` and shows it.

    Opens a window where there is a display and pygame, else writes
    `controller.mp4` beside this file; then prints how the episode ended. Closing the
    window stops it.

    Args:
        policy: Maps an observation to (left, right), each in [-1, 1].
        reset: Called once with the first observation, before `policy`.
    """
    try:
        import gymnasium

        from tdac_envs.drawing.video import write_video
    except ImportError:
        needed = "show() needs the simulator: use the Python that has tdac installed"
        raise SystemExit(needed) from None
    mode = "human" if _has_window() else "rgb_array"
    name, arguments = _environment()
    env: Any = gymnasium.make(f"tdac_envs:{name}", render_mode=mode, **arguments)
    outcome: list[str] = []
    frames = _episode(env, policy, reset, outcome)
    try:
        if mode == "human":
            for _ in frames:
                pass
        else:
            real_time = env.metadata["render_fps"] / 2  # every second step is drawn
            write_video(frames, HERE / "controller.mp4", fps=real_time)
            print("no display: wrote", HERE / "controller.mp4", "(in real time)")
    except KeyboardInterrupt:
        outcome.append("stopped")
    finally:
        env.close()
    print(outcome[0])


def _environment() -> tuple[str, dict[str, Any]]:
    """Name and arguments of the environment of this folder's task."""
    if not (HERE / "world.wbt").exists():
        frame = load_params().get("frame", "pixels")
        return "TDAC-Map2D-v0", {"map": str(HERE), "frame": frame}
    params = load_params()
    same = ("goal", "goal_tolerance", "dt", "horizon")
    return "TDAC-EPuck-v0", {
        "world": str(HERE / "world.wbt"),
        "start": [*params["start"], params["heading"]],
        **{key: params[key] for key in same},
    }


@functools.lru_cache(maxsize=1)
def _frame() -> tuple[float, float, float, float, float] | None:
    """Resolution, height (px), and origin (x, y, yaw) of the map; None for pixels."""
    if not (HERE / "params.json").exists():
        return None
    params = load_params()
    if _is_down(params):
        return None
    return (params["resolution"], params["height"], *params["origin"])


def _is_down(params: Mapping[str, Any]) -> bool:
    """Whether y points down, as it does in pixels."""
    return bool(params.get("frame", "pixels") != "metres")


def _ends(
    ranges: Sequence[float],
    pose: Sequence[float],
    angles: NDArray[np.float64],
    offset: tuple[float, float],
) -> NDArray[np.float64]:
    """Where rays end that start at an offset from the centre; see `ray_ends`."""
    x, y, heading = (float(value) for value in pose)
    (ahead, aside), far = offset, np.asarray(ranges, np.float64)
    c, s = math.cos(heading), math.sin(heading)
    x, y = x + ahead * c - aside * s, y + ahead * s + aside * c
    turns = heading + angles
    return np.column_stack([x + far * np.cos(turns), y + far * np.sin(turns)])


@functools.lru_cache(maxsize=1)
def _scanner() -> tuple[NDArray[np.float64], tuple[float, float]]:
    """Angles of the rays of params.json, and where they start from the centre."""
    robot = load_params()["robot"]
    ahead, aside = robot.get("scanner_offset", (0.0, 0.0))
    return np.array(robot["ray_angles"]), (float(ahead), float(aside))


def _ray_angles(n_rays: int, field_of_view_deg: float) -> NDArray[np.float64]:
    """Those of params.json for its robot, else an even fan; see `Ultrasonic`."""
    robot = _robot_with(n_rays, field_of_view_deg)
    if robot:
        return np.array(robot["ray_angles"])
    params = load_params() if (HERE / "params.json").exists() else {}
    angles = _even_fan(n_rays, field_of_view_deg)
    return angles if _is_down(params) else -angles


def _scanner_offset(n_rays: int, field_of_view_deg: float) -> tuple[float, float]:
    """Where the rays of the robot of params.json start, from its centre."""
    robot = _robot_with(n_rays, field_of_view_deg)
    ahead, aside = robot.get("scanner_offset", (0.0, 0.0))
    return float(ahead), float(aside)


def _robot_with(n_rays: int, field_of_view_deg: float) -> dict[str, Any]:
    """The robot of params.json if it has such rays, else an empty dict."""
    params = load_params() if (HERE / "params.json").exists() else {}
    robot: dict[str, Any] = params.get("robot", {})
    known = robot.get("n_rays"), robot.get("field_of_view_deg")
    return robot if known == (n_rays, field_of_view_deg) else {}


def _even_fan(n_rays: int, field_of_view_deg: float) -> NDArray[np.float64]:
    """Angles of an even fan from the robot's left to its right, y down, rad."""
    if n_rays <= 1:
        return np.zeros(n_rays)
    view = math.radians(field_of_view_deg)
    gaps = n_rays if field_of_view_deg == 360 else n_rays - 1
    return np.asarray(-0.5 * view + view / gaps * np.arange(n_rays))


def _has_window() -> bool:
    try:
        import pygame  # noqa: F401
    except ImportError:
        return False
    desktop = sys.platform in ("win32", "darwin")
    return desktop or any(os.environ.get(k) for k in ("DISPLAY", "WAYLAND_DISPLAY"))


def _episode(
    env: Any,
    policy: Callable[[dict[str, Any]], Any],
    reset: Callable[[dict[str, Any]], Any] | None,
    outcome: list[str],
) -> Iterator[Any]:
    """Steps the env and yields every second frame and the last one."""
    obs, info = env.reset(seed=0)
    if reset is not None:
        reset(obs)
    steps, done = 0, False
    while not done:
        if steps % 2 == 0:
            yield env.render()
        obs, _, terminated, truncated, info = env.step(policy(obs))
        steps, done = steps + 1, terminated or truncated
    yield env.render()
    end = "collided" if info.get("collision") else "not reached"
    outcome.append(f"{'reached' if info.get('is_success') else end}, {steps} steps")


def _read_png(file: Path) -> NDArray[np.uint8]:
    """Pixels of an 8-bit grey or RGB PNG, shape (height, width, 1 or 3)."""
    data = file.read_bytes()
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise ValueError(f"{file}: expected a PNG file")
    head, packed, at = b"", b"", 8
    while at + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body, at = data[at + 8 : at + 8 + size], at + 12 + size
        head = body if kind == b"IHDR" else head
        packed += body if kind == b"IDAT" else b""
    width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", head)
    channels = {0: 1, 2: 3}.get(colour)
    if depth != 8 or channels is None or interlaced:
        raise ValueError(f"{file}: expected 8-bit grey or RGB without interlacing")
    raw = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, -1)
    image = np.zeros((height + 1, width, channels), np.uint8)
    for j in range(height):
        row = raw[j, 1:].reshape(width, channels)
        image[j + 1] = _unfilter(int(raw[j, 0]), row, image[j])
    return image[1:]


def _unfilter(
    kind: int, row: NDArray[np.uint8], above: NDArray[np.uint8]
) -> NDArray[np.uint8] | list[list[int]]:
    """Undoes a row's filter: none, left, up, average of the two, or Paeth."""
    if kind == 0:
        return row
    if kind == 1:
        return np.cumsum(row, axis=0, dtype=np.uint8)
    if kind == 2:
        return row + above
    channels = row.shape[1]
    left, corner, pixels = [0] * channels, [0] * channels, []
    for delta, up in zip(row.tolist(), above.tolist(), strict=True):
        guess = map(_paeth if kind == 4 else _average, left, up, corner)
        left = [(d + g) & 255 for d, g in zip(delta, guess, strict=True)]
        corner = up
        pixels.append(left)
    return pixels


def _average(left: int, up: int, _corner: int) -> int:
    return (left + up) // 2


def _paeth(left: int, up: int, corner: int) -> int:
    """Whichever neighbour is nearest to left + up - corner."""
    estimate = left + up - corner
    return min((left, up, corner), key=lambda value: abs(estimate - value))
