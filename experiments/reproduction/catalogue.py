"""Who every benchmark compares us with: the rows of the table beyond the papers."""

from __future__ import annotations

from collections.abc import Iterator

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
_RIVALS = {"ara": "ARA*", "rwa": "restarting weighted A*"}
_PEERS = {
    "nano": "nano-astar",
    "tcod": "libtcod",
    "skimage": "scikit-image",
    "networkx": "networkx",
}
_VALUES = {"linear": "a linear task value", "soft": "a soft deadline", "hard": "a hard deadline"}
_LOADS = {"free": "cores free", "busy": "a busy process a core", "isolated_busy": "isolated, busy"}


def _planner() -> Iterator[Comparison]:
    for floor, told in _FLOORS.items():
        for what in ("work", "time"):
            text = f"{what} until .97 of the optimum, {told}"
            yield Comparison("planner", f"{floor}.{what}_q97", text, "our A* to the end", "share")
    for rival, name in _RIVALS.items():
        for floor, told in _FLOORS.items():
            key = f"against.{rival}.work_q97.{floor.replace('.', '_')}"
            yield Comparison("planner", key, f"work until .97, {told}", name)
    for peer, name in _PEERS.items():
        yield Comparison("planner", f"astar.vs_{peer}", "time of our A*, 20 % blocked", name)
    for sampler, name in (("bitstar", "OMPL's BIT*"), ("rrtstar", "OMPL's RRT*")):
        key = f"sampling.{sampler}.quality"
        text = "quality of the way; the rival has 100 times the time"
        yield Comparison("planner", key, text, name, "share")


def _compiler() -> Iterator[Comparison]:
    yield Comparison("compiler", "vs_forward", "time to compile a chain of 20 modules",
                     "the time domain, every split")  # fmt: skip
    yield Comparison("compiler", "vs_forward_by_rows", "time to compile a chain of 20 modules",
                     "the time domain, vectorised bytes")  # fmt: skip
    yield Comparison("compiler", "vs_cpsat", "time for all budgets; the rival's for one",
                     "CP-SAT, until its limit")  # fmt: skip
    for rival in ("min", "max"):
        yield Comparison("compiler", f"fig8.unseen_vs_{rival}",
                         "quality on domains never seen, all budgets",
                         f"vision pinned to {rival.upper()}")  # fmt: skip
    yield Comparison("compiler", "adaptive.gain", "value of a schedule that decides as it goes",
                     "the best that is fixed before", "more")  # fmt: skip


def _monitor() -> Iterator[Comparison]:
    text = "value kept over 16 kinds of mission, computed"
    yield Comparison("monitor", "loss.vs_paper", text, "the rule of [ZR93]")
    yield Comparison("monitor", "loss.vs_fixed", text, "the best fixed contract")
    for kind, told in _VALUES.items():
        yield Comparison("monitor", f"world.margin_fixed.{kind}",
                         f"value of missions in the simulated world, {told}",
                         "the best fixed division", "margin")  # fmt: skip
    yield Comparison("monitor", "traces.vs_fixed", "loss of stopping on recorded traces",
                     "the best fixed contract", "share")  # fmt: skip
    yield Comparison("monitor", "decision.vs_numpy", "time of a decision, a look-up",
                     "numpy's argmax of the paper's rule")  # fmt: skip


def _mission() -> Iterator[Comparison]:
    text = "value of the office mission"
    yield Comparison("mission", "value.margin", text, "the better of MIN and MAX", "margin")
    yield Comparison("mission", "value.margin_fixed", text, "the raced fixed division", "margin")
    yield Comparison("mission", "gap.hindsight", text, "hindsight, which knows the noise", "gap")


def _query() -> Iterator[Comparison]:
    text = "evaluations a second of a NAO's plans"
    yield Comparison("query", "vs_cpp.nao", text, "C++, same operators by hand")
    yield Comparison("query", "vs_cpp_tags.nao", text, "C++, choices by name")
    yield Comparison("query", "vs_plain.nao", text, "the same model in plain Python")
    yield Comparison("query", "vs_optuna.nao", text, "Optuna's random search")
    yield Comparison("query", "vs_best_peer.nao", "time to a good plan",
                     "the fastest of the packages")  # fmt: skip
    yield Comparison("query", "moving_peaks.vs_best_peer", "error on the moving peaks",
                     "the best of three published optimisers")  # fmt: skip


def _nao() -> Iterator[Comparison]:
    text = "goals reached in random worlds"
    yield Comparison("nao", "worlds.vs_unmonitored", text, "the first good plan, not monitored")
    yield Comparison("nao", "worlds.vs_noiseless", text, "that plan, by a robot that never errs")


def _faults() -> Iterator[Comparison]:
    yield Comparison("faults", "return_bound.kept",
                     "isolated modules that misbehave: control is back in time",
                     "always, the contract + 250 ms")  # fmt: skip
    yield Comparison("faults", "connected.reached",
                     "floors crossed, planners return rubbish three times in ten",
                     "always, where there is a way")  # fmt: skip
    yield Comparison("faults", "halt.within_1_s", "robots that stand when their link fails",
                     "always, within 1 s")  # fmt: skip


def _deadline() -> Iterator[Comparison]:
    for load, told in _LOADS.items():
        yield Comparison("deadline", f"{load}.vs_floor",
                         f"return from a contract of 50 ms, p99, {told}",
                         "an empty loop beside it")  # fmt: skip


def _campaign() -> Iterator[Comparison]:
    yield Comparison("campaign", "overhead.vs_plain", "time of a run whose outcome is kept",
                     "one that is not")  # fmt: skip
    yield Comparison("campaign", "coverage.vs_fixed_intervals",
                     "coverage of the bound by which a campaign stops",
                     "intervals for a fixed number")  # fmt: skip
    yield Comparison("campaign", "calibrated.vs_uncalibrated",
                     "error of promises on another machine", "not calibrated")  # fmt: skip


COMPARISONS = (
    *_planner(),
    *_compiler(),
    *_monitor(),
    *_mission(),
    *_query(),
    *_nao(),
    *_faults(),
    *_deadline(),
    *_campaign(),
)
BENCHMARKS = tuple(dict.fromkeys(each.benchmark for each in COMPARISONS))
