"""The task of a finished evaluation and the maps shown in it, computed from its summary."""

from __future__ import annotations

import numpy as np
import pytest
from made_results import make_result

from mazebench.errors import InputError
from mazebench.evaluation.evaluate import evaluate
from mazebench.report.episodes import read_results
from mazebench.results.played import played_task, shown_of
from mazebench.results.reading import load_result
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.task import Task
from mazebench.tasks.trials import frozen_trials, select_trials

ROOM = "#####\n#...#\n#...#\n#...#\n#####\n"


@pytest.mark.parametrize("level", [{"map_flip": 0.2}, {"map_warp": 0.2}], ids=["flip", "warp"])
def test_the_map_is_the_one_that_the_agent_was_shown(tmp_path, level):
    task = played_task(load_result(make_result(tmp_path / "made", task="hierarchical", **level)).summary)
    spec = Task.of("hierarchical", size=13, split="eval", **level)
    num_changed = 0
    for trial in frozen_trials("hierarchical", 13)[:5]:
        found, shown = shown_of(task, trial.episode), show_map(spec, trial.episode)
        np.testing.assert_array_equal(found.walls > 0, shown.seen_walls)
        assert found.are_cells == ("map_flip" in level)
        assert (found.start, found.goal) == tuple(
            shown.seen_cell(cell) @ np.array((13, 1)) for cell in ((1, 11), (11, 1))
        )
        assert len(found.landmarks) > 2
        num_changed += ((found.walls > 0) != spec.mazes[trial.episode.maze].walls).sum()
    assert num_changed > 25


@pytest.mark.parametrize(("track", "level"), [("rebuilt", 1), ("adrift", 2), ("rough", 3)])
def test_on_a_track_it_is_what_the_agent_was_given(tmp_path, track, level):
    task = played_task(load_result(make_result(tmp_path / "made", task=track, level=level, num_mazes=1)).summary)
    spec = Task.of(track, split="eval", level=level)
    for trial in select_trials(spec, 1)[:2]:
        found = shown_of(task, trial.episode)
        context = leg_context(spec, show_map(spec, trial.episode), trial.episode.start, trial.episode.goal)
        np.testing.assert_array_equal(
            found.walls * (1 if track == "rough" else 255), np.rint(context[GLOBAL_MAP] * 255)
        )
        assert found.are_cells == (track != "rough")
        assert found.goal == context[GOAL].argmax()
        assert found.start == (-1 if level > 1 else context[START].argmax())


def test_of_maps_that_are_gone_a_report_has_no_paths(tmp_path, remarks):
    (tmp_path / "room.txt").write_text(ROOM)
    options = {"distances": (2,), "episodes_per_distance": 1, "record": True}
    evaluate("random", out=tmp_path / "out", mazes=tmp_path / "room.txt", **options)
    [result] = read_results([tmp_path / "out"])
    assert result.trajectories
    assert result.walls["room"].sum() == 16
    (tmp_path / "room.txt").write_text(ROOM.replace("#...#", "#.#.#", 1))
    with pytest.raises(InputError, match="expected the mazes that were played, found others"):
        played_task(load_result(tmp_path / "out").summary)
    remarks()
    [result] = read_results([tmp_path / "out"])
    assert (result.trajectories, result.walls) == (None, {})
    assert [line.partition("expected")[2] for line in remarks()] == [
        " the mazes that were played, found others; reported without mazes and paths"
    ]
