"""What [ZR93] §2 and Fig. 2 say of anytime vision."""

from __future__ import annotations

import math

import numpy as np

import anytime
from anytime import Deadline, WorkClock
from anytime.results import Result
from experiments.domains import MACHINE
from experiments.reproduction.ways import Way
from sensing import uniform
from sensing.camera import Camera
from sensing.vision import Device, Sensor, Vision, see, seen_quality

RADIUS = 24  # cells, of the floors looked at
DENSITY = 0.2
MOMENTS = 9
"""Times from the first description to the last at which the quality must have risen."""
_EXPOSURE = MACHINE.seconds("see", 1.0)


def span(device: Device) -> tuple[float, float]:
    """Seconds of the first description (Ta) and of the best one (Tb)."""
    if isinstance(device, Vision):
        first, last = device.t_a, device.t_b
    elif isinstance(device, Camera):
        first, last = device.first, device.last
    else:
        raise TypeError(f"{device!r} does not say when it sees")
    return _EXPOSURE * math.ceil(first), _EXPOSURE * math.ceil(last)


def look(seed: int, device: Device, seconds: float) -> tuple[Result, float]:
    """What is seen of a random floor in that time, and its true quality (NaN if nothing is)."""
    free = uniform(2 * RADIUS + 1, DENSITY, np.random.default_rng((seed, 5)))
    sensor = Sensor(free, (RADIUS, RADIUS), RADIUS, device)
    # A hair more, so that the exposure is done that ends at that very moment.
    deadline = Deadline.after(seconds * (1.0 + 1e-9), WorkClock(MACHINE))
    result = anytime.run(see, sensor, deadline=deadline, rng=np.random.default_rng(seed))
    return result, _Seen(sensor).quality(result)


class _Seen:
    def __init__(self, sensor: Sensor) -> None:
        self.sensor = sensor

    def quality(self, result: Result) -> float:
        return seen_quality(result.value, self) if result else math.nan


def qualities(seed: int, device: Device) -> list[float]:
    """True quality of one look after each exposure; NaN before the first description."""
    free = uniform(2 * RADIUS + 1, DENSITY, np.random.default_rng((seed, 5)))
    seen = _Seen(Sensor(free, (RADIUS, RADIUS), RADIUS, device))
    looks = device.look(free, (RADIUS, RADIUS), RADIUS, np.random.default_rng(seed))
    return [math.nan if one is None else seen_quality(one, seen) for one in looks]


# --- The claims, one draw each.


def vision_none_below_ta(seed: int, way: Way) -> bool:
    """Given less than Ta there is no description; given Ta there is one."""
    first, _ = span(way.device)
    short = float(np.random.default_rng((seed, 6)).uniform(0.0, 0.999)) * first
    # An exposure that has begun is ended; its result is late, and so none of that run-time.
    none, some = (look(seed, way.device, seconds)[0] for seconds in (short, first))
    return not (none and none.history[0].seconds <= short) and bool(some)


def vision_rises(seed: int, way: Way) -> tuple[float, ...]:
    """Whether a look's true quality never falls from Ta to Tb and is higher at Tb; and that one."""
    times = np.linspace(*span(way.device), MOMENTS)
    seen = np.array([look(seed, way.device, seconds)[1] for seconds in times])
    rises = bool((np.diff(seen) >= 0.0).all() and seen[-1] > seen[0])
    return float(rises), float(seen[-1])
