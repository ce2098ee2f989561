"""The claims of [ZR93]."""

from __future__ import annotations

from experiments.reproduction import abstraction, dividing, tasks
from experiments.reproduction.abstraction import (
    executable,
    final_quality,
    final_time,
    final_work,
    level3,
    level10,
    noisy_first,
    noisy_lower_on_average,
    step_cost_invariant,
)
from experiments.reproduction.claims import Claim, Value, behaviour
from experiments.reproduction.dividing import (
    compiled_above_min_max,
    conditional_ordered,
    interruptible,
    tree_optimal,
)
from experiments.reproduction.looking import vision_none_below_ta, vision_rises
from experiments.reproduction.sweeps import sweeps
from experiments.reproduction.tasks import ahead_behind, within_4
from experiments.reproduction.zr_animations import animate
from experiments.reproduction.zr_drawing import draw

__all__ = ["CLAIMS", "animate", "draw", "settings", "sweeps"]

CLAIMS: tuple[Claim, ...] = (
    behaviour(
        "zr.vision_none_below_ta",
        "given a shorter run-time than Ta the sensor produces no description",
        vision_none_below_ta,
    ),
    Claim(
        "zr.vision_rises",
        "from Ta to Tb the quality of vision improves to the maximal one, 1.00",
        (Value(1.0, "behaviour"), Value(1.0, "mean", "more", "at_tb")),
        vision_rises,
    ),
    Claim(
        "zr.level3",
        "the quality of a plan at level 3 is 0.826",
        (Value(0.826, "drawing", "more"),),
        level3,
    ),
    Claim(
        "zr.level10",
        "with segments at levels 0 and 1 it reached 0.985",
        (Value(0.985, "drawing", "more"),),
        level10,
    ),
    Claim(
        "zr.final_quality",
        "run until completion, the expected quality is 0.93",
        (Value(0.93, "mean", "more"),),
        final_quality,
    ),
    Claim(
        "zr.final_work",
        "completion takes 27 % of what A* takes, in expansions",
        (Value(0.27, "mean", "less"),),
        final_work,
    ),
    Claim(
        "zr.final_time",
        "completion takes 27 % of what A* takes, in wall time",
        (Value(0.27, "mean", "less"),),
        final_time,
    ),
    Claim(
        "zr.step_cost_invariant",
        "the run-time of a refinement is approximately the same at all levels",
        (Value(1.0, "behaviour"),),
        step_cost_invariant,
    ),
    behaviour(
        "zr.executable",
        "any abstract plan is executable, even when blocked by obstacles",
        executable,
    ),
    Claim(
        "zr.noisy_first",
        "with vision of 0.96 the quality of the first plan is only 0.760",
        (Value(0.76, "drawing", "more"),),
        noisy_first,
    ),
    behaviour(
        "zr.noisy_lower_on_average",
        "errors of vision make plans worse on average",
        noisy_lower_on_average,
    ),
    behaviour(
        "zr.conditional_ordered",
        "the conditional profile: better vision, better plans, at every run-time",
        conditional_ordered,
    ),
    behaviour(
        "zr.tree_optimal",
        "compiling one structure at a time is optimal",
        tree_optimal,
    ),
    behaviour(
        "zr.compiled_above_min_max",
        "the compiled profile is superior to MIN's and MAX's",
        compiled_above_min_max,
    ),
    Claim(
        "zr.interruptible",
        "a contract algorithm becomes interruptible by at most 4 times the run-time",
        (Value(4.0, "mean", "less"),),
        interruptible,
    ),
    behaviour(
        "zr.ahead_behind",
        "planning ahead and execution behind: faster; the other way round: slower",
        ahead_behind,
    ),
    Claim(
        "zr.within_4",
        "the task value computed at first is achieved within 4 %: less, and more",
        (
            Value(tasks.ERROR, "mean", "less"),
            Value(-tasks.ERROR, "mean", "more", "above"),
        ),
        within_4,
    ),
)
"""In the order of the paper."""


def settings() -> dict[str, object]:
    """What was chosen where the paper does not say: floors, samples, what "approximately" is, and
    what a task is worth."""
    return {
        "floors": f"{abstraction.FAMILY} {abstraction.SIZE}",
        "floors_a_batch": abstraction.BATCH,
        "step_cost_factor": abstraction.ALIKE,
        "domains_a_profile": dividing.DOMAINS,
        "task_value": f"{tasks.MISSION.value.kind}, {tasks.MISSION.value.seconds:g} s",
        "task_floors": f"{abstraction.FAMILY} {tasks.SIZE}",
    }
