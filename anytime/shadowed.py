"""From what a shadow has seen to a program, its profiles, and what they cannot tell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from anytime.errors import AnytimeError
from anytime.library import ProfileLibrary
from anytime.machines import Machine
from anytime.modules import Module
from anytime.profiles import Profile
from anytime.programs import Call, Input, Program, reading, upstream
from anytime.recordings import Recording
from anytime.shadow import Frame, Seen, Shadow, Watched

FEWEST = 20  # frames from which anything is said
RARELY = 0.05  # share of frames or calls below which an oddity is not worth a line
LESS = 0.05  # of the quality that arrived, with which a cautious consumer can do nothing


@dataclass(frozen=True)
class Shadowed:
    """What was seen, as a program with profiles. The unit is the frame.

    frames: those in which every function was called, and fed as usual. unknown: what cannot be
    known from them, a line each.
    """

    program: Program
    frames: tuple[Frame, ...]
    watched: Mapping[str, Watched]
    unknown: tuple[str, ...]

    @property
    def seconds(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Seconds within the functions, [frames]."""
        labels = [call.label for call in self.program.calls]
        return np.array([sum(f.calls[label].end for label in labels) for f in self.frames])

    @property
    def quality(self) -> float:
        """Mean quality with which frames ended."""
        last = self.program.output.label
        watched = self.watched[last]
        ends = [float(_qualities(watched, frame.calls[last])[-1]) for frame in self.frames]
        return float(np.mean(ends))

    def library(self, *, cautious: bool) -> ProfileLibrary:
        """Profiles of the functions.

        cautious: whoever is fed with less than it was in a frame has no result there; else it is
        as good as it was. The truth lies between, for no frame was seen twice.
        """
        profiles = {call.module.name: self._profile(call, cautious) for call in self.program.calls}
        return ProfileLibrary(profiles=profiles, machine=Machine("this"))

    def _profile(self, call: Call, cautious: bool) -> Profile:
        name, feeding = call.module.name, tuple(upstream(call))
        runs: list[Recording] = []
        for number, frame in enumerate(self.frames):
            seen, key = frame.calls[name], f"frame {number}"
            fed: dict[str, float] = {}
            for parameter in feeding:
                source, number = seen.fed[parameter]
                made = frame.calls[source]
                qualities = _qualities(self.watched[source], made)
                fed[parameter] = float(qualities[made.kept(number)])
            runs.append(_recording(key, name, fed, seen, _qualities(self.watched[name], seen)))
            if cautious:
                for parameter in feeding:
                    less = {**fed, parameter: max(fed[parameter] - LESS, 0.0)}
                    if less != fed:
                        runs.append(_recording(key, name, less, Seen(end=seen.end), np.zeros(0)))
        return Profile(name, feeding, tuple(runs))


def shadowed(shadow: Shadow) -> Shadowed:
    """Read a program off what went where, with the frames that show it.

    Raises AnytimeError when too few frames were seen, or no function in any.
    """
    frames = [frame for frame in shadow.kept() if frame.calls]
    if len(frames) < FEWEST:
        raise AnytimeError(
            f"{len(frames)} frames with watched calls; {FEWEST} are needed. Wrap the function that "
            "is one turn of your loop with shadow.frame"
        )
    usual = _usual(frames)
    program = _program(shadow, usual)
    names = [call.label for call in program.calls]
    kept = tuple(frame for frame in frames if all(_as_usual(frame, n, usual[n]) for n in names))
    if len(kept) < FEWEST:
        raise AnytimeError(
            f"only {len(kept)} of {len(frames)} frames have every call of {program!r} with a "
            "result; watch functions that are called in every frame" + _oddities(shadow)
        )
    unknown = tuple(_unknown(shadow, program, frames, kept, usual))
    return Shadowed(program, kept, dict(shadow.watched), unknown)


def _oddities(shadow: Shadow) -> str:
    return "".join(f"\n  {what}: {count} times" for what, count in sorted(shadow.odd.items()))


def _usual(frames: Sequence[Frame]) -> dict[str, dict[str, str]]:
    """What feeds each function, parameter by parameter, in most of its calls; in calling order."""
    counts: dict[str, Counter[tuple[str, str]]] = {}
    calls = Counter[str]()
    for frame in frames:
        for name, seen in frame.calls.items():
            calls[name] += 1
            sources = counts.setdefault(name, Counter())
            sources.update((parameter, source) for parameter, (source, _) in seen.fed.items())
    return {
        name: {p: source for (p, source), count in fed.items() if 2 * count > calls[name]}
        for name, fed in counts.items()
    }


def _program(shadow: Shadow, usual: Mapping[str, Mapping[str, str]]) -> Program:
    """The last function called that others feed, or that is alone, and all that leads to it."""
    fed = [name for name in usual if usual[name]]
    last = fed[-1] if fed else [*usual][-1]
    made: dict[str, Call] = {}

    def call(name: str, *feeding: str) -> Call:
        if name in feeding:
            circle = " to ".join((*feeding[feeding.index(name) :], name))
            raise AnytimeError(
                f"in most frames results go from {circle}, backwards; a program has no such circle"
            )
        if name not in made:
            watched = shadow.watched[name]
            arguments = [
                call(usual[name][p], *feeding, name) if p in usual[name] else Input(p)
                for p in watched.parameters
            ]
            made[name] = opened.call(_module(watched), tuple(arguments))  # pyright: ignore
        return made[name]

    with reading("shadow") as opened:
        output = call(last)
    free = (a.name for each in made.values() for a in each.arguments if isinstance(a, Input))
    return Program("shadow", tuple(dict.fromkeys(free)), tuple(opened.nodes), output)


def _module(watched: Watched) -> Module:
    def unable(*_: object, **__: object) -> NoReturn:
        raise AnytimeError(
            f"{watched.name} was only watched; make it a module with @anytime.module to run it"
        )

    score = watched.score or (lambda _: 1.0)
    quality, cost = (None, score) if watched.cost else (score, None)
    filled = frozenset({"seconds"} if watched.contract else ())
    return Module(watched.name, unable, watched.parameters, filled, quality, cost, generator=True)


def _as_usual(frame: Frame, name: str, fed: Mapping[str, str]) -> bool:
    seen = frame.calls.get(name)
    if seen is None or not seen.seconds:
        return False
    return {p: source for p, (source, _) in seen.fed.items() if p in fed} == dict(fed)


def _qualities(watched: Watched, seen: Seen) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Quality at each result; of a cost by the cheapest of that frame."""
    scores = np.array(seen.scores, dtype=float)
    if not watched.cost or not len(scores):
        return scores
    positive = scores[scores > 0]
    least = positive.min() if len(positive) else 1.0
    return np.where(scores > 0, least / np.where(scores > 0, scores, 1.0), 1.0).clip(0.0, 1.0)


def _recording(
    key: str, name: str, fed: Mapping[str, float], seen: Seen, qualities: Any
) -> Recording:
    seconds = np.array(seen.seconds, dtype=float)
    steps = np.arange(1, len(seconds) + 1, dtype=float)
    end = (max(seen.end, float(seconds[-1]) if len(seconds) else 0.0), float(len(seconds)))
    nothing = np.full(len(seconds), np.nan)
    return Recording(key, name, fed, {}, seconds, steps, qualities, nothing, end, seen.complete)


def _unknown(
    shadow: Shadow,
    program: Program,
    frames: Sequence[Frame],
    kept: Sequence[Frame],
    usual: Mapping[str, Mapping[str, str]],
) -> Iterator[str]:
    for call in program.calls:
        name, watched = call.label, shadow.watched[call.label]
        seen = [frame.calls[name] for frame in kept]
        if watched.contract:
            yield _contract(name, seen)
        elif all(len(each.seconds) == 1 for each in seen):
            yield (
                f"{name} has no curve: it gave one result, at its end. Let it register earlier ones"
            )
        if watched.score is None:
            yield f"how good {name} is: nobody scored it; give shadow.watch(…, quality=…)"
        elif watched.cost:
            yield f"how good {name} could be: its cost was only compared with its own best"
        if all(each.complete for each in seen):
            yield f"what {name} gains from more time than it takes by itself"
        for parameter, source in usual[name].items():
            yield (f"what {name} makes of worse {parameter}: {source} fed it but once a frame")
    names = {call.label for call in program.calls}
    for name in (name for name in usual if name not in names):
        yield f"what {name} is for: its results feed nothing that was watched"
    if len(frames) - len(kept) > RARELY * len(frames):
        yield (
            f"the {len(frames) - len(kept)} of {len(frames)} frames in which a call was missing, "
            "had no result, or was fed otherwise"
        )
    for what, count in sorted(shadow.odd.items()):
        if count > RARELY * max(shadow.count, 1):
            yield f"{count} calls of {what}"


def _contract(name: str, seen: Sequence[Seen]) -> str:
    times = {round(each.given, 6) for each in seen if each.given is not None}
    if len(times) < 2:
        return f"{name} has no curve: it was only ever told one time. Vary it now and then"
    return f"the curve of {name} for one frame: each was seen at one of {len(times)} times"
