"""Whom every benchmark compares us with: the rows of the table beyond the papers."""

from __future__ import annotations

from experiments.reproduction.comparisons import Comparison

_FLOORS = {
    "iid.512.r20": "512² cells, 20 % blocked",
    "iid.1024.r20": "1024² cells, 20 % blocked",
    "rooms.512": "512² cells, rooms",
    "rooms.1024": "1024² cells, rooms",
    "hard.clustered": "512² cells, clustered",
    "hard.maze": "512² cells, a maze",
    "maps": "game maps",
}
_PLANNERS = {"ara": "ARA*", "rwa": "restarting weighted A*"}
_PEERS = {
    "nano": "nano-astar",
    "tcod": "libtcod",
    "skimage": "scikit-image",
    "networkx": "networkx",
}
_SAMPLERS = {"bitstar": "OMPL's BIT*", "rrtstar": "OMPL's RRT*"}
_VALUES = {"linear": "a linear value", "soft": "a soft deadline", "hard": "a hard deadline"}
_LOADS = {"free": "cores free", "busy": "a busy process a core", "isolated_busy": "isolated, busy"}

_CHAIN = "time to compile a chain of 20 modules"
_UNSEEN = "quality on domains never seen, all budgets"
_KINDS = "value kept over 16 kinds of mission"
_OFFICE = "value of the office mission"
_RATE = "evaluations a second of a NAO's plans"
_WORLDS = "goals reached in random worlds"

_ROWS = {
    "planner": [
        *(
            (f"{floor}.{what}_q97", f"{what} until .97 of the optimum, {told}", "our A*", "share")
            for floor, told in _FLOORS.items()
            for what in ("work", "time")
        ),
        *(
            (
                f"against.{planner}.work_q97.{floor.replace('.', '_')}",
                f"work until .97 of the optimum, {told}",
                name,
            )
            for planner, name in _PLANNERS.items()
            for floor, told in _FLOORS.items()
        ),
        *((f"astar.vs_{it}", "time of our A*, 20 % blocked", name) for it, name in _PEERS.items()),
        *(
            (f"sampling.{it}.quality", "quality of a way, in 1 % of the time", name, "share")
            for it, name in _SAMPLERS.items()
        ),
    ],
    "compiler": [
        ("vs_forward", _CHAIN, "the time domain, every split"),
        ("vs_forward_by_rows", _CHAIN, "the time domain, vectorised bytes"),
        ("vs_cpsat", "time for all budgets; the rival's for one", "CP-SAT, until its limit"),
        ("fig8.unseen_vs_min", _UNSEEN, "vision pinned to Ta"),
        ("fig8.unseen_vs_max", _UNSEEN, "vision pinned to Tb"),
        ("adaptive.gain", "value of deciding each share as one goes", "all decided before", "more"),
    ],
    "monitor": [
        ("loss.vs_paper", _KINDS, "the rule of [ZR93]"),
        ("loss.vs_fixed", _KINDS, "the best fixed contract"),
        *(
            (
                f"world.margin_fixed.{kind}",
                f"value in the simulated world, {told}",
                "the best fixed division",
                "margin",
            )
            for kind, told in _VALUES.items()
        ),
        ("traces.vs_fixed", "loss of stopping on recorded traces", "a fixed contract", "share"),
        ("decision.vs_numpy", "time of a decision, a look-up", "numpy's argmax of [ZR93]'s rule"),
    ],
    "mission": [
        ("value.margin", _OFFICE, "the better of MIN and MAX", "margin"),
        ("value.margin_fixed", _OFFICE, "the raced fixed division", "margin"),
        ("gap.hindsight", _OFFICE, "hindsight, which knows the noise", "gap"),
    ],
    "query": [
        ("vs_cpp.nao", _RATE, "C++, same operators by hand"),
        ("vs_cpp_tags.nao", _RATE, "C++, choices by name"),
        ("vs_plain.nao", _RATE, "the same model in plain Python"),
        ("vs_optuna.nao", _RATE, "Optuna's random search"),
        ("vs_best_peer.nao", "time to a good plan", "the fastest of the packages"),
        ("moving_peaks.vs_best_peer", "error on the moving peaks", "the best of three published"),
    ],
    "nao": [
        ("worlds.vs_unmonitored", _WORLDS, "the first good plan, not monitored"),
        ("worlds.vs_noiseless", _WORLDS, "that plan, by a robot that never errs"),
    ],
    "faults": [
        ("return_bound.kept", "modules that misbehave end in time", "always, 250 ms later at most"),
        ("connected.reached", "floors crossed though plans are rubbish", "always, where one can"),
        ("halt.within_1_s", "robots that stand when their link fails", "always, within 1 s"),
    ],
    "deadline": [
        (f"{load}.vs_floor", f"return from a contract of 50 ms, p99, {told}", "an empty loop")
        for load, told in _LOADS.items()
    ],
    "campaign": [
        ("overhead.vs_plain", "time of a run whose outcome is kept", "one that is not"),
        ("coverage.vs_fixed_intervals", "coverage of the bound when it ends", "fixed intervals"),
        ("calibrated.vs_uncalibrated", "error of promises on another machine", "not calibrated"),
    ],
}  # fmt: skip
"""By benchmark, in the order of the table: the figure, what of ours, whose, how it is read."""

COMPARISONS = tuple(
    Comparison(benchmark, *row) for benchmark, rows in _ROWS.items() for row in rows
)
BENCHMARKS = tuple(_ROWS)
