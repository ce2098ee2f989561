"""Optimisers made for moving peaks: multi-swarms and dynamic differential evolution.

The peers that the benchmark is published with, and that DEAP gives as its examples. Each searches
with many small populations, one a peak, keeps them apart, and re-evaluates the best of each to see
whether the landscape has changed. Written anew, all populations at once in arrays.
"""

from __future__ import annotations

import numpy as np

from experiments.benchmarks.rivals.moving_peaks import DIMENSIONS, HIGH, LOW, Course, Floats

_STATE = ("points", "speeds", "own", "own_heights", "best", "heights")
_CONSTRICTION, _ATTRACTION = 0.729843788, 2.05


def _heights(course: Course, points: Floats) -> Floats:
    """The heights [...] at points [..., 5]."""
    return course.evaluate(points.reshape(-1, DIMENSIONS)).reshape(points.shape[:-1])


def _anywhere(rng: np.random.Generator, *shape: int) -> Floats:
    return rng.uniform(LOW, HIGH, (*shape, DIMENSIONS))


def _cloud(rng: np.random.Generator, centres: Floats, count: int, radius: float) -> Floats:
    """Points [m, count, 5] uniform in the balls of this radius about centres [m, 5]."""
    ways = rng.normal(size=(len(centres), count, DIMENSIONS))
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    far = radius * rng.random((len(centres), count, 1)) ** (1.0 / DIMENSIONS)
    return centres[:, None, :] + far * ways


def exclusion_radius(populations: int) -> float:
    """Populations closer than this search one peak: half a peak's basin if all are as large."""
    return 0.5 * (HIGH - LOW) / populations ** (1.0 / DIMENSIONS)


def _excluded(centres: Floats, heights: Floats, radius: float) -> list[int]:
    """The worse of every two populations whose best are within the radius."""
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    out: set[int] = set()
    for one, other in np.argwhere(np.triu(apart < radius, 1)).tolist():
        if one not in out and other not in out:
            out.add(one if heights[one] <= heights[other] else other)
    return sorted(out)


def _flown(
    rng: np.random.Generator, points: Floats, speeds: Floats, own: Floats, shared: Floats
) -> Floats:
    """Speeds of particles [m, n, 5] drawn to their own best [m, n, 5] and the swarm's [m, 1, 5]."""
    one, other = rng.uniform(0.0, _ATTRACTION, (2, *points.shape))
    return _CONSTRICTION * (speeds + one * (own - points) + other * (shared - points))


class _Swarms:
    """Particles [m, n, 5], their own best and their swarm's best, with the heights of these."""

    def __init__(self, course: Course, rng: np.random.Generator, swarms: int, n: int) -> None:
        self.course, self.rng = course, rng
        self.points = _anywhere(rng, swarms, n)
        self.own = self.points.copy()
        self.speeds = np.zeros_like(self.points)
        self.own_heights = _heights(course, self.points)
        self.lead()

    def join(self, other: _Swarms) -> None:
        """Take the other's swarms in."""
        for name in _STATE:
            both = getattr(self, name), getattr(other, name)
            setattr(self, name, np.concatenate(both))

    def drop(self, which: int) -> None:
        """Do without this swarm."""
        for name in _STATE:
            setattr(self, name, np.delete(getattr(self, name), which, axis=0))

    def lead(self) -> None:
        """Each swarm's best is the best of its particles' own."""
        rows, first = np.arange(len(self.own)), self.own_heights.argmax(axis=1)
        self.best, self.heights = self.own[rows, first], self.own_heights[rows, first]

    def restart(self, which: list[int]) -> None:
        """Scatter these swarms anew."""
        if not which:
            return
        points = _anywhere(self.rng, len(which), self.own.shape[1])
        heights = _heights(self.course, points)
        rows, first = np.arange(len(which)), heights.argmax(axis=1)
        self.points[which], self.own[which], self.speeds[which] = points, points, 0.0
        self.own_heights[which] = heights
        self.best[which], self.heights[which] = points[rows, first], heights[rows, first]

    def settle(self, points: Floats, heights: Floats) -> None:
        """The particles are at these points now."""
        better = heights > self.own_heights
        self.own = np.where(better[..., None], points, self.own)
        self.own_heights = np.where(better, heights, self.own_heights)
        self.points = points
        self.offer(points, heights)

    def offer(self, points: Floats, heights: Floats) -> None:
        """Each swarm takes the best of these points [m, k, 5] for its best if it is better."""
        rows, first = np.arange(len(points)), heights.argmax(axis=1)
        better = heights[rows, first] > self.heights
        self.best = np.where(better[:, None], points[rows, first], self.best)
        self.heights = np.where(better, heights[rows, first], self.heights)

    def diameters(self) -> Floats:
        """The largest distance between two particles of each swarm."""
        apart = self.points[:, :, None] - self.points[:, None]
        return np.linalg.norm(apart, axis=3).max(axis=(1, 2))


def quantum_swarms(
    course: Course,
    rng: np.random.Generator,
    *,
    swarms: int = 10,
    neutral: int = 5,
    quantum: int = 5,
    cloud: float = 0.5,
) -> None:
    """Multi-swarm of neutral and quantum particles, exclusion, anti-convergence.

    [Blackwell & Branke 2006], its best configuration 10 (5 + 5q); cloud: radius of the quantum
    cloud.
    """
    radius = exclusion_radius(swarms)
    state = _Swarms(course, rng, swarms, neutral)
    while True:
        now = _heights(course, state.best)
        if (now != state.heights).any():
            state.own_heights, best = _heights(course, state.own), state.best
            state.lead()
            state.offer(best[:, None], now[:, None])
        out = _excluded(state.best, state.heights, radius)
        if (state.diameters() < radius).all():
            out = sorted({*out, int(state.heights.argmin())})
        state.restart(out)
        state.speeds = _flown(rng, state.points, state.speeds, state.own, state.best[:, None])
        points = np.concatenate(
            (state.points + state.speeds, _cloud(rng, state.best, quantum, cloud)), axis=1
        )
        heights = _heights(course, points)
        state.settle(points[:, :neutral], heights[:, :neutral])
        state.offer(points[:, neutral:], heights[:, neutral:])


def adaptive_swarms(
    course: Course,
    rng: np.random.Generator,
    *,
    particles: int = 5,
    excess: int = 1,
    cloud: float = 0.5,
) -> None:
    """Multi-swarm whose number of swarms adapts: one more when all have converged.

    [Blackwell 2007], as DEAP's example `pso/multiswarm.py` has it: no swarm is quantum but just
    after a change, and of more than `excess` swarms that roam the worst is dropped. DEAP's is
    3; 1 is a tenth better on scenario 2.
    """
    state = _Swarms(course, rng, 1, particles)
    while True:
        radius = exclusion_radius(len(state.best))
        roaming = int((state.diameters() > 2.0 * radius).sum())
        if roaming == 0:
            state.join(_Swarms(course, rng, 1, particles))
        elif roaming > excess:
            state.drop(int(state.heights.argmin()))
        now = _heights(course, state.best)
        if (now != state.heights).any():
            old = state.best
            state.points = _cloud(rng, old, particles, cloud)
            state.own = state.points.copy()
            state.own_heights = _heights(course, state.own)
            state.speeds = np.zeros_like(state.points)
            state.lead()
            state.offer(old[:, None], now[:, None])
        else:
            state.speeds = _flown(rng, state.points, state.speeds, state.own, state.best[:, None])
            points = state.points + state.speeds
            state.settle(points, _heights(course, points))
        state.restart(_excluded(state.best, state.heights, radius))


def dynamic_de(
    course: Course,
    rng: np.random.Generator,
    *,
    populations: int = 10,
    regular: int = 4,
    brownian: int = 2,
    scale: float = 0.4,
    crossover: float = 0.6,
    sigma: float = 0.3,
) -> None:
    """Differential evolution in populations kept apart, with Brownian individuals about the best.

    DynDE [Mendes & Mohais 2005], best/2/bin, with the settings of DEAP's example `de/dynamic.py`.
    """
    size, radius = regular + brownian, exclusion_radius(populations)
    people = _anywhere(rng, populations, size)
    heights = _heights(course, people)
    rows = np.arange(populations)
    while True:
        first = heights.argmax(axis=1)
        now = _heights(course, people[rows, first])
        if (now != heights[rows, first]).any():
            heights = _heights(course, people)
            first = heights.argmax(axis=1)
        out = _excluded(people[rows, first], heights[rows, first], radius)
        if out:
            people[out] = _anywhere(rng, len(out), size)
            heights[out] = _heights(course, people[out])
            first = heights.argmax(axis=1)
        best = people[rows, first][:, None]
        others = rng.random((populations, regular, size)).argsort(axis=2)[..., :4]
        a, b, c, d = np.moveaxis(people[rows[:, None, None], others], 2, 0)
        crossed = rng.random((populations, regular, DIMENSIONS)) < crossover
        crossed |= np.arange(DIMENSIONS) == rng.integers(DIMENSIONS, size=(populations, regular, 1))
        trials = np.concatenate(
            (
                np.where(crossed, best + scale * (a + b - c - d), people[:, :regular]),
                best + rng.normal(0.0, sigma, (populations, brownian, DIMENSIONS)),
            ),
            axis=1,
        )
        found = _heights(course, trials)
        # The best outlives a worse child of its own even where it was Brownian.
        better = found >= heights
        better[:, regular:] |= np.arange(regular, size) != first[:, None]
        people = np.where(better[..., None], trials, people)
        heights = np.where(better, found, heights)


PEERS = {
    "quantum_swarms": quantum_swarms,
    "adaptive_swarms": adaptive_swarms,
    "dynamic_de": dynamic_de,
}
"""The optimisers by name."""
