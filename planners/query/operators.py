"""The genetic operators and how often each is used."""

from __future__ import annotations

from dataclasses import dataclass, replace

from anytime.errors import AnytimeError


@dataclass(frozen=True)
class Operators:
    """How children are made. `anytime bench query --full` prints what each operator is worth.

    Shares of the children; what is left of 1 are copies:
    crossover: each value from one of two parents [PRP16 §2].
    line: continuous values on the line through two parents.
    difference: continuous values moved by a share of the difference of two others.
    cloud: all continuous values of the best moved a little; the step adapts by the rule of one
        success in five.

    What else happens to a child, but for a clouded one:
    pair: probability that a bit of one value of a source is moved to another value of it, so that
        their sum stays.
    structure: probability that one turn of the model's loop is deleted, repeated, made anew, split
        or merged.
    mutations: values that are changed, on average, where no pair was. steps: their sizes are
        log-uniform between these two, in units of the choice's own spread.
    adaptive: three times as many mutations after a change of the world was seen [PRP16 §4].
    dormant: what a child inherits and does not use stays in its genome [PRP16 §4].

    The population:
    immigrants: share of new individuals in each generation.
    elites: share that is kept and evaluated again in each generation, so that a changed world is
        seen.
    islands: parts that breed apart; of two whose best differ by less than `exclusion` spreads, the
        worse begins anew: for objectives with several optima that take turns.
    scouts: size of an island beside the population, as a share of it, that begins anew every
        `restart` generations and sends what is better than the population's best.

    Raises AnytimeError for shares outside [0, 1] or that are more than 1 together.
    """

    crossover: float = 0.5
    line: float = 0.1
    difference: float = 0.1
    cloud: float = 0.1
    pair: float = 0.3
    structure: float = 0.45
    mutations: float = 1.0
    steps: tuple[float, float] = (1e-4, 1.0)
    adaptive: bool = True
    dormant: bool = True
    immigrants: float = 0.02
    elites: float = 0.1
    islands: int = 1
    exclusion: float = 0.2
    scouts: float = 0.5
    restart: int = 40

    def __post_init__(self) -> None:
        for name in ("crossover", "line", "difference", "cloud", "pair", "structure", "immigrants"):
            if not 0 <= getattr(self, name) <= 1:
                raise AnytimeError(f"{name}={getattr(self, name)}; give a share in [0, 1]")
        if self.crossover + self.line + self.difference + self.cloud > 1 + 1e-9:
            raise AnytimeError("crossover, line, difference and cloud together are at most 1")
        if not 0 < self.steps[0] <= self.steps[1]:
            raise AnytimeError(f"steps={self.steps}; give 0 < smallest <= largest")
        if not (self.mutations > 0 and self.restart >= 2):
            raise AnytimeError("mutations must be > 0 and restart at least 2 generations")
        if not (0 <= self.elites < 1 and 0 <= self.scouts <= 10):
            raise AnytimeError("elites must lie in [0, 1) and scouts in [0, 10]")
        if self.islands < 1 or self.exclusion < 0:
            raise AnytimeError("islands must be at least 1 and exclusion not negative")

    @classmethod
    def paper(cls) -> Operators:
        """Those of [PRP16] §2: crossover choice by choice, and mutation by small steps.

        The paper prints no rates. With this rare mutation a population of some thousands behaves
        as its §4 tells: it finds a plan in no time and, once converged, does not leave it.
        """
        return cls(
            crossover=1.0,
            line=0.0,
            difference=0.0,
            cloud=0.0,
            pair=0.0,
            structure=0.0,
            mutations=0.05,
            steps=(0.1, 0.1),
            adaptive=False,
            immigrants=0.0,
            scouts=0.0,
        )

    def without(self, name: str) -> Operators:
        """These operators with one of them switched off, for an ablation."""
        if name not in SWITCHES:
            raise AnytimeError(f"no operator {name!r} to switch off; choose {', '.join(SWITCHES)}")
        return replace(self, **{name: type(getattr(self, name))(0)})


SWITCHES = (
    *("crossover", "line", "difference", "cloud", "pair", "structure", "adaptive", "dormant"),
    *("immigrants", "elites", "scouts"),
)
"""The operators that can be switched off."""
