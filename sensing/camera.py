"""A camera over the floor: anytime vision by fusing noisy exposures, with OpenCV.

The floor is bright, obstacles are dark, the light is poor: one exposure shows next to nothing, and
every further one, added to those before, lets the noise sink. All that decides whether a cell is
called blocked is integer arithmetic, so that two runs agree in every byte.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from sensing.maps import BoolGrid, Cell
from sensing.sensed_maps import SensedMap, disc

cv2.setNumThreads(1)  # a robot's other modules need the cores, and a mission must repeat

_TILE = 512  # pixels a side of the tiles of noise and texture
_SHADES = 255
_OUTLIER = 3  # a pixel that differs from its neighbourhood by more standard deviations is defect
_ROOM = 1.8  # deviations of noise from either shade to black or white, at least
MOST_EXPOSURES = 256  # 256 x 255 fits the uint16 accumulators


@dataclass(frozen=True)
class Camera:
    """A downward view of the floor around the robot, `pixels` x `pixels` pixels a cell.

    `floor` and `obstacle` are the mean shades (0 to 255) of what the camera was calibrated on, and
    `texture` the standard deviation of the floor's pattern, which no exposure averages out; `noise`
    is the standard deviation of one pixel in one exposure; the share `defects` of the sensor's
    pixels is stuck at white. Fewer than `first` exposures show nothing, and a look takes at most
    `last`. A cell less sure than `doubt` is called unknown.
    """

    pixels: int = 3
    floor: int = 132
    obstacle: int = 108
    texture: int = 6
    noise: float = 45.0
    defects: float = 0.004
    first: int = 3
    last: int = 32
    doubt: float = 0.6

    def __post_init__(self) -> None:
        if self.pixels not in (3, 4):
            raise AnytimeError(f"pixels is {self.pixels}: it must be 3 or 4 a cell")
        if not 0 <= self.obstacle < self.floor <= _SHADES:
            raise AnytimeError(
                f"obstacle {self.obstacle}, floor {self.floor}: it must be 0 <= obstacle < floor"
                f" <= {_SHADES}"
            )
        if not 1 <= self.first <= self.last <= MOST_EXPOSURES:
            raise AnytimeError(
                f"first {self.first}, last {self.last}: it must be 1 <= first <= last"
                f" <= {MOST_EXPOSURES}"
            )
        if not (0 <= self.noise <= _SHADES and 0 <= self.texture <= _SHADES):
            raise AnytimeError("noise and texture must be standard deviations from 0 to 255")
        most = min(self.obstacle, _SHADES - self.floor) / _ROOM
        if self.noise > most:
            raise AnytimeError(
                f"noise is {self.noise:g}: exposures would be cut off at black or white, and what"
                f" is seen believed too much; for obstacle {self.obstacle} and floor"
                f" {self.floor} it must be at most {most:.4g}"
            )
        if not (0.0 <= self.defects <= 0.2 and 0.5 <= self.doubt < 1.0):
            raise AnytimeError("defects must be 0 to 0.2, and doubt a probability of 0.5 to 1")

    def look(
        self, free: BoolGrid, center: Cell, radius: int, rng: np.random.Generator
    ) -> Iterator[SensedMap | None]:
        """Look at the floor, one exposure after the other; each yields all that is seen by then."""
        near = disc(center, radius, (free.shape[0], free.shape[1]))
        window = (near.row, near.column)
        scene = self.picture(free[near.window], window)
        noise = _noise(self.noise, 1 + -(-max(scene.shape) // _TILE))
        stuck = _stuck(scene.shape, self.defects, rng)
        sums = np.zeros((2, *scene.shape), np.uint16)  # of the odd and of the even exposures
        offsets = rng.integers(0, _TILE, (self.last, 2)).tolist()
        exposed = np.empty_like(scene)
        for exposure, (down, right) in enumerate(offsets, 1):
            height, width = scene.shape
            np.add(scene, noise[down : down + height, right : right + width], out=exposed)
            np.clip(exposed, 0, _SHADES, out=exposed)
            exposed[stuck] = _SHADES
            half = sums[exposure % 2]
            np.add(half, exposed, out=half, casting="unsafe")
            if exposure < self.first:
                yield None
                continue
            blocked, confidence = self._classify(sums, exposure)
            quality = float(confidence[near.inside].mean())
            yield SensedMap(window, blocked & near.inside, near.inside, quality, confidence)

    def picture(self, free: BoolGrid, window: Cell = (0, 0)) -> NDArray[np.int16]:
        """The noiseless image of a window of the floor, int16 [h * pixels, w * pixels].

        `window` is where it lies on the map: the floor's pattern stays where it is.
        """
        side = self.pixels
        shades = np.where(free, self.floor, self.obstacle).astype(np.int16)
        height, width = free.shape
        image = cv2.resize(shades, (width * side, height * side), interpolation=cv2.INTER_NEAREST)
        rows = (np.arange(height * side) + window[0] * side) % _TILE
        columns = (np.arange(width * side) + window[1] * side) % _TILE
        image = image + _texture(self.texture)[np.ix_(rows, columns)]
        return _blurred(image.astype(np.int16))

    def _classify(
        self, sums: NDArray[np.uint16], exposures: int
    ) -> tuple[BoolGrid, NDArray[np.float32]]:
        """Which cells are dark, and how sure that is; both [h, w]."""
        side = self.pixels
        count = exposures * side * side  # shades that are summed for a cell
        spread = self._spread(sums, exposures)
        fused = sums[0] + sums[1]
        calm = cv2.medianBlur(fused, 3)
        limit = int(_OUTLIER * spread * side * exposures) + 1
        defect = cv2.absdiff(fused, calm) > limit
        np.copyto(fused, calm, where=defect)
        light = _cell_sums(fused, side)
        bright, dark, pattern = _levels(self)
        middle = round((bright + dark) / 2 * count)
        blocked = light < middle
        variance = spread**2 + pattern
        sureness = np.abs(light - middle).astype(np.float32)
        sureness *= np.float32((bright - dark) / (variance * count))
        confidence = np.float32(1) / (np.float32(1) + np.exp(-sureness))
        np.clip(confidence, 0.5, 0.999, out=confidence)
        confidence[confidence < self.doubt] = 0.5
        return blocked, confidence

    def _spread(self, sums: NDArray[np.uint16], exposures: int) -> float:
        """The standard deviation of a cell's mean shade that noise causes, as the images show it.

        What does not change from exposure to exposure cancels in the difference of the two halves.
        """
        even, odd = exposures // 2, exposures - exposures // 2
        side = self.pixels
        if even == 0:
            return self.noise / (side * math.sqrt(exposures))
        halves = _cell_sums(sums[0], side).astype(np.int64), _cell_sums(sums[1], side)
        difference = halves[0] * odd - halves[1] * even
        mean_square = int((difference * difference).sum()) / difference.size
        # Var(odd * sum_even - even * sum_odd) = even * odd * exposures * the variance of one sum
        one = mean_square / (even * odd * exposures) / side**4
        return math.sqrt(one / exposures)


@lru_cache(maxsize=64)
def _levels(camera: Camera) -> tuple[float, float, float]:
    """Mean shades of free and of blocked cells behind the lens, and the variance within each.

    The camera is calibrated on a cluttered floor, a fifth of it blocked.
    """
    free = np.random.default_rng(20).random((96, 96)) >= 0.2
    light = _cell_sums(camera.picture(free), camera.pixels) / camera.pixels**2
    bright, dark = float(light[free].mean()), float(light[~free].mean())
    within = float(((light - np.where(free, bright, dark)) ** 2).mean())
    return bright, dark, within


def _cell_sums(image: NDArray[np.uint16] | NDArray[np.int16], side: int) -> NDArray[np.int32]:
    """The sum of the pixels of each cell, int32 [h, w]."""
    columns = image[:, 0::side].astype(np.int32)
    for at in range(1, side):
        columns += image[:, at::side]
    total = columns[0::side].copy()
    for at in range(1, side):
        total += columns[at::side]
    return total


def _blurred(image: NDArray[np.int16]) -> NDArray[np.int16]:
    """The lens: a binomial blur of one sixth, in integers."""
    padded = np.pad(image.astype(np.int32), 1, mode="edge")
    rows = padded[:-2] + 6 * padded[1:-1] + padded[2:]
    both = rows[:, :-2] + 6 * rows[:, 1:-1] + rows[:, 2:]
    return ((both + 32) >> 6).astype(np.int16)


@lru_cache(maxsize=4)
def _noise(deviation: float, times: int) -> NDArray[np.int16]:
    """A tile of sensor noise, so many times each way: a view may begin anywhere in the first."""
    tile = np.rint(np.random.default_rng(7).standard_normal((_TILE, _TILE)) * deviation)
    noise = np.tile(tile.astype(np.int16), (times, times))
    noise.flags.writeable = False
    return noise


@lru_cache(maxsize=4)
def _texture(deviation: int) -> NDArray[np.int16]:
    """A tile of the floor's pattern."""
    rng = np.random.default_rng(11)
    tile = np.rint(rng.standard_normal((_TILE, _TILE)) * deviation).astype(np.int16)
    tile.flags.writeable = False
    return tile


def _stuck(shape: tuple[int, ...], share: float, rng: np.random.Generator) -> tuple:
    """The pixels of the sensor that are stuck at white, as an index into an image."""
    height, width = shape
    count = round(share * height * width)
    return rng.integers(0, height, count), rng.integers(0, width, count)
