"""SPL and summaries by hand; test_results_intervals.py has the intervals."""

from __future__ import annotations

import numpy as np
import pytest
from made_results import make_record

from mazebench.results.intervals import mean_interval
from mazebench.results.metrics import is_on_time, spl, summarize


def record(index=0, distance=1, maze="m", success=True, spl=1.0, spl_grid=1.0):
    return make_record(index, maze=maze, distance=distance, success=success, spl=spl, spl_grid=spl_grid)


class TestSpl:
    @pytest.mark.parametrize(
        ("success", "shortest", "driven", "expected"),
        [
            (True, 2.5, 2.8, 2.5 / 2.8),  # the worked example of docs/metrics.md
            (True, 3.0, 2.8, 1.0),  # driven less than l, as spl_grid allows
            (True, 2.0, 4.0, 0.5),
            (False, 2.0, 2.0, 0.0),
            (True, 0.0, 0.0, 1.0),
            (True, 0.0, 1.0, 1.0),  # nothing was to be driven
        ],
    )
    def test_spl_when_worked_by_hand(self, success, shortest, driven, expected):
        found = spl(np.array([success]), np.array([shortest]), np.array([driven]))
        assert found == pytest.approx([expected], abs=1e-15)


RECORDS = [
    record(0, 10, "a", True, 0.5, 1.0),
    record(1, 2, "a", True, 0.8, 1.0),
    record(2, 2, "b", False, 0.0, 0.0),
    record(3, 2, "b", True, 0.6, 0.7),
]


def test_figures_worked_by_hand():
    overall, by_distance, _ = summarize(RECORDS).values()
    assert list(by_distance) == ["2", "10"]  # by number, not by text
    assert (overall.n, overall.success_rate) == (4, 0.75)
    assert overall.spl == pytest.approx(1.9 / 4)
    assert overall.spl_grid == pytest.approx(2.7 / 4)
    two = by_distance["2"]
    assert (two.n, two.success_rate, two.spl) == (3, pytest.approx(2 / 3), pytest.approx(1.4 / 3))
    both = mean_interval(np.array([0.5, 0.8, 0.0, 0.6]), np.array(["a", "a", "b", "b"]))
    assert overall.spl_ci95 == (both.low, both.high)
    one = mean_interval(np.ones(1), np.array(["a"]))
    assert by_distance["10"].success_rate_ci95 == (one.low, one.high)


class TestOnTime:
    def test_on_time_worked_by_hand(self):
        # Five successes in 10 steps, then a failure.
        oracle_steps = (8, 7, 5, 4, None, 10)  # 10 is 1.25 x 8 and 2 x 5; the oracle missed the fifth goal
        records = [
            make_record(index, steps=10, success=index < 5, oracle_steps=steps)
            for index, steps in enumerate(oracle_steps)
        ]
        assert is_on_time(records, 1.25).tolist() == [True, False, False, False, True, False]
        assert is_on_time(records, 2).tolist() == [True, True, True, False, True, False]

    def test_figures_tell_it_by_factor(self):
        records = [*RECORDS[:3], RECORDS[3].model_copy(update={"oracle_steps": 2})]  # the others have 4
        overall, by_distance, _ = summarize(records).values()  # of records of 5 steps, the third a failure
        assert overall.on_time == {"1.25": 0.5, "2": 0.5}
        assert by_distance["10"].on_time == {"1.25": 1.0, "2": 1.0}
        assert by_distance["2"].on_time == {"1.25": pytest.approx(1 / 3), "2": pytest.approx(1 / 3)}
        both = mean_interval(np.array([1.0, 1.0, 0.0, 0.0]), np.array(["a", "a", "b", "b"]))
        assert overall.on_time_ci95["2"] == (both.low, both.high)
