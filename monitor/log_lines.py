"""What the lines of a mission's log hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from monitor.missions import Value

SCHEMA = "anytime.log/1"
LEVELS = 15  # of belief: 0 = surely free … 15 = surely blocked, so that two cells fill a byte
DRAWN = 2**18  # cells that are logged of a map at most; a larger one is thinned out
Cell = tuple[int, int]


class _Line(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """A line of a log; unknown fields are refused."""


class SceneFacts(_Line, frozen=True):
    """The floor as logged: `rows` x `columns` cells of `step` x `step` cells of the map each.

    truth: base64 of the packed bits of the free cells. Places are in cells of the map.
    """

    rows: int
    columns: int
    step: int
    resolution: float
    start: Cell
    goal: Cell
    radius: float
    density: float
    truth: str
    also: tuple[Cell, ...] = ()


class Box(_Line, frozen=True):
    """The part of the belief that changed: base64 of levels 0 … 15, two a byte, high one first."""

    row: int
    column: int
    rows: int
    columns: int
    levels: str


class MomentLine(_Line, frozen=True):
    """A decision, and the numbers behind it: see `monitor.states.Why`."""

    time: float
    moment: str
    shares: dict[str, float]
    speed: float
    value: float | None
    cost: float | None
    seconds: float | None
    curve: tuple[tuple[float, float | None], ...]
    case: str

    @property
    def contract(self) -> float:
        """The contract time t_c of the frame."""
        return sum(self.shares.values())

    @property
    def net(self) -> float | None:
        """The net value foreseen; None when the decision was made without foresight."""
        if self.value is None or self.cost is None or self.seconds is None:
            return None
        return self.value - self.cost if self.curve else None


class CallLine(_Line, frozen=True):
    """One call of the program in a frame: see `monitor.reports.CallRecord`."""

    label: str
    started: float
    elapsed: float
    share: float
    overrun: float
    status: str
    advertised: float | None
    estimate: float | None
    fault: str | None


class Comparison(_Line, frozen=True):
    """The plan in execution beside the best other one, at a time.

    held, found: their objectives, in metres; the less the better. idle: no plan was in execution,
    and `held` is that of doing nothing. threshold: by how much `found` must be less. taken: it took
    the place. other: where the plan leads that was not taken, or was given up for it; empty if
    there is none or it is the same.
    """

    time: float
    held: float
    found: float
    threshold: float
    idle: bool
    taken: bool
    other: tuple[tuple[float, float], ...] = ()


class SonarCone(_Line, frozen=True):
    """What a range sensor looks at, and what it told at last: `heard` is None for no echo.

    bearing: of its middle. reach: how far it hears.
    """

    row: float
    column: float
    bearing: float
    half_angle: float
    reach: float
    heard: float | None


class Motion(_Line, frozen=True):
    """What a robot that moves in metres tells of a frame, as it was at the frame's end.

    Places are (row, column) and lengths are in cells of the map, with fractions: (0, 0) is the
    upper left corner of the first cell. Angles are counterclockwise from the direction of the
    columns; times are seconds since the task was presented.
    track: row, column and heading, from the frame's start on. radius: of the robot. plan: where the
    plan in execution leads, as it was foreseen when it was last compared. discs: obstacles believed
    (row, column, radius), from which the robot's middle keeps `clearance`. events: what is worth a
    mark, and when.
    """

    track: tuple[tuple[float, float, float], ...]
    radius: float
    plan: tuple[tuple[float, float], ...] = ()
    goal: tuple[float, float] | None = None
    discs: tuple[tuple[float, float, float], ...] = ()
    clearance: float = 0.0
    cones: tuple[SonarCone, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    events: tuple[tuple[float, str], ...] = ()


class MissionLine(_Line, frozen=True, tag_field="kind", tag="mission"):
    """The first line. fixed: {"shares", "speed", "net"} of a fixed division on the same seed.
    news: the value that becomes known on the way, and `at` which time."""

    schema: str
    name: str
    policy: str
    seed: int
    machine: str
    labels: tuple[str, ...]
    value: dict[str, float | str]
    energy: dict[str, float]
    speeds: tuple[float, float]
    job: float
    gain: float
    scene: SceneFacts | None = None
    fixed: dict[str, Any] | None = None
    news: dict[str, float | str] | None = None

    def worth(self, seconds: float) -> float:
        """The value of completing after so many seconds."""
        if self.news is not None and seconds >= float(self.news["at"]):
            return _worth(self.news, seconds)
        return _worth(self.value, seconds)

    def told(self, begin: float, end: float) -> float:
        """By how much the news changed that value, if they came after `begin` and until `end`."""
        if self.news is None or not begin < float(self.news["at"]) <= end:
            return 0.0
        at = float(self.news["at"])
        return _worth(self.news, at) - _worth(self.value, at)


def _worth(value: Mapping[str, float | str], seconds: float) -> float:
    kind, worth, scale = (value[name] for name in ("kind", "worth", "seconds"))
    return float(Value(kind, float(worth), float(scale))(seconds))  # type: ignore[arg-type]


class FrameLine(_Line, frozen=True, tag_field="kind", tag="frame"):
    """A frame. so_far: value of completing at its end − price × energy used until then.

    path: cells walked. plan: (level, row, column) of the plan executed. motion: of a robot that
    moves in metres. prices: net value of one more second for each call.
    """

    index: int
    started: float
    ended: float
    standing: bool
    moments: tuple[MomentLine, ...]
    calls: tuple[CallLine, ...]
    driven: float
    waited: float
    energy: float
    interrupted: bool
    so_far: float
    path: tuple[Cell, ...] = ()
    plan: tuple[tuple[int, int, int], ...] = ()
    belief: Box | None = None
    motion: Motion | None = None
    prices: dict[str, float | None] | None = None
    story: dict[str, Any] = {}


class EndLine(_Line, frozen=True, tag_field="kind", tag="end"):
    """The last line: see `monitor.reports.Report`."""

    ending: str
    promised: float | None
    net: float
    earned: float
    seconds: float
    energy: float
    job: float
    ledger: dict[str, float]
    fault: str = ""


class RegretLine(_Line, frozen=True, tag_field="kind", tag="regret"):
    """Other decisions of a frame as (shares, speed, net value of the mission with it): see
    `monitor.regrets`. It stands behind the end."""

    frame: int
    forks: tuple[tuple[dict[str, float], float, float], ...]


@dataclass(frozen=True)
class Log:
    """A mission as it was logged; `end` is None while it goes on or when it was cut off.

    regrets: by frame, of missions whose decisions were lived again.
    """

    mission: MissionLine
    frames: tuple[FrameLine, ...] = ()
    end: EndLine | None = None
    regrets: tuple[RegretLine, ...] = ()

    @property
    def promised(self) -> float | None:
        """The net value foreseen when the task was presented."""
        return self.frames[0].moments[0].net if self.frames else None

    @property
    def net(self) -> float | None:
        """What the mission was really worth, or would be if it ended now."""
        if self.end is not None:
            return self.end.net
        return self.frames[-1].so_far if self.frames else None
