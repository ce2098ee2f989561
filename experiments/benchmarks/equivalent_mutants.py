"""Changes of the program that change nothing that can be seen, each with the reason why.

By module, then by the line and the change. A test looks whether each is still there.
"""

from __future__ import annotations

_WORK = "how much work is done at most, not what is right"
_PIECES = "in how many pieces it is computed, not what comes of it"
_TIE = "differs only where two real numbers are the same, and then either is right"
_BELOW = "any number below 0 stands for no result"

EQUIVALENT: dict[str, dict[tuple[str, str], str]] = {
    "compiler.division": {
        (
            "ALL = 1_000_000  # divisions that are weighed at once, at most",
            "1000000 → 1000001",
        ): _WORK,
        ("SWEEPS = 4  # of pairwise exchange at each budget, at most", "4 → 5"): _WORK,
        (
            "BUDGETS = 24  # at which programs of more divisions are searched",
            "24 → 25",
        ): _WORK,
        ("if cells <= ALL:", "LtE → Lt"): _WORK,
        (
            "shares, exact = np.zeros((1, len(tables))), True",
            "1 → 2",
        ): "only its first row is looked up",
        (
            "if values[top] > value:",
            "Gt → GtE",
        ): "a division worth the same is as good to go on from",
        ("kept = values > 1e-9", "Gt → GtE"): _TIE,
        ("return order[ordered > before + 1e-9]", "Gt → GtE"): _TIE,
        ("late = ends > rule.deadlines[place] + INSTANT", "Gt → GtE"): _TIE,
        (
            "inside = np.flatnonzero(totals <= budget)",
            "LtE → Lt",
        ): _TIE,
    },
    "compiler.elimination": {
        (
            "PIECE = 1 << 15  # cells of a bucket that are joined at once, so that they stay in "
            "the cache",
            "1 → 2",
        ): _PIECES,
        (
            "PIECE = 1 << 15  # cells of a bucket that are joined at once, so that they stay in "
            "the cache",
            "15 → 16",
        ): _PIECES,
        ("if cells <= 2 * PIECE or len(shape) == 1:", "LtE → Lt"): _PIECES,
        ("if cells <= 2 * PIECE or len(shape) == 1:", "Mult → Div"): _PIECES,
        ("if cells <= 2 * PIECE or len(shape) == 1:", "2 → 3"): _PIECES,
        ("if cells <= 2 * PIECE or len(shape) == 1:", "Eq → NotEq"): _PIECES,
        ("if cells > PIECE * second:", "Gt → GtE"): _PIECES,
        ("if cells > PIECE * second:", "Mult → Div"): _PIECES,
        ("width = PIECE * second // cells", "FloorDiv → Mult"): _PIECES,
        (
            "count = max((len(each) for each in levels.values()), default=1)",
            "max → min",
        ): "all are of one length",
    },
    "anytime.distributions": {
        (
            "return float(self.weights[np.nan_to_num(self.values, nan=-1.0) >= quality].sum())",
            "1.0 → 2.0",
        ): _BELOW,
        (
            'order = np.argsort(np.nan_to_num(self.values, nan=-1.0), kind="stable")',
            "1.0 → 2.0",
        ): _BELOW,
    },
    "anytime.profiles": {
        (
            "by_problem[run.problem] = by_problem.get(run.problem, 0.0) + weight",
            "Add → Sub",
        ): "the sums are squared",
        (
            "ends = np.array([here.band(times * each, confidence, resamples) for each in speeds])",
            "Mult → Div",
        ): "the speeds are a number, its inverse and 1",
        (
            "quality = np.where(run.raw > 0, reference / run.raw, 1.0)",
            "1.0 → 2.0",
        ): "a quality above 1 is cut to 1",
        (
            "return self.weights_given((), np.zeros((1, 0)))[0]",
            "1 → 2",
        ): "two rows alike, of which the first is taken",
        (
            "padded = [[*places, *[-1] * (most - len(places))] for places in members.values()]",
            "1 → 2",
        ): "any number below 0 says that there is no run",
        ("if len(every) <= 512:", "LtE → Lt"): "of 512 moments 512 are taken either way",
        (
            "self, seconds: ArrayLike, confidence: float = 0.95, resamples: int = 400",
            "400 → 401",
        ): _WORK,
        ("draws = np.random.default_rng(0).multinomial(", "0 → 1"): "another draw of the same",
        (
            "spread = sampled.std(axis=0) + 1e-9",
            "Add → Sub",
        ): "either keeps nothing from being divided by nothing",
        ("times = np.linspace(0, self._horizon(), 16)", "16 → 17"): "how finely it is drawn",
        ("times = np.linspace(0, self._horizon(), 80)", "80 → 81"): "how finely it is drawn",
        ('falls = f" then {number(end)}" if best - end > FALLS else ""', "Gt → GtE"): _TIE,
    },
    "monitor.inter_frame": {
        (
            "rises = np.diff(np.maximum.accumulate(gained), prepend=0.0) > 1e-9",
            "Gt → GtE",
        ): _TIE,
        (
            "plain = _value_and_cost(mission, state, seconds, energy, np.ones(1))",
            "1 → 2",
        ): "the mean over two ratios of one is that of one",
    },
    "monitor.stopping": {
        (
            "good = (name for name in learners if errors_apart(losses[name], best) <= 1.0)",
            "LtE → Lt",
        ): _TIE,
        (
            'better = (name for name in good if errors_apart(losses["fixed"], losses[name]) '
            ">= 1.0)",
            "GtE → Gt",
        ): _TIE,
    },
}
