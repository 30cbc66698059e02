"""Preprocessing: the right grid from drawn maps, and a clear refusal otherwise."""

from __future__ import annotations

import heapq
import itertools
import json
import math
from pathlib import Path

import cv2
import numpy as np
import plain_preprocess
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_envs.core.errors import MapError, TaskError
from tdac_envs.grid.grid import body_free, clearance
from tdac_envs.grid.pieces import nearest_free
from tdac_envs.mapping.cleanup import cleanings
from tdac_envs.mapping.image import MapImage, luminance
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.map_folder import FILES, planned_path, write_map
from tdac_envs.mapping.params import MapParams
from tdac_envs.mapping.preprocessing import preprocess, rank_candidates
from tdac_envs.mapping.score import score, widest_radius

START, GOAL = (40, 40), (260, 40)
REAL_MAPS = Path(__file__).parents[4] / "shared" / "data" / "maps"


def rooms(wall: int = 6, gap: int = 60, closed: bool = False) -> np.ndarray:
    """Two rooms with a door below; shape (200, 300, 3), black on white."""
    image = np.full((200, 300, 3), 255, np.uint8)
    cv2.rectangle(image, (8, 8), (291, 191), (0, 0, 0), wall)
    end = 191 if closed else 191 - gap
    cv2.line(image, (150, 8), (150, end), (0, 0, 0), wall)
    return image


def agrees(cells: np.ndarray, image: np.ndarray) -> bool:
    """Whether the free space at the start is that of the drawing, to 2 %."""
    truth = luminance(image) < 128
    pieces = [
        labels == labels[START[::-1]]
        for labels in (
            cv2.connectedComponents((~grid).astype(np.uint8), connectivity=4)[1]
            for grid in (cells, truth)
        )
    ]
    return bool((pieces[0] ^ pieces[1]).sum() <= 0.02 * pieces[1].sum())


@pytest.mark.parametrize("negative", [False, True])
@pytest.mark.parametrize("wall", [1, 2, 6, 14])
def test_polarity_and_walls(wall: int, negative: bool) -> None:
    """Thin or thick, dark or light: the walls are the obstacles."""
    image = rooms(wall)
    grid, params = preprocess(255 - image if negative else image, START, GOAL, 12.0)
    assert params.polarity == ("light" if negative else "dark")
    assert agrees(grid.cells, image)


@pytest.mark.parametrize("negative", [False, True])
def test_polarity_without_a_task(negative: bool) -> None:
    image = rooms()
    grid, params = preprocess(255 - image if negative else image)
    assert params.polarity == ("light" if negative else "dark")
    assert params.start is params.goal is params.score is None
    assert agrees(grid.cells, image)


@pytest.mark.parametrize("negative", [False, True])
@pytest.mark.parametrize("size", [4, 18])
def test_marked_start_and_goal(size: int, negative: bool) -> None:
    """A red and a blue dot are marks, not obstacles."""
    marked = rooms()
    cv2.circle(marked, START, size, (220, 20, 20), -1, cv2.LINE_AA)
    cv2.circle(marked, GOAL, size, (20, 20, 220), -1, cv2.LINE_AA)
    marked = 255 - marked if negative else marked
    grid, params = preprocess(marked, START, GOAL, 12.0)
    assert "marks ignored" in params.method
    assert agrees(grid.cells, rooms())


def test_coloured_walls_stay() -> None:
    """Where the walls themselves are coloured, light green is a wall, too."""
    image = rooms(closed=True)
    image[(image == 0).all(axis=2)] = (200, 0, 0)
    image[100:189, 147:154] = (0, 255, 0)
    with pytest.raises(TaskError, match="not connected"):
        preprocess(image, START, GOAL, 12.0)


def test_text_across_the_door() -> None:
    image = rooms()
    cv2.putText(image, "room 12", (118, 165), 0, 0.45, (0, 0, 0), 1, cv2.LINE_AA)
    grid, params = preprocess(image, START, GOAL, 12.0)
    assert "specks" in params.method
    assert not grid.cells[140:180, 165:200].any()


def test_speckle() -> None:
    """Salt and pepper on one pixel in a hundred."""
    image, rng = rooms(), np.random.default_rng(0)
    noise = rng.random(image.shape[:2])
    image[noise < 0.005], image[noise > 0.995] = 0, 255
    grid, _ = preprocess(image, START, GOAL, 12.0)
    assert agrees(grid.cells, rooms())


def test_door_arc() -> None:
    """A thin door arc is no wall where the walls are thick."""
    image = rooms(wall=8)
    cv2.ellipse(image, (150, 187), (58, 58), 0, -90, 0, (0, 0, 0), 1, cv2.LINE_AA)
    cv2.line(image, (150, 129), (150, 187), (0, 0, 0), 1)
    grid, params = preprocess(image, START, GOAL, 12.0)
    assert params.opening == 3
    assert agrees(grid.cells, rooms(wall=8))


def test_window_does_not_lead_outside() -> None:
    """A robot does not leave a building through a window drawn in grey."""
    image = np.full((300, 400, 3), 255, np.uint8)
    image[50:250, 50:350] = rooms(closed=True)
    for x in (100, 300):
        image[52:64, x - 25 : x + 25] = 255
        image[56:58, x - 25 : x + 25] = 150
    with pytest.raises(TaskError, match="not connected"):
        preprocess(image, (90, 90), (310, 90), 12.0)


def test_uneven_light() -> None:
    """A photograph, darker on the left than the ink is on the right."""
    light = np.linspace(0.3, 1.0, 300)[None, :, None]
    rng = np.random.default_rng(1)
    paper = np.where(rooms() == 0, 90, 240) * light
    photo = np.clip(paper + rng.normal(0, 2, paper.shape), 0, 255).astype(np.uint8)
    grid, _ = preprocess(photo, START, GOAL, 12.0)
    assert agrees(grid.cells, rooms())


@pytest.mark.parametrize("negative", [False, True])
def test_middle_tone_floor(negative: bool) -> None:
    """Floor grey, walls white, outside black: no threshold tells the floor."""
    image = rooms()
    walls = (image == 0).all(axis=2)
    image[...], image[walls] = 110, 255
    image[:5], image[185:], image[:, :5], image[:, 285:] = 20, 20, 20, 20
    image = 255 - image if negative else image
    grid, params = preprocess(image, START, GOAL, 12.0)
    assert params.polarity == "mixed"
    drawn = rooms()
    drawn[185:], drawn[:, 285:] = 0, 0
    assert agrees(grid.cells, drawn)


@pytest.mark.parametrize("negative", [False, True])
def test_unknown_grey_is_not_free(negative: bool) -> None:
    """ROS map_saver: 254 free, 205 unknown, 0 occupied."""
    shades = np.full((200, 300), 205, np.uint8)
    shades[10:190, 10:290] = 254
    shades[10:130, 145:155] = 205
    shades[9:11, 10:290] = 0
    grid, params = preprocess(255 - shades if negative else shades, START, GOAL, 12.0)
    assert "unknown grey" in params.method
    np.testing.assert_array_equal(grid.cells, shades < 254)


@pytest.mark.parametrize("negative", [False, True])
@pytest.mark.parametrize("wall", [1, 3, 6, 12])
def test_closed_map_is_refused(wall: int, negative: bool) -> None:
    """No reading opens a wall, however thin."""
    image = rooms(wall, closed=True)
    with pytest.raises(TaskError, match="no robot gets through: a wall blocks the way"):
        preprocess(255 - image if negative else image, START, GOAL, 12.0)


def test_a_body_smaller_than_a_pixel_is_asked_for_its_units() -> None:
    """Metres without a resolution, and a resolution that is 100 times too large."""
    in_wall = (150.0, 20.0)
    with pytest.raises(TaskError, match=r"0\.2 px; if it is in metres, give"):
        preprocess(rooms(), in_wall, GOAL, 0.2, polarity="dark")
    image = MapImage(rooms(), "plan", "", resolution=5.0)
    with pytest.raises(TaskError, match=r"is a resolution of 5 m per px right\?"):
        preprocess(image, in_wall, GOAL, 0.04, polarity="dark")


def test_a_refusal_says_that_light_pixels_are_obstacles() -> None:
    """Start and goal lie in two black walls, so the white floor is taken for them."""
    image = rooms(12)
    cv2.rectangle(image, (60, 100), (80, 120), (0, 0, 0), -1)
    with pytest.raises(TaskError, match="light pixels were taken for the obstacles"):
        preprocess(image, (8.0, 100.0), (70.0, 110.0), 4.0)


def test_closed_by_a_thinner_wall_is_refused() -> None:
    """A partition of half the walls' thickness is a wall."""
    image = rooms(wall=10)
    cv2.line(image, (150, 100), (150, 191), (0, 0, 0), 5)
    with pytest.raises(TaskError, match="not connected"):
        preprocess(image, START, GOAL, 12.0)


def test_no_border_wrap_around() -> None:
    """Free space at the left edge is no neighbour of that at the right."""
    cells = np.zeros((60, 90), np.bool_)
    cells[:, 40:50] = True
    with pytest.raises(TaskError, match="not connected"):
        preprocess(cells, (10, 30), (80, 30), 3.0)


def test_no_corner_cutting() -> None:
    cells = np.zeros((40, 40), np.bool_)
    cells[:20, 20:] = cells[20:, :20] = True
    with pytest.raises(TaskError, match="no robot gets through"):
        preprocess(cells, (5, 5), (35, 35), 1.0)


@pytest.mark.parametrize(
    ("start", "goal", "radius", "message"),
    [
        ((150, 50), GOAL, 12, r"move the start to \(\d+, \d+\), the nearest"),
        (START, (275, 40), 15, r"goal \(275, 40\) is \d+\.\d px from an obstacle"),
        (START, GOAL, 40, r", the nearest free pixel for a robot of 40 px radius: "),
        ((60, 60), (240, 60), 40, r"the largest radius that gets through is 2\d\.\d"),
        (START, GOAL, 200, "a robot of 200 px radius fits nowhere on this map"),
        ((-1, 40), GOAL, 12, r"start \(-1, 40\) lies outside the map; expected 0 <= x"),
        (START, (300, 40), 12, r"goal \(300, 40\) lies outside the map"),
        (START, START, 12, r"start and goal are the same pixel \(40, 40\)"),
        (START, GOAL, 0, "expected a robot radius above 0 px, got 0"),
    ],
)
def test_infeasible(start: tuple, goal: tuple, radius: float, message: str) -> None:
    """Each refusal says which check failed, where, and what would do."""
    with pytest.raises(TaskError, match=message):
        preprocess(rooms(), start, goal, radius)


def test_the_advised_pixel_and_radius_hold() -> None:
    image = rooms()
    clear = clearance(luminance(image) < 128)
    moved = nearest_free(body_free(clear, 12), 150, 50)
    assert moved is not None
    preprocess(image, moved, GOAL, 12.0)
    widest = widest_radius(clear, START, GOAL)
    preprocess(image, (70, 70), (230, 70), widest)
    with pytest.raises(TaskError, match="not connected"):
        preprocess(image, (70, 70), (230, 70), widest + 0.6)


def test_the_advised_pixel_is_joined_with_the_other_end() -> None:
    """A nearer one, from which no way leads there, would be of no use."""
    cells = np.zeros((80, 160), np.bool_)
    cells[:, 30:34] = True
    with pytest.raises(TaskError, match=r"move the start to \(3[6-9], 40\), "):
        preprocess(cells, (30, 40), (140, 40), 3.0)


def test_snap_moves_the_ends_and_says_so() -> None:
    grid, params = preprocess(rooms(), (150, 50), GOAL, 12.0, snap=True)
    assert params.start != (150, 50)
    assert params.notes == (
        f"start moved from (150, 50) to {_ints(params.start)}, the nearest free pixel "
        "from which the goal can be reached; (150, 50) lies in an obstacle",
    )
    x, y = _ints(params.start)
    assert body_free(clearance(grid.cells), 12.0)[y, x]


def _ints(point: tuple[float, float] | None) -> tuple[int, int]:
    assert point is not None
    return int(point[0]), int(point[1])


def test_candidates_are_ranked_by_score() -> None:
    ranked = rank_candidates(rooms(), START, GOAL, 12.0)
    scores = [c.score for c in ranked if c.failure is None]
    assert len(scores) == 4
    assert scores == sorted(scores, reverse=True)
    _, params = preprocess(rooms(), START, GOAL, 12.0)
    assert params.score == pytest.approx(scores[0])
    assert params.score_terms is not None
    assert score(params.score_terms) == pytest.approx(scores[0])


def test_margin_does_not_send_the_robot_another_way() -> None:
    """A door just wide enough beats a wide one far away."""
    image = rooms()
    image[26:54, 146:155] = 255
    ranked = rank_candidates(image, START, GOAL, 12.0)
    assert ranked[0].terms is not None
    assert ranked[0].terms.path_length < 240
    assert any("px makes the path" in (c.failure or "") for c in ranked)


def test_world_is_not_inflated() -> None:
    grid, params = preprocess(rooms(), START, GOAL, 12.0)
    assert params.inflation > 0
    walls = luminance(rooms()) < 128
    np.testing.assert_array_equal(grid.cells[9:-9, 9:-9], walls[9:-9, 9:-9])


def test_bool_array_is_taken_as_given() -> None:
    cells = luminance(rooms()) < 128
    grid, params = preprocess(cells, START, GOAL, 12.0)
    assert (params.polarity, params.method) == ("given", "given")
    np.testing.assert_array_equal(grid.cells, cells)


class Oracle:
    """Algorithm 1 in plain Python: every step by its definition, none fast."""

    def __init__(self, grey: np.ndarray, start: tuple, goal: tuple, radius: float):
        self.grey, self.start, self.goal, self.radius = grey, start, goal, radius
        self.height, self.width = grey.shape

    def neighbours(self, y: int, x: int, diagonal: bool) -> list[tuple[int, int]]:
        steps = itertools.product((-1, 0, 1), repeat=2)
        return [
            (y + dy, x + dx)
            for dy, dx in steps
            if (dy or dx)
            and (diagonal or not (dy and dx))
            and 0 <= y + dy < self.height
            and 0 <= x + dx < self.width
        ]

    def otsu(self) -> int:
        """The threshold of largest between-class variance."""
        best, best_t = -1.0, 0
        for t in range(255):
            low, high = self.grey[self.grey <= t], self.grey[self.grey > t]
            if low.size and high.size:
                gap = float(low.mean()) - float(high.mean())
                value = low.size * high.size * gap * gap
                if value > best * (1 + 1e-9):
                    best, best_t = value, t
        return best_t

    def pieces(self, mask: set, diagonal: bool) -> list[set]:
        left, found = set(mask), []
        while left:
            piece, todo = set(), [left.pop()]
            while todo:
                cell = todo.pop()
                piece.add(cell)
                for other in self.neighbours(*cell, diagonal):
                    if other in left:
                        left.remove(other)
                        todo.append(other)
            found.append(piece)
        return found

    def cleaned(self, occupied: set, strength: int) -> set:
        if strength == 0:
            return set(occupied)
        every = set(itertools.product(range(self.height), range(self.width)))
        kept = set()
        for piece in self.pieces(occupied, diagonal=True):
            kept |= piece if len(piece) >= strength else set()
        for hole in self.pieces(every - kept, diagonal=False):
            kept |= hole if len(hole) < strength else set()
        grown = kept | {n for cell in kept for n in self.neighbours(*cell, True)}
        return {c for c in grown if all(n in grown for n in self.neighbours(*c, True))}

    def clearances(self, occupied: set) -> dict:
        """Distance of every pixel centre to the nearest occupied square or border."""
        rows, columns = np.array(sorted(occupied)).reshape(-1, 2).T
        found = {}
        for y, x in itertools.product(range(self.height), range(self.width)):
            edge = min(x, y, self.width - 1 - x, self.height - 1 - y) + 0.5
            dx = np.maximum(np.abs(columns - x) - 0.5, 0.0)
            dy = np.maximum(np.abs(rows - y) - 0.5, 0.0)
            gap = float(np.hypot(dx, dy).min(initial=edge))
            found[y, x] = 0.0 if (y, x) in occupied else gap
        return found

    def value(self, cells: set, clear: dict, inflation: int) -> float | None:
        need = math.sqrt((self.radius + inflation) ** 2 + 0.5)
        free = {cell for cell, gap in clear.items() if gap >= need - 1e-6}
        start, goal = self.start[::-1], self.goal[::-1]
        if start not in free or goal not in free:
            return None
        length = self.shortest(free, start, goal)
        if length is None:
            return None
        flips = sum(
            ((y, x) in cells) != (other in cells)
            for y, x in clear
            for other in ((y + 1, x), (y, x + 1))
            if other in clear
        )
        # The clearance along the path needs the path; the caller compares without it.
        return -0.02 * length - 1.2 * flips / self.grey.size

    def shortest(self, free: set, start: tuple, goal: tuple) -> float | None:
        settled, queue = set(), [(0.0, start)]
        while queue:
            length, cell = heapq.heappop(queue)
            if cell == goal:
                return length
            if cell in settled:
                continue
            settled.add(cell)
            y, x = cell
            for a, b in self.neighbours(y, x, diagonal=True):
                beside = (y, b) in free and (a, x) in free
                if (a, b) in free and beside:
                    step = math.hypot(a - y, b - x)
                    heapq.heappush(queue, (length + step, (a, b)))
        return None


def small_map() -> np.ndarray:
    """A wall with a gap, a speck and a hole; shape (26, 34), uint8."""
    grey = np.full((26, 34), 230, np.uint8)
    grey[:2], grey[-2:], grey[:, :2], grey[:, -2:] = 20, 20, 20, 20
    grey[2:15, 16:19] = 25
    grey[20, 8], grey[6, 17] = 30, 225
    return grey


@pytest.mark.slow
def test_paper_preset_is_the_literal_grid() -> None:
    """2 polarities x 5 cleanups x 4 inflations, against a slow plain oracle."""
    grey, start, goal = small_map(), (7, 7), (26, 7)
    oracle = Oracle(grey, start, goal, 1.5)
    ranked = rank_candidates(grey, start, goal, 1.5, preset="paper")
    dark = grey <= oracle.otsu()
    grids, tried = {}, set()
    for polarity, strength in itertools.product(("dark", "light"), (0, 4, 8, 12, 16)):
        mask = dark if polarity == "dark" else ~dark
        cells = oracle.cleaned(set(zip(*np.nonzero(mask), strict=True)), strength)
        grids[polarity, strength] = cells, oracle.clearances(cells)
    for candidate in ranked:
        reading = candidate.reading
        cells, clear = grids[reading.polarity, reading.cleanup]
        assert set(zip(*np.nonzero(reading.cells), strict=True)) == cells
        value = oracle.value(cells, clear, candidate.inflation)
        assert (value is None) == (candidate.failure is not None)
        if value is not None and candidate.terms is not None:
            rest = candidate.score - 2.5 * candidate.terms.min_clearance
            assert rest == pytest.approx(value)
        tried.add((reading.polarity, reading.cleanup, candidate.inflation))
    dark_ones = {("dark", c, i) for c in (0, 4, 8, 12, 16) for i in (0, 1, 2, 3)}
    assert dark_ones <= tried
    assert {("light", c, 0) for c in (0, 4, 8, 12, 16)} <= tried
    best = [c.score for c in ranked if c.failure is None]
    assert best == sorted(best, reverse=True)


def noisy(seed: int, size: int) -> np.ndarray:
    """Walls at random with gaps, specks and holes of many sizes, in colour."""
    rng = np.random.default_rng(seed)
    grey = np.full((size, size + 30), 235, np.uint8)
    for _ in range(size // 18):
        x, y = rng.integers(0, size, 2)
        ends = rng.integers(0, size, 2)
        cv2.line(grey, (int(x), int(y)), tuple(map(int, ends)), 30, 3)
    for _ in range(size * size // 150):
        x, y = rng.integers(1, size - 6, 2)
        width, height = rng.integers(1, 6, 2)
        grey[y : y + height, x : x + width] = 255 - grey[y, x]
    return np.repeat(grey[..., None], 3, axis=2)


@pytest.mark.slow_after(6)
@pytest.mark.parametrize("radius", [0.5, 1.0, 2.5])
@pytest.mark.parametrize("seed", range(6))
def test_sharing_work_changes_nothing(seed: int, radius: float) -> None:
    """All candidates, their order, terms and failures are the plain version's."""
    picture, start, goal = noisy(seed, 150), (8, 8), (165, 140)
    for x, y in (start, goal):
        cv2.circle(picture, (x, y), 6, (235, 235, 235), -1)
    ours = rank_candidates(picture, start, goal, radius, preset="paper")
    plain = plain_preprocess.candidates(picture, start, goal, radius)
    assert len(ours) == len(plain)
    for one, (polarity, cleanup, inflation, cells, why, terms) in zip(
        ours, plain, strict=True
    ):
        who = (one.reading.polarity, one.reading.cleanup, one.inflation)
        assert who == (polarity, cleanup, inflation)
        np.testing.assert_array_equal(one.reading.cells, cells)
        assert (one.failure, one.terms) == (why, terms)


@given(st.integers(0, 10_000), st.sampled_from([0.1, 0.3, 0.5, 0.7]))
@settings(derandomize=True, deadline=None, max_examples=40)
def test_cleanings_are_those_of_the_plain_version(seed: int, density: float) -> None:
    """Pieces that go leave larger holes; each strength is as if it were alone."""
    cells = np.random.default_rng(seed).random((24, 31)) < density
    strengths = (0, 2, 4, 8, 16, 60)
    for strength, got in zip(strengths, cleanings(cells, strengths), strict=True):
        np.testing.assert_array_equal(got, plain_preprocess.clean(cells, strength))


@pytest.mark.parametrize("strength", [0, 4, 8])
def test_cleanup_is_its_definition(strength: int) -> None:
    cells = np.random.default_rng(strength).random((18, 22)) < 0.3
    oracle = Oracle(np.zeros((18, 22), np.uint8), (0, 0), (1, 1), 1.0)
    wanted = oracle.cleaned(set(zip(*np.nonzero(cells), strict=True)), strength)
    got = set(zip(*np.nonzero(cleanings(cells, [strength])[0]), strict=True))
    assert got == wanted


@pytest.mark.parametrize(
    ("preset", "words"),
    [("paper", "pieces and holes under 16 px removed"), ("default", "specks up to 4")],
)
def test_a_note_says_what_was_changed(preset: str, words: str) -> None:
    """The paper's grid fills and closes as well; it does not only remove."""
    grid, params = preprocess(noisy(0, 120), (10, 10), (100, 100), 1.0, preset=preset)
    (note,) = params.notes
    assert words in note
    added = grid.cells & (noisy(0, 120)[..., 0] > 128)
    assert added.any() == (preset == "paper")


@pytest.mark.parametrize("with_task", [True, False])
def test_write_map_round_trip(with_task: bool, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "map.png"), rooms())
    ends = (START, GOAL) if with_task else (None, None)
    grid, params = preprocess(tmp_path / "map.png", *ends, 12.0)
    files = write_map(tmp_path / "out", grid, params, tmp_path / "map.png")
    assert [file.name for file in files] == list(FILES)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(FILES)
    cells = np.load(files[0])
    assert cells.dtype == np.bool_
    np.testing.assert_array_equal(cells, grid.cells)
    picture = cv2.imread(str(files[1]), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(picture, np.where(grid.cells, 0, 255))
    assert MapParams.load(files[2]) == params
    assert params.source_sha256 == load_image(tmp_path / "map.png").sha256
    preview = cv2.imread(str(files[3]))
    assert preview.shape[0] > 200
    assert (len(planned_path(grid, params)) > 0) == with_task


def test_unwritable_folder(tmp_path: Path) -> None:
    """A file in the way leaves nothing behind."""
    (tmp_path / "taken").write_text("")
    grid, params = preprocess(rooms(), START, GOAL, 12.0)
    with pytest.raises(MapError, match="taken: cannot be written"):
        write_map(tmp_path / "taken", grid, params, rooms())


def test_failed_write_keeps_the_old_files(tmp_path: Path) -> None:
    grid, params = preprocess(rooms(), START, GOAL, 12.0)
    write_map(tmp_path, grid, params, rooms())
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    with pytest.raises(MapError):
        write_map(tmp_path, grid, params, tmp_path / "gone.png")
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def _real_tasks() -> list:
    index = REAL_MAPS / "index.json"
    return json.loads(index.read_text()) if index.is_file() else []


SAMPLE = [t for t in _real_tasks() if t["width"] * t["height"] <= 500_000][::4]


@pytest.mark.skipif(not SAMPLE, reason="the real maps are not on this machine")
@pytest.mark.parametrize("task", SAMPLE, ids=[t["name"] for t in SAMPLE])
def test_real_maps(task: dict) -> None:
    """Every fourth real map: polarity and feasibility as the index has them."""
    if task["polarity"] == "mixed" or task["max_robot_radius_px"] < 3:
        pytest.skip("mixed polarity, or no room for a robot")
    file = task["png"] if task["kind"] == "movingai" else task["file"]
    radius = min(12, task["max_robot_radius_px"] - 1)
    start, goal = tuple(task["start"]), tuple(task["goal"])
    _, params = preprocess(REAL_MAPS / file, start, goal, radius)
    assert f"{params.polarity}_obstacle" == task["polarity"]
