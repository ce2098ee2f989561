"""The claims of [PRP16]."""

from __future__ import annotations

from experiments.reproduction import executions, searches
from experiments.reproduction.claims import Claim, Value, behaviour
from experiments.reproduction.collisions import collision_on_crossing
from experiments.reproduction.executions import (
    objective_after_stand,
    obstacle_step,
    skip_executed,
)
from experiments.reproduction.missions import replanned_final, switch_above_threshold
from experiments.reproduction.nao_animations import animate
from experiments.reproduction.nao_drawing import draw
from experiments.reproduction.searches import (
    any_length,
    appeared_most_cases,
    fall_stands_up,
    first_plan,
    moving_tracked,
    printed_moving_error,
    removed_early_straight,
    removed_late_stays,
    round_obstacle,
    stand_first,
    toy,
    value_unchanged_by_removal,
)
from experiments.reproduction.sweeps import Sweep

__all__ = ["CLAIMS", "animate", "draw", "settings", "sweeps"]

CLAIMS: tuple[Claim, ...] = (
    behaviour("prp.toy", "the query finds how many normal variables, and which, add up to 5", toy),
    behaviour(
        "prp.any_length",
        "plans of an unknown number of actions with unknown parameters are found",
        any_length,
    ),
    behaviour(
        "prp.stand_first",
        "without obstacles, from sitting: first to stand up, then directly to the goal",
        stand_first,
    ),
    Claim(
        "prp.round_obstacle",
        "plans bypass an obstacle, usually by the shortest route",
        (Value(1.0, "behaviour"), Value(0.5, "mean", "more", "shortest")),
        round_obstacle,
    ),
    Claim(
        "prp.first_plan",
        "an almost precise plan appears after 0.5 s",
        (Value(0.5, "drawing", "less"),),
        first_plan,
    ),
    Claim(
        "prp.moving_tracked",
        "the best plan tracks a target of 10 cm/s: after 6 s it ends this far from it (m)",
        (Value(printed_moving_error(), "drawing", "less"),),
        moving_tracked,
    ),
    behaviour(
        "prp.removed_early_straight",
        "the obstacle is removed after 0.5 s: the plan becomes straight",
        removed_early_straight,
    ),
    behaviour(
        "prp.removed_late_stays",
        "the obstacle is removed after 3 s: the plan keeps its detour",
        removed_late_stays,
    ),
    behaviour(
        "prp.value_unchanged_by_removal",
        "what the plan is worth does not change when the obstacle is removed",
        value_unchanged_by_removal,
    ),
    Claim(
        "prp.appeared_most_cases",
        "the route round an obstacle that appears is found in most cases",
        (Value(0.5, "mean", "more"),),
        appeared_most_cases,
    ),
    behaviour(
        "prp.skip_executed",
        "what is executed is skipped: executing a plan does not change what it is worth",
        skip_executed,
    ),
    Claim(
        "prp.objective_after_stand",
        "the objective of the plan in execution: .06, after standing up .18, at most .22, then .16",
        (
            Value(executions.AFTER_STAND, "drawing", "less"),
            Value(searches.INITIAL, "drawing", "less", "before"),
            Value(executions.MOST, "drawing", "less", "most"),
            Value(executions.END, "drawing", "less", "end"),
            Value(executions.ERROR, "drawing", "less", "error"),
        ),
        objective_after_stand,
    ),
    Claim(
        "prp.obstacle_step",
        "an unexpected obstacle raises it by 0.45",
        (Value(executions.STEP, "drawing"),),
        obstacle_step,
    ),
    behaviour(
        "prp.switch_above_threshold",
        "the robot switches to a plan that is better by a threshold",
        switch_above_threshold,
    ),
    Claim(
        "prp.replanned_final",
        "replanning, the robot ends within this of its goal (m)",
        (Value(0.1, "mean", "less"),),
        replanned_final,
    ),
    behaviour(
        "prp.fall_stands_up",
        "after a fall a plan is found that stands up and walks on to the goal",
        fall_stands_up,
    ),
    behaviour(
        "prp.collision_on_crossing",
        "a path that crosses an obstacle ends in a crouch at its place",
        collision_on_crossing,
    ),
)
"""In the order of the paper."""


def settings() -> dict[str, object]:
    """What was chosen where the paper does not say: the effort of a second, in metres, with which a
    plan costs the 0.06 that it prints; the obstacle that the plans which it prints go round."""
    return {
        "effort_of_searches": searches.effort(),
        "effort_of_executions": executions.effort(),
        "obstacle": searches.printed_disc(),
    }


def sweeps(quick: bool) -> tuple[Sweep, ...]:
    """None: what the paper leaves open is inferred from what it prints."""
    return ()
