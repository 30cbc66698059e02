"""Measures preprocessing on simulated photographs of plans with known truth.

    python benchmarks/photos.py [DIR] [--photos N] [--seed S] [--no-task]

Each drawing is rendered as ink on paper, dark on light or light on dark, and then as a
poor photograph of it: a gradient of light, a vignette, a soft shadow, blur, a small
rotation, noise and JPEG. The drawings are generated, or made from the truth masks of
DIR, which has an `index.json` as for `real_maps.py`.

Columns: right: accepted with the right polarity, and the path avoids the true walls;
wrong: the other polarity; crossed: a path through a true wall; close: refused because
both polarities are likely; refused: for another reason.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TdacError
from tdac_envs.grid.grid import BoolGrid, OccupancyGrid, body_free, clearance
from tdac_envs.mapping.image import ColourImage, luminance
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.map_folder import planned_path
from tdac_envs.mapping.params import MapParams
from tdac_envs.mapping.preprocessing import preprocess
from tdac_envs.mapping.score import connected

Point = tuple[int, int]
Field = NDArray[np.float64]

SIDE = 700
"""Longest side of a drawing, px."""
PAGE = 30
"""Width of the empty margin around a drawing, px."""


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """A plan to photograph.

    Attributes:
        name: Displayed name.
        truth: Shape (height, width), bool, True = wall.
        start: (x, y), px.
        goal: (x, y), px.
        radius: Radius of the body, px.
    """

    name: str
    truth: BoolGrid
    start: Point
    goal: Point
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A photograph, and its drawing, rotated like the picture."""

    drawing: Drawing
    picture: ColourImage
    polarity: str
    about: str


# ---------------------------------------------------------------- drawings


def drawings() -> list[Drawing]:
    """Several kinds of plans, made of lines and of areas."""
    made = [
        _rooms(0, wall=6),
        _rooms(1, wall=3),
        _rooms(2, wall=12),
        _maze(3, wall=7),
        _maze(4, wall=14),
        _cave(5),
        _pillars(6),
        _corridors(7),
    ]
    return [_with_page(drawing) for drawing in made]


def _rooms(seed: int, wall: int) -> Drawing:
    """Rooms in rows, with doors along a tree that joins all rooms."""
    rng = np.random.default_rng(seed)
    truth = _lattice(rng, 4, 5, 110, wall, door=50)
    return Drawing(f"rooms {wall} px", truth, (55, 55), (495, 385), 11.0)


def _maze(seed: int, wall: int) -> Drawing:
    """A maze: openings are as wide as the cells."""
    rng = np.random.default_rng(seed)
    truth = _lattice(rng, 7, 9, 66, wall, door=66)
    return Drawing(f"maze {wall} px", truth, (33, 33), (8 * 66 + 33, 33), 11.0)


def _lattice(
    rng: np.random.Generator, rows: int, columns: int, pitch: int, wall: int, door: int
) -> BoolGrid:
    image = np.zeros((rows * pitch + 1, columns * pitch + 1), np.uint8)
    for y in range(rows + 1):
        cv2.line(image, (0, y * pitch), (columns * pitch, y * pitch), 255, wall)
    for x in range(columns + 1):
        cv2.line(image, (x * pitch, 0), (x * pitch, rows * pitch), 255, wall)
    for (y, x), (v, u) in _tree(rng, rows, columns):
        middle = np.array([x + u + 1, y + v + 1]) * pitch // 2
        half = np.array([wall, door // 2 - wall // 2 - 1])
        half = half if y == v else half[::-1]
        low, high = middle - half, middle + half
        image[low[1] : high[1] + 1, low[0] : high[0] + 1] = 0
    return image > 0


def _tree(
    rng: np.random.Generator, rows: int, columns: int
) -> Iterator[tuple[Point, Point]]:
    """Pairs of neighbouring cells for doors: a spanning tree, and some more."""
    group = {cell: cell for cell in product(range(rows), range(columns))}

    def root(cell: Point) -> Point:
        while group[cell] != cell:
            cell = group[cell]
        return cell

    steps = [(c, (c[0] + 1, c[1])) for c in group] + [
        (c, (c[0], c[1] + 1)) for c in group
    ]
    for k in rng.permutation(len(steps)):
        one, other = steps[k]
        if other not in group:
            continue
        if root(one) != root(other) or rng.random() < 0.05:
            group[root(one)] = root(other)
            yield one, other


def _cave(seed: int) -> Drawing:
    """Halls in solid rock that fills the whole page."""
    rng = np.random.default_rng(seed)
    rock = np.full((480, 640), 255, np.uint8)
    halls = np.array(
        [(90, 100), (260, 90), (420, 150), (560, 120), (520, 360), (330, 330)]
    )
    cv2.polylines(rock, [halls.astype(np.int32)], False, 0, 44)
    for x, y in halls.tolist():
        size = rng.integers(45, 75, 2).tolist()
        cv2.ellipse(rock, (x, y), size, 0, 0, 360, 0, -1)
    return Drawing("cave", rock > 0, (90, 100), (330, 330), 12.0)


def _pillars(seed: int) -> Drawing:
    rng = np.random.default_rng(seed)
    image = np.zeros((460, 620), np.uint8)
    cv2.rectangle(image, (4, 4), (615, 455), 255, 8)
    for x, y in product(range(90, 600, 90), range(70, 440, 80)):
        radius = int(rng.integers(8, 18))
        cv2.circle(image, (x + int(rng.integers(-9, 10)), y), radius, 255, -1)
    return Drawing("pillars", image > 0, (40, 30), (570, 425), 11.0)


def _corridors(seed: int) -> Drawing:
    """Walls so thick that they are blocks, with corridors between them."""
    rng = np.random.default_rng(seed)
    image = np.full((500, 660), 255, np.uint8)
    for y in (40, 180, 320, 460):
        cv2.line(image, (40, y), (620, y), 0, 40)
    for y in (40, 180, 320):
        for x in rng.choice(np.arange(60, 620, 90), 2, replace=False).tolist():
            cv2.line(image, (x, y), (x, y + 140), 0, 40)
    return Drawing("corridors", image > 0, (60, 40), (600, 460), 12.0)


def _with_page(drawing: Drawing) -> Drawing:
    """The drawing with an empty margin around it."""
    (sx, sy), (gx, gy) = drawing.start, drawing.goal
    return replace(
        drawing,
        truth=np.pad(drawing.truth, PAGE),
        start=(sx + PAGE, sy + PAGE),
        goal=(gx + PAGE, gy + PAGE),
    )


def real_drawings(folder: Path) -> list[Drawing]:
    """Drawings from a folder's truth masks, as large as the generated ones."""
    entries = json.loads((folder / "index.json").read_text())
    found = [_real(folder, entry) for entry in entries if _is_printed(entry)]
    return [drawing for drawing in found if drawing is not None]


def _is_printed(entry: dict) -> bool:
    large = entry["max_robot_radius_px"] >= 4
    return entry["expected"] == "feasible" and bool(entry.get("truth")) and large


def _real(folder: Path, entry: dict) -> Drawing | None:
    truth = luminance(load_image(folder / entry["truth"]).colour) < 128
    scale = SIDE / max(truth.shape)
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST
    grey = cv2.resize(
        truth.astype(np.float32), None, fx=scale, fy=scale, interpolation=way
    )
    # No pen is finer than two pixels.
    drawn = cv2.dilate((grey > 0.01).astype(np.uint8), np.ones((2, 2), np.uint8))
    cells = np.pad(drawn > 0, PAGE)
    (sx, sy), (gx, gy) = entry["start"], entry["goal"]
    ends = [
        (int((x + 0.5) * scale) + PAGE, int((y + 0.5) * scale) + PAGE)
        for x, y in ((sx, sy), (gx, gy))
    ]
    radius = min(12.0, 0.7 * scale * entry["max_robot_radius_px"])
    free = body_free(clearance(cells), radius + 2)
    if radius < 3 or not connected(free, *ends):
        return None
    return Drawing(entry["name"], cells, ends[0], ends[1], round(radius, 1))


# ---------------------------------------------------------------- the camera


def gradient(shape: tuple[int, ...], angle: float) -> Field:
    """A ramp from 1 to 0 across the picture, in a direction."""
    rows, columns = np.indices(shape) / np.array(shape).reshape(2, 1, 1)
    ramp = columns * np.cos(angle) + rows * np.sin(angle)
    return np.asarray((ramp.max() - ramp) / np.ptp(ramp))


def vignette(shape: tuple[int, ...]) -> Field:
    """1 in the middle, 0 in the corners."""
    rows, columns = np.indices(shape) / np.array(shape).reshape(2, 1, 1) - 0.5
    return np.asarray(1 - 2 * (rows**2 + columns**2))


def shadow(shape: tuple[int, ...], rng: np.random.Generator) -> Field:
    """1 in the light, 0 in a shadow with a straight edge."""
    ramp = gradient(shape, rng.uniform(0, 2 * np.pi))
    edge, soft = rng.uniform(0.35, 0.65), rng.uniform(0.01, 0.05)
    return np.asarray(1 / (1 + np.exp(-(ramp - edge) / soft)))


def lit(picture: Field, light: Field) -> Field:
    """The picture multiplied by the light; 1 changes nothing."""
    return picture * light[..., None]


def printed(truth: BoolGrid, polarity: str, paper: Field, ink: Field) -> Field:
    """Walls of one colour on a ground of the other; `paper` is the lighter one."""
    wall, ground = (ink, paper) if polarity == "dark" else (paper, ink)
    return np.where(truth[..., None], wall, ground).astype(np.float64)


def developed(
    picture: Field, rng: np.random.Generator, blur: float, noise: float, quality: int
) -> ColourImage:
    """The picture as stored: blurred, noisy, compressed."""
    if blur:
        picture = cv2.GaussianBlur(picture, (0, 0), blur)
    if noise:
        picture = picture + rng.normal(0, noise, picture.shape[:2])[..., None]
        picture = picture + rng.normal(0, noise / 2, picture.shape)
    levels = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    if quality >= 100:
        return levels
    data = cv2.imencode(".jpg", levels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[
        1
    ]
    return np.ascontiguousarray(cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1])


def turned(drawing: Drawing, degrees: float) -> tuple[Drawing, NDArray[np.float64]]:
    """The drawing turned about its centre, and the matrix that turns its picture."""
    height, width = drawing.truth.shape
    turn = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), degrees, 1.0)
    cells = cv2.warpAffine(
        drawing.truth.astype(np.uint8), turn, (width, height), flags=cv2.INTER_NEAREST
    )
    ends = [
        tuple(np.rint(turn @ (*p, 1)).astype(int).tolist())
        for p in (drawing.start, drawing.goal)
    ]
    return replace(drawing, truth=cells > 0, start=ends[0], goal=ends[1]), turn


def photograph(drawing: Drawing, polarity: str, rng: np.random.Generator) -> Photo:
    """A photograph under random light."""
    paper = np.array(
        [rng.uniform(215, 252), rng.uniform(205, 250), rng.uniform(170, 245)]
    )
    ink = rng.uniform(15, 75) * rng.uniform(0.8, 1.2, 3)
    page = printed(drawing.truth, polarity, paper, ink)
    degrees = rng.uniform(-6, 6) if rng.random() < 0.7 else 0.0
    drawing, turn = turned(drawing, degrees)
    size = drawing.truth.shape[::-1]
    ground = (paper if polarity == "dark" else ink).tolist()
    page = cv2.warpAffine(page, turn, size, flags=cv2.INTER_LINEAR, borderValue=ground)
    light, about = _light(drawing.truth.shape, rng)
    blur, noise = rng.uniform(0, 1.6), float(rng.choice([0.0, 2.0, 5.0, 8.0]))
    quality = int(rng.integers(60, 96))
    picture = developed(lit(page, light), rng, blur, noise, quality)
    about = (
        f"{about}, turn {degrees:.0f}, blur {blur:.1f}, noise {noise:.0f}, q {quality}"
    )
    return Photo(drawing, picture, polarity, about)


def _light(shape: tuple[int, ...], rng: np.random.Generator) -> tuple[Field, str]:
    """The light at each pixel, 0..1, and its description."""
    light, names = np.ones(shape), []
    kinds = rng.random(3) < (0.7, 0.5, 0.4)
    if kinds[0] or not kinds.any():
        least = rng.uniform(0.3, 0.7)
        light = light * (
            least + (1 - least) * gradient(shape, rng.uniform(0, 2 * np.pi))
        )
        names.append(f"gradient to {least:.1f}")
    if kinds[1]:
        least = rng.uniform(0.4, 0.8)
        light = light * (least + (1 - least) * vignette(shape))
        names.append(f"vignette to {least:.1f}")
    if kinds[2]:
        least = rng.uniform(0.5, 0.8)
        light = light * (least + (1 - least) * shadow(shape, rng))
        names.append(f"shadow {least:.1f}")
    return light, " + ".join(names)


def seven(drawing: Drawing) -> Iterator[Photo]:
    """Seven photographs of a light page that is locally 80 or more grey levels darker.

    Four gradients, two vignettes, and a gradient that is subtracted instead of
    multiplied; some have noise, none is blurred or compressed.
    """
    shape, page = drawing.truth.shape, np.array([240.0, 238.0, 232.0])
    ink = np.array([130.0, 128.0, 133.0])  # so pale that the light outweighs it
    across, down = gradient(shape, 0.0), gradient(shape, np.pi / 2)
    cases = [
        (across, 80, 0.0),
        (down, 100, 0.0),
        (1 - across, 120, 3.0),
        (gradient(shape, 2.2), 150, 6.0),
        (vignette(shape), 110, 0.0),
        (vignette(shape), 140, 4.0),
    ]
    drawn = printed(drawing.truth, "dark", page, ink)
    for number, (field, drop, noise) in enumerate(cases):
        light = 1 - drop / page.max() * (1 - field)
        rng = np.random.default_rng(number)
        picture = developed(lit(drawn, light), rng, 0.0, noise, 100)
        yield Photo(drawing, picture, "dark", f"{drop} levels, noise {noise:g}")
    taken_off = drawn - 90 * (1 - gradient(shape, 0.8))[..., None]
    picture = developed(taken_off, np.random.default_rng(6), 0.0, 0.0, 100)
    yield Photo(drawing, picture, "dark", "90 levels taken off")


def photos(made: list[Drawing], count: int, seed: int) -> Iterator[Photo]:
    """Photographs of the drawings in turn, in both polarities."""
    rng = np.random.default_rng(seed)
    pairs = [(d, p) for d in made for p in ("dark", "light")]
    order = [pairs[k] for k in rng.permutation(len(pairs))]
    for k in range(count):
        yield photograph(*order[k % len(order)], np.random.default_rng([seed, k]))


# ---------------------------------------------------------------- results


def outcome(photo: Photo, with_task: bool = True) -> tuple[str, str]:
    """The column that a photograph counts in, and the method or the error."""
    drawing = photo.drawing
    ends = (drawing.start, drawing.goal) if with_task else (None, None)
    try:
        grid, params = preprocess(photo.picture, *ends, drawing.radius)
    except TdacError as error:
        return ("close" if "--polarity" in str(error) else "refused"), str(error)
    if params.polarity != photo.polarity:
        return "wrong", params.method
    if with_task and crosses(grid, params, drawing.truth):
        return "crossed", params.method
    return "right", params.method


def crosses(grid: OccupancyGrid, params: MapParams, truth: BoolGrid) -> bool:
    """Whether the shortest path on the grid meets a true wall."""
    columns, rows = planned_path(grid, params).astype(np.intp).T
    return bool(truth[rows, columns].any())


def main() -> int:
    """Prints a line for each photograph that is not right, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--photos", type=int, default=120)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-task", action="store_true")
    args = parser.parse_args()
    made = drawings()
    if args.folder is not None:
        made += real_drawings(args.folder)
    counts: Counter[str] = Counter()
    with ProcessPoolExecutor(max_workers=2) as pool:
        taken = list(photos(made, args.photos, args.seed))
        work = partial(outcome, with_task=not args.no_task)
        for photo, (word, how) in zip(taken, pool.map(work, taken), strict=True):
            counts[word] += 1
            if word != "right":
                what = f"{photo.drawing.name}, {photo.polarity}: {photo.about}"
                print(f"{word}: {what} [{how}]")
    print(f"\n{len(taken)} photographs of {len(made)} drawings")
    for word in ("right", "wrong", "crossed", "close", "refused"):
        print(f"  {word:<9}{counts[word]:>4} {counts[word] / len(taken):>7.1%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
