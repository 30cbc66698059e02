"""Evens the light in photographed plans, so that one threshold separates the walls.

At the edge of a wall, the right threshold is half-way between the two sides. A smooth
surface through these values follows the light (Yanowitz and Bruckstein, 1989), for both
dark and light walls.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.mapping.binarize import otsu
from tdac_envs.mapping.image import ColourImage, GreyImage, luminance

LEVEL = 127.5
"""Luminance threshold of an evened picture."""
_FEW_LEVELS, _DRAWN = 8, 0.7
"""A drawing, unlike a photograph, has 0.7 of its pixels in its 8 commonest levels."""
_SPIKES = 0.62
"""Share of a drawn page's pixels in levels that stand out from their neighbours."""
_CELL = 8
"""Side of the squares in which edges are summed up, px."""
_WINDOW = np.ones((7, 7), np.uint8)
_STRONG, _WEAK = 0.45, 0.25
"""Minimum contrast of edges that set the threshold, and of edges that may separate two
areas, as shares of the strongest."""

Surface = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Evened:
    """A photograph with even light; `LEVEL` separates walls and floor.

    Attributes:
        colour: Shape (height, width, 3), uint8, RGB.
        luminance: Shape (height, width), uint8.
    """

    colour: ColourImage
    luminance: GreyImage


def photographed(grey: GreyImage) -> bool:
    """Whether the picture, or its light part, has many levels, as in a photograph.

    A drawing has most of its pixels in a few levels, even if it is anti-aliased. The
    dark part of a photograph may have few levels, too, since it has little light; they
    are neighbours. The light part of a drawing may have many levels, if it is thin
    lines on a dark page; those of the page are apart.
    """
    counts = np.bincount(grey.ravel(), minlength=256)
    darker, lighter = np.split(counts, [int(otsu(grey)) + 1])
    if _in_few(counts) < _DRAWN:
        return True
    is_page = darker.sum() > lighter.sum()
    if is_page and _spikes(darker) >= _SPIKES:
        return False
    return _in_few(lighter) < _DRAWN


def _in_few(counts: NDArray[np.intp]) -> float:
    """Share of the pixels in the commonest levels."""
    return float(np.sort(counts)[-_FEW_LEVELS:].sum() / max(counts.sum(), 1))


def _spikes(counts: NDArray[np.intp]) -> float:
    """How steep a histogram is: 1 if no two levels in use are neighbours."""
    steps = np.abs(np.diff(np.pad(counts, 1)))
    return float(steps.sum() / 2 / max(counts.sum(), 1))


def evened(colour: ColourImage, grey: GreyImage) -> Evened | None:
    """The picture with evened light and smoothed noise; None if it has no edges."""
    grey = _smoothed(grey)
    edges = _Edges.of(grey)
    if not edges.strength.any():
        return None
    cut = _surface(edges)
    factor = LEVEL / np.maximum(cut, 1.0)
    bright = _smoothed(colour) * factor[..., None]
    even = np.clip(np.rint(bright), 0, 255).astype(np.uint8)
    return Evened(even, _without_ghosts(luminance(even), edges))


def _smoothed(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 1.0), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """The edges of a picture, as arrays of shape (height, width).

    Attributes:
        middle: Half-way between the lightest and the darkest pixel nearby.
        strength: Their difference relative to the light; about 1 at the strongest.
    """

    middle: Surface
    strength: Surface

    @classmethod
    def of(cls, grey: GreyImage) -> _Edges:
        high = cv2.dilate(grey, _WINDOW).astype(np.float32)
        low = cv2.erode(grey, _WINDOW).astype(np.float32)
        middle = (high + low) / 2
        # Square root: with more light, noise grows less than contrast.
        strength = np.asarray((high - low) / np.sqrt(middle + 16.0), np.float32)
        most = max(float(np.percentile(strength[::4, ::4], 98)), 1e-6)
        return cls(np.asarray(middle, np.float32), strength / np.float32(most))


def _surface(edges: _Edges) -> Surface:
    """The threshold of each pixel: a smooth surface through the middles of the edges.

    It is fitted to logarithms, since light is multiplicative: first a paraboloid to the
    whole picture, then the residuals in smaller and smaller neighbourhoods.
    """
    height, width = edges.middle.shape
    size = -(-width // _CELL), -(-height // _CELL)
    weight = np.where(edges.strength > _STRONG, edges.strength**2, 0).astype(np.float32)
    values = weight * np.log(edges.middle + 1.0)
    weight, values = (
        np.asarray(cv2.resize(each, size, interpolation=cv2.INTER_AREA), np.float32)
        for each in (weight, values)
    )
    found = _paraboloid(weight, values)
    for sigma in (max(size) / 6, max(size) / 16):
        left = cv2.GaussianBlur(values - weight * found, (0, 0), sigma)
        near = cv2.GaussianBlur(weight, (0, 0), sigma)
        found = found + left / (near + 0.02 * weight.mean())
    full = cv2.resize(found.astype(np.float32), (width, height))
    return np.asarray(np.exp(full) - 1.0, np.float32)


def _paraboloid(weight: Surface, values: Surface) -> Surface:
    """The weighted least-squares fit of a second-order surface to `values / weight`."""
    rows, columns = weight.shape
    y, x = np.meshgrid(
        np.linspace(-0.5, 0.5, rows), np.linspace(-0.5, 0.5, columns), indexing="ij"
    )
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1).reshape(-1, 6)
    # Regularisation: without edges the surface stays flat.
    flat = 1e-3 * float(weight.sum()) * np.diag([1e-6, 1e-2, 1e-2, 1, 1, 1])
    normal = terms.T @ (terms * weight.reshape(-1, 1)) + flat
    found = np.linalg.solve(normal, terms.T @ values.ravel())
    return np.asarray((terms @ found).reshape(rows, columns), np.float32)


def _without_ghosts(even: GreyImage, edges: _Edges) -> GreyImage:
    """The picture without areas whose boundary is not an edge.

    Far from edges the surface may be wrong. Therefore an area without edges inside gets
    the class of its rim, where the surface is accurate.
    """
    edge = edges.strength > _WEAK
    count, labels = cv2.connectedComponents((~edge).astype(np.uint8), connectivity=4)
    light = even > LEVEL
    rim = cv2.dilate(edge.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    every = np.bincount(labels[rim], minlength=count)
    share = np.bincount(labels[rim], light[rim], count) / np.maximum(every, 1)
    share[0] = 0.5
    clear = (every > 0) & (np.abs(share - 0.5) > 0.4)
    wrong = clear[labels] & (light != (share[labels] > 0.5))
    if not wrong.any():
        return even
    levels = [np.median(even[side]) for side in (~light, light)]
    right = np.where(share[labels] > 0.5, levels[1], levels[0])
    return np.asarray(np.where(wrong, right, even), np.uint8)
