"""The benchmark of the monitor: its kinds of mission, its traces, its command."""

from __future__ import annotations

import json

import numpy as np
import pytest

from anytime.__main__ import main
from anytime.errors import AnytimeError
from experiments.benchmarks.monitor import decision_times
from experiments.benchmarks.monitor_kinds import LENGTHS, kinds
from experiments.benchmarks.monitor_traces import cross_validate, read_traces
from monitor.decision_table import solve
from monitor.stopping_regressions import forecast


def write_traces(path, count=20, length=16):
    rng = np.random.default_rng(0)
    pace = rng.uniform(2, 5, count)[:, None]
    quality = 1 - np.exp(-np.arange(length) / pace)
    instances = {
        f"instance-{index}": {
            "qualities": row[: length - index % 3].tolist(),
            "estimated_qualities": (0.9 * row)[: length - index % 3].tolist(),
        }
        for index, row in enumerate(quality)
    }
    path.write_text(json.dumps(instances))
    return path


def test_sixteen_kinds_have_the_constants_that_they_are_known_by():
    found = kinds()
    assert len(found) == 16
    for process in found.values():
        assert process.value[0] == pytest.approx(100.0)
        assert process.frames == 8
        assert max(process.lengths) == LENGTHS[1] == 80
        assert process.energy[3] == pytest.approx(0.015 * 16)
    high = found["high", "fast", "hard"]
    assert high.pace[9] == pytest.approx(9.25)  # .25 × .4 + .5 × 1 + .25 × 1.3 of ten cells


def test_shorter_traces_are_held_at_their_last_value(tmp_path):
    traces = read_traces(write_traces(tmp_path / "made-up.json"))
    assert traces.runs.quality.shape == traces.runs.seen.shape
    assert (np.diff(traces.runs.quality, axis=1) >= 0).all()
    utility = traces.task.utility(traces.runs.quality[:, 0], traces.runs.seconds[0])
    assert np.allclose(utility, 100 * traces.runs.quality[:, 0] - 1)


@pytest.mark.parametrize(
    "text", ["{", "{}", "[]", '{"a": 1}', '{"a": {"qualities": [1], "estimated_qualities": []}}']
)
def test_what_is_no_trace_is_refused_in_one_line(tmp_path, text):
    path = tmp_path / "broken.json"
    path.write_text(text)
    with pytest.raises(AnytimeError, match="no traces; it must map"):
        read_traces(path)


def test_chosen_rule_is_judged_on_runs_that_it_was_not_chosen_by(tmp_path):
    traces = read_traces(write_traces(tmp_path / "made-up.json"))
    found = cross_validate(traces, 0, {"forecast": forecast})
    assert len(found.chosen) == 10
    assert set(found.losses) == {"fixed", "forecast", "chosen"}
    assert all(losses.shape == (20,) and (losses >= 0).all() for losses in found.losses.values())


def test_times_of_a_decision_are_all_there():
    table = solve(kinds()["low", "fast", "hard"])
    figures = decision_times(table, np.random.default_rng(0), decisions=500)
    bounds = {"decision.vs_numpy_low", "decision.vs_numpy_high"}
    assert set(figures) == {"decision.median_us", "decision.p99_us", "decision.vs_numpy", *bounds}
    assert figures["decision.vs_numpy"] > 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench", "compiler", "--traces", "."], "--traces is for bench monitor"),
        (["bench", "monitor", "--traces", "nowhere"], "no such folder"),
    ],
)
def test_wrong_traces_are_refused_in_one_line(arguments, message, capsys):
    assert main(arguments) == 2
    assert message in capsys.readouterr().err
