"""Where a mission's value went: to driving, to waiting, to energy, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

from monitor.log_lines import FrameLine, Log


@dataclass(frozen=True)
class Loss:
    """What a frame took from the net value.

    drive, wait: value that ran out while the robot moved and stood. energy: price × energy used.
    news: value lost by what became known, negative where it was won. before, after: net value
    foreseen when the frame began and when the next one did (or the true one at the end); None where
    nothing was foreseen.
    """

    index: int
    drive: float
    wait: float
    energy: float
    news: float = 0.0
    before: float | None = None
    after: float | None = None

    @property
    def used(self) -> float:
        """What the frame used up, needful or not; news are not its doing."""
        return self.drive + self.wait + self.energy

    @property
    def total(self) -> float:
        """By how much it fell short of what was foreseen; what it used where nothing was.

        What driving takes is foreseen, so that this is bad luck and bad decisions alone; over a
        mission it adds up to what was promised − what it was worth.
        """
        if self.before is None or self.after is None:
            return self.used
        return self.before - self.after


@dataclass(frozen=True)
class Step:
    """A bar of the waterfall: from what is there before it to what is left after it."""

    name: str
    before: float
    after: float
    sum: bool = False

    @property
    def size(self) -> float:
        return self.after - self.before


def loss_of(log: Log, frame: FrameLine) -> Loss:
    """The loss of one frame; the value that runs out is shared by the time moved and stood."""
    news = -log.mission.told(frame.started, frame.ended)
    late = log.mission.worth(frame.started) - log.mission.worth(frame.ended) - news
    length = frame.ended - frame.started
    moved = min(max(frame.driven / length, 0.0), 1.0) if length > 0 else 0.0
    energy = log.mission.energy["price"] * frame.energy
    before = frame.moments[0].net
    if frame.index + 1 < len(log.frames):
        after = log.frames[frame.index + 1].moments[0].net
    else:
        after = log.end.net if log.end else frame.so_far
    return Loss(frame.index, late * moved, late * (1.0 - moved), energy, news, before, after)


def waterfall(log: Log) -> list[Step]:
    """From the worth of the task down to its net value; the steps add up to it exactly."""
    losses = [loss_of(log, frame) for frame in log.frames]
    steps: list[Step] = []
    left = worth = log.mission.worth(0.0)
    steps.append(Step("worth", 0.0, worth, sum=True))
    end = log.end
    finished = log.frames[-1].ended if log.frames else 0.0
    at_last = log.mission.told(finished, end.seconds) if end is not None else 0.0
    lost = {
        "drive": sum(loss.drive for loss in losses),
        "wait": sum(loss.wait for loss in losses),
        "news": sum(loss.news for loss in losses) - at_last,
    }
    for name, amount in lost.items():
        if name != "news" or amount:
            steps.append(Step(name, left, left - amount))
            left -= amount
    if end is not None:
        job = log.mission.worth(finished) - log.mission.worth(end.seconds) + at_last
        if job > 0:
            steps.append(Step("job", left, left - job))
            left -= job
        # What was not reached earns nothing, whatever it would still be worth.
        if left - end.earned > 1e-6 * worth:
            steps.append(Step("not reached", left, end.earned))
            left = end.earned
    spent = log.mission.energy["price"] * (
        end.energy if end else sum(frame.energy for frame in log.frames)
    )
    steps.append(Step("energy", left, left - spent))
    left -= spent
    steps.append(Step("net" if end else "net so far", 0.0, left, sum=True))
    return steps


def costliest(log: Log) -> list[Loss]:
    """The frames by what they lost, the worst first."""
    losses = [loss_of(log, frame) for frame in log.frames]
    return sorted(losses, key=lambda loss: (-loss.total, loss.index))
