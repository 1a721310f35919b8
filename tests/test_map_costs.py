"""What an old map costs, by hand and against a bootstrap, and what follows from it."""

from __future__ import annotations

import numpy as np
import pytest
from made_results import make_record

from mazebench.results.intervals import Estimate, difference_interval
from mazebench.results.map_costs import ANEW, KEEP, NO_VERDICT, OPEN, REDRAW, TOO_FEW, Answer, Cost, answer

SPEED = 2.0  # m/s


def records(metres, steps, maze="a", missed=()):
    pairs = enumerate(zip(metres, steps, strict=True))
    values = {"maze": maze, "distance": 20}
    return [make_record(i, path_length=m, steps=s, success=i not in missed, **values) for i, (m, s) in pairs]


def estimated(low, value, high):
    return Cost(Estimate(value, low, high), Estimate(value, low, high), tenth=3.0, num_arrived=48)


class TestAnswer:
    def test_when_worked_by_hand(self):
        right = records([20, 10, 30, 20], [50, 25, 100, 50])
        old = records([21, 10, 36, 21], [75, 25, 125, 50])
        none = records([29, 20, 40, 31], [100, 50, 200, 100], missed=[3])
        found = answer(old, right, none, SPEED)
        assert (found.num_trips, found.metres, found.num_arrived) == (4, 20, 4)
        assert found.old.metres.value == pytest.approx((1 + 0 + 6 + 1) / 4)
        assert found.old.seconds.value == pytest.approx(0.16 * (25 + 25) / 4)
        assert found.old.tenth == pytest.approx(1 + 0.7 * 5)  # between the third and the fourth of 0, 1, 1, 6
        assert found.old.num_arrived == 4
        # The last trip without a map drives 2 m/s for 100 steps of .16 s.
        assert found.none.metres.value == pytest.approx((9 + 10 + 10 + (32 - 20)) / 4)
        assert found.none.num_arrived == 3

    def test_the_first_line_says_it_in_words(self):
        cost, worse = estimated(0.2, 0.84, 1.6), estimated(5.52, 9.2, 14.4)
        assert Answer(48, 23.0, 48, cost, worse).sentence == (
            "With the old map this robot needs 0.8 m (0.8 s) more per trip than with the right one [0.2, 1.6]; "
            "one trip in ten needs 3 m or more; all 48 arrive. Without a map: 9.2 m (9.2 s) more [5.5, 14]."
        )
        sentence = Answer(50, 23.0, 49, cost, None).sentence
        assert sentence.endswith("48 of 50 arrive. With the right map, 49 of 50 arrive.")

    @pytest.mark.parametrize("mazes", [["a"] * 40, np.arange(40) // 4])
    def test_intervals_are_those_of_a_bootstrap_of_pairs(self, mazes):
        rng = np.random.default_rng(0)
        right, lost = (
            rng.uniform(15, 40, 40),
            rng.exponential(2, 40) + np.asarray(np.unique(mazes, return_inverse=True)[1]),
        )
        pairs = [
            [
                make_record(i, maze=str(maze), path_length=each, steps=60)
                for i, (maze, each) in enumerate(zip(mazes, driven, strict=True))
            ]
            for driven in (right + lost, right)
        ]
        found = answer(*pairs, None, SPEED).old.metres
        # Pairs are drawn, or whole buildings with their pairs, each 4 here.
        groups = lost.reshape(-1, 1 if len(set(mazes)) == 1 else 4)
        draws = groups[rng.integers(len(groups), size=(20_000, len(groups)))].mean(axis=(1, 2))
        low, high = np.quantile(draws, [0.025, 0.975]) - lost.mean()
        wider = (found.high - found.low) / (high - low)
        assert found.value == pytest.approx(lost.mean())
        assert 1.0 < wider < (1.1 if len(groups) == 40 else 1.3)  # as intervals of means of few values are
        assert found.low == pytest.approx(lost.mean() + wider * low, abs=0.1)
        assert found.high == pytest.approx(lost.mean() + wider * high, abs=0.1)

    def test_intervals_have_the_unit_of_the_differences(self):
        differences, mazes = np.array([0.5, -0.25, 0.0, 1.0]), np.arange(4)
        one, ten = difference_interval(differences, mazes), difference_interval(10 * differences, mazes, 10.0)
        assert (ten.value, ten.low, ten.high) == pytest.approx((10 * one.value, 10 * one.low, 10 * one.high))

    def test_equal_trips_cost_nothing_and_say_so(self):
        same = records([20.0] * 48, [50] * 48)
        found = answer(same, same, None, SPEED)
        assert found.old.metres.value == 0
        assert -0.1 < found.old.metres.low < 0 < found.old.metres.high < 0.1
        assert found.verdict == KEEP


class TestVerdict:
    # Of a trip of 20 m, 1 m is little and 5 m is much.
    @pytest.mark.parametrize(
        ("low", "high", "said"),
        [
            (-0.3, 0.9, KEEP),
            (0.2, 4.9, REDRAW),
            (2.0, 4.0, REDRAW),
            (5.0, 9.0, ANEW),
            (-0.5, 1.5, f"{TOO_FEW} to choose: {KEEP}, or {REDRAW}"),
            (3.0, 8.0, f"{TOO_FEW} to choose: {REDRAW}, or {ANEW}"),
            (-1.0, 8.0, f"{TOO_FEW} to choose: {KEEP}, or {REDRAW}, or {ANEW}"),
        ],
    )
    def test_it_follows_the_bounds_of_the_interval(self, low, high, said):
        assert Answer(48, 20.0, 48, estimated(low, 0.0, high), estimated(3, 5, 7)).verdict == said

    def test_a_robot_that_does_not_arrive_with_the_right_map_gets_none(self):
        assert Answer(50, 20.0, 45, estimated(5, 7, 9), None).verdict == ANEW
        assert Answer(50, 20.0, 44, estimated(5, 7, 9), None).verdict == NO_VERDICT

    def test_where_no_map_costs_little_the_building_is_open(self):
        little = estimated(-0.3, 0.1, 0.9)
        assert Answer(48, 20.0, 48, little, little).verdict == OPEN
        assert Answer(48, 20.0, 48, little, estimated(-0.3, 0.5, 1.1)).verdict == KEEP
        assert Answer(48, 20.0, 48, estimated(0.2, 2.0, 4.0), little).verdict == REDRAW
