"""Scenarios of MovingAI: starts and goals in a file, which evaluations and environments play."""

from __future__ import annotations

import pytest

import mazebench
from mazebench.errors import InputError
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.scenarios import read_scenarios
from mazebench.tasks.task import Task, resolve
from mazebench.tasks.trials import draw_trials

MAP = "type octile\nheight 3\nwidth 4\nmap\n...@\n.@..\n...@\n"
SCENARIOS = """version 1
0 maps/m.map 4 3 0 0 2 2 4.0
0 maps/m.map 4 3 2 0 2 1 1.0
0 maps/m.map 4 3 0 0 1 1 1.4
0 maps/m.map 4 3 1 0 1 0 0.0
0 maps/m.map 4 3 0 2 3 1 3.0
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "m.map").write_text(MAP)
    (tmp_path / "m.map.scen").write_text(SCENARIOS)
    return tmp_path / "m.map.scen"


class TestReading:
    def test_ends_are_cells_of_the_maze_with_its_own_distances(self, path, remarks):
        scenarios = read_scenarios(path, ReadOptions(cell_size=2.0))
        assert scenarios.maze.cell_size == 2
        assert scenarios.starts.tolist() == [[1, 1], [1, 3], [3, 1]]
        assert scenarios.goals.tolist() == [[3, 3], [2, 3], [2, 4]]
        assert scenarios.distances.tolist() == [4, 1, 4]
        assert remarks()[-1].endswith(
            "2 of 5 scenarios left out: an end is a wall or can't be reached, or both are one cell"
        )

    @pytest.mark.parametrize(
        ("before", "after", "said"),
        [
            ("version 1", "type octile", r"m\.map\.scen: expected scenarios of MovingAI, which begin with 'version 1'"),
            (" 4 3 2 0", " 8 6 2 0", r"expected scenarios of .*m\.map, 4 x 3 cells, found 8 x 6$"),
            ("maps/m.map 4 3 2", "maps/n.map 4 3 2", r"expected scenarios of one map, found maps/m\.map, maps/n\.map$"),
            (" 1.4", "", r"expected 9 fields in a line, found 8 in scenario 2$"),
            (" 4 3 2 0", f" 4 {10**30} 2 0", r"expected numbers from the third field on"),
            (" 4 3 2 0", " 4 x 2 0", r"expected numbers from the third field on, found invalid literal"),
            ("maps/m.map", "dao\\other.map", r"other\.map: can't read the text map: No such file or directory$"),
            (
                SCENARIOS[10:],
                "0 m.map 4 3 0 0 1 1 1.4",
                r"expected scenarios in m, found none whose ends can be reached$",
            ),
        ],
    )
    def test_what_is_wrong_is_said_in_one_line(self, path, before, after, said):
        path.write_text(SCENARIOS.replace(before, after))
        with pytest.raises(InputError, match=said):
            Task.of(mazes=path)

    @pytest.mark.parametrize("between", ["\t", "\t \t", " \t"])
    def test_a_maps_name_may_have_a_blank_between_tabs(self, path, between):
        path.with_name("m y.map").write_text(MAP)
        path.write_text(
            SCENARIOS.replace(" ", between).replace("m.map", "m y.map").replace("version" + between, "version ")
        )
        assert len(read_scenarios(path, ReadOptions()).distances) == 3


class TestPlaying:
    def test_an_evaluation_plays_each_scenario_once_in_the_order_of_the_file(self, path, tmp_path):
        summary = mazebench.evaluate("planner", mazes=path, out=tmp_path / "out")
        assert summary.episodes == 3
        assert summary.overall.success_rate == 1
        trials = draw_trials(resolve(summary.task))
        assert [(trial.episode.start, trial.episode.goal) for trial in trials] == [
            ((1, 1), (3, 3)),
            ((1, 3), (2, 3)),
            ((3, 1), (2, 4)),
        ]

    def test_distances_choose_scenarios_and_leave_their_episodes_as_they_are(self, path):
        task = Task.of(mazes=path)
        assert task.distances == (1, 4)
        near = Task.of(mazes=path, distances=[1])
        assert draw_trials(near) == draw_trials(task)[1:2]
        with pytest.raises(InputError, match=r"^m: expected distances that .* have, from 1 to 4 cells, found 2, 3$"):
            Task.of(mazes=path, distances=[2, 3])

    @pytest.mark.parametrize("kind", ["local", "hierarchical"])
    def test_environments_draw_scenarios(self, path, kind):
        env, envs = mazebench.load(kind, mazes=path), mazebench.make_vec(kind, 16, mazes=path)
        env.reset(seed=3)
        envs.reset(seed=0)
        assert env.task.episode == envs.episodes[3]
        scenarios = Task.of(mazes=path).scenarios
        drawn = {(episode.start, episode.goal) for episode in envs.episodes}
        assert drawn == {scenarios.ends(number) for number in range(3)}

    @pytest.mark.parametrize(
        ("option", "value"),
        [("start", (1, 1)), ("pairs", "fixed"), ("num_goals", 2), ("task", "building"), ("shown", "m.map")],
    )
    def test_options_that_choose_other_ends_are_refused(self, path, option, value):
        with pytest.raises(InputError, match=r"scenarios|num_goals 2|a start or a goal"):
            Task.of(mazes=path, **{option: value})

    def test_other_scenarios_of_the_map_are_another_evaluation(self, path, tmp_path):
        mazebench.evaluate("planner", mazes=path, out=tmp_path / "out")
        path.write_text(SCENARIOS.replace("0 2 3 1 3.0", "0 1 3 1 3.0"))
        with pytest.raises(InputError, match="another run"):
            mazebench.evaluate("planner", mazes=path, out=tmp_path / "out", resume=True)
