"""Comparisons of results, with numbers done by hand; test_results_intervals.py has the intervals."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from made_results import PROVENANCE, edit_records, edit_task, make_record, make_result

from mazebench.errors import InputError
from mazebench.results.comparison import Comparison, compare_folders, compare_results, to_json
from mazebench.results.intervals import difference_interval
from mazebench.results.metrics import summarize
from mazebench.results.reading import Result
from mazebench.results.records import Provenance, Record, Summary
from mazebench.tasks.task import Task


def record(index: int, maze: str, distance: int, success: bool, spl: float) -> Record:
    values = {"maze": maze, "distance": distance, "success": success, "spl": spl, "spl_grid": min(1.0, 1.2 * spl)}
    return make_record(index, **values)


def result(folder, records: list[Record], **changes) -> Result:
    provenance = PROVENANCE | {"benchmark_manifest_sha256": changes.pop("manifest", "0f")}
    content = {
        "agent": "x",
        "privileged": False,
        "task": Task.of(changes.pop("task", "local"), split="eval").options,
        "benchmark": "paper",
        "episodes": len(records),
        "provenance": Provenance.model_validate(provenance),
        **summarize(records),
    }
    return Result(folder, Summary.model_validate(content | changes), tuple(records))


class TestResults:
    def test_comparison_when_worked_by_hand(self, tmp_path):
        ours = [record(0, "a", 2, True, 0.8), record(1, "a", 10, True, 0.5), record(2, "b", 10, False, 0.0)]
        theirs = [record(0, "a", 2, True, 0.8), record(1, "a", 10, False, 0.0), record(2, "b", 10, False, 0.0)]
        found = compare_results(result(tmp_path, ours), result(tmp_path, theirs))
        assert list(found.by_distance) == [2, 10]
        row = found.overall
        assert row.num_episodes == 3
        success = row.metrics["success_rate"]
        assert (success.a, success.b) == pytest.approx((2 / 3, 1 / 3))
        assert success.difference == difference_interval(np.array([0.0, 1.0, 0.0]), np.array(["a", "a", "b"]))
        assert row.metrics["spl"].difference.value == pytest.approx(0.5 / 3)
        assert row.metrics["spl_grid"].difference.value == pytest.approx(0.6 / 3)
        assert row.win_share.value == pytest.approx(2 / 3)  # a win and two ties
        assert found.by_distance[10].metrics["success_rate"].difference.value == 0.5

    def test_win_share_when_worked_by_hand(self, tmp_path):
        # A win, a tie, a loss and a tie.
        ours, theirs = (
            [
                record(index, maze, 2, score > 0, score)
                for index, (maze, score) in enumerate(zip("aabb", scores, strict=True))
            ]
            for scores in ((0.9, 0.0, 0.2, 1.0), (0.8, 0.0, 0.3, 1.0))
        )
        row = compare_results(result(tmp_path, ours), result(tmp_path, theirs)).overall
        assert row.win_share.value == 0.5
        # A win and a loss in two mazes tell nothing of others.
        assert (row.win_share.low, row.win_share.high) == (0, 1)
        assert row.metrics["spl"].difference.value == pytest.approx(0)

    def test_comparison_when_written_as_json(self, tmp_path):
        records = [record(0, "a", 2, True, 0.8), record(1, "b", 10, False, 0.0)]
        found = compare_results(result(tmp_path, records), result(tmp_path, records))
        single = to_json(Comparison("", {"": found}, True, []))
        assert to_json(Comparison("", {"near": found}, True, [])) == {"near": single}
        assert list(single["by_distance"]) == ["2", "10"]
        keys = {"n", "win_share", "win_share_ci95"}
        for metric in ("success_rate", "spl", "spl_grid", "on_time_1.25", "on_time_2"):
            keys |= {f"{metric}_{end}" for end in ("a", "b", "difference", "difference_ci95")}
        for row in (single["overall"], *single["by_distance"].values()):
            assert set(row) == keys
        low, high = single["overall"]["success_rate_difference_ci95"]
        assert -1 <= low < 0 < high <= 1

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"task": "building"}, "expected results of one benchmark to compare, found paper in .* and tracks in"),
            ({"manifest": "1e"}, "results of one benchmark_manifest_sha256 to compare, found 0f in .* and 1e in"),
            ({"task": "hierarchical"}, "results of one task to compare, found local in .* and hierarchical in"),
        ],
    )
    def test_comparison_when_results_do_not_pair(self, tmp_path, changes, said):
        records = [record(0, "a", 2, True, 0.8)]
        with pytest.raises(InputError, match=said):
            compare_results(result(tmp_path / "a", records), result(tmp_path / "b", records, **changes))

    def test_comparison_when_episodes_differ(self, tmp_path):
        records = [record(0, "a", 2, True, 0.8), record(1, "a", 2, True, 0.8)]
        others = [records[0], records[1].model_copy(update={"seed": 7})]
        with pytest.raises(InputError, match=r"same episodes in .*, found episode 1 with seed 1 and 7$"):
            compare_results(result(tmp_path, records), result(tmp_path, others))
        with pytest.raises(InputError, match=r"found 2 and 1 of them$"):
            compare_results(result(tmp_path, records), result(tmp_path, records[:1]))

    def test_two_levels_of_a_track_are_compared_on_the_same_pairs(self, tmp_path):
        for level in (1, 2):
            make_result(tmp_path / str(level), "mah", task="adrift", level=level, num_mazes=2, record=False)
        found = compare_folders(tmp_path / "1", tmp_path / "2")
        assert found.title == (
            f"A is mah (track adrift, level 1) in {tmp_path / '1'}, "
            f"B is mah (track adrift, level 2) in {tmp_path / '2'}; adrift 1, eval mazes 31 x 31"
        )
        assert found.parts[""].overall.num_episodes == 10

    def test_the_title_says_what_an_agent_was_told_less_or_more(self, tmp_path):
        told = {"shown": {}, "hidden": {"hide": ["map", "goal"]}, "exact": {"exact_pose": True}}
        told["seeing"] = {"sensors": ["lidar", "egocentric"], "look": "varied", "camera_fov": 170.0}
        for name, changes in told.items():
            make_result(tmp_path / name, "navigator", task="adrift", num_mazes=2, record=False)
            edit_task(tmp_path / name, **changes)
        for name, who in (
            ("hidden", "navigator without map and goal"),
            ("exact", "navigator with the true pose"),
            ("seeing", r"navigator with lidar, egocentric (fov 170, look varied)"),
        ):
            title = compare_folders(tmp_path / "shown", tmp_path / name).title
            assert title.startswith("A is navigator (track adrift, level 1) in ")
            assert f"B is {who} (track adrift, level 1) in {tmp_path / name}; " in title


class TestPrinted:
    """What `mazebench compare` prints."""

    def written(self, folder, agent="navigator", level=1, blocked=lambda record: record["episode"] % 4 == 0, **changes):
        make_result(folder, agent, task="rebuilt", num_mazes=12, record=False, skill=0.9, level=level)
        edit_records(folder, lambda record: record | {"blocked": blocked(record)})
        return edit_task(folder, **changes) if changes else folder

    def rows(self, output):
        lines = output.splitlines()
        first = next(number for number, line in enumerate(lines) if set(line) == {"─"})
        return [line.split("  ")[0].split(" 0.")[0].split(" 1.")[0].strip() for line in lines[first + 1 :]]

    def test_the_total_comes_first_then_blocked_then_bins_with_enough_episodes(self, command, tmp_path):
        a, b = self.written(tmp_path / "a"), self.written(tmp_path / "b", "random")
        status, output, _ = command("compare", a, b)
        assert status == 0
        total, *others = self.rows(output)
        assert (total, others[:2]) == ("all", ["blocked", "not blocked"])
        records = [json.loads(line) for line in (a / "episodes.jsonl").read_text().splitlines()]
        reached = 14
        for name in others[2:]:
            low, high = re.fullmatch(r"(\d+)-(\d+) m", name).groups()
            assert int(low) > reached
            reached = int(high)
            assert sum(int(low) <= record["distance"] <= reached for record in records) >= 20
        assert reached == max(record["distance"] for record in records)
        assert "map worth" not in output

    def test_few_episodes_are_not_split_by_distance(self, tmp_path):
        records = [record(index, "a", 2 + index, True, 0.8) for index in range(39)]
        found = compare_results(result(tmp_path, records), result(tmp_path, records))
        assert found.by_bin == {}
        assert len(found.by_distance) == 39

    def test_distances_with_enough_episodes_have_rows_of_their_own(self, tmp_path):
        records = [record(index, "a", 2 + index // 25, True, 0.8) for index in range(60)]
        found = compare_results(result(tmp_path, records), result(tmp_path, records))
        assert {name: row.num_episodes for name, row in found.by_bin.items()} == {"2 cells": 25, "3-4 cells": 35}

    def test_a_map_worth_is_named(self, command, tmp_path):
        shown, hidden = self.written(tmp_path / "a"), self.written(tmp_path / "b", hide=["map"])
        for folders, sign in (((shown, hidden), "A - B"), ((hidden, shown), "B - A")):
            assert f"{sign}, on time: the map worth of navigator\n" in command("compare", *folders)[1]
        without_goal = self.written(tmp_path / "c", hide=["map", "goal"])
        assert "map worth" not in command("compare", shown, without_goal)[1]
