"""The looks of agents in figures: names that fit and differ, colours, markers and dashes, legends."""

from __future__ import annotations

import pytest
from made_results import edit_summary, make_result, of_own_mazes
from matplotlib.image import imread

from mazebench.maps import colors
from mazebench.report.figures.curves import draw_curves
from mazebench.report.figures.style import WIDTH, finish, new_figure
from mazebench.report.figures.trajectories import draw_gallery
from mazebench.report.galleries import build_galleries
from mazebench.report.looks import PAPER_MARKERS, agent_looks, shorten, wrap
from mazebench.report.results import read_results
from mazebench.report.tables import build_tables
from mazebench.results.paper import reference

LONG = [f"mylab.navigation.experiments.variant_{number}.agents:PlannerWithRecurrentMemory" for number in range(9)]
TWELVE = ["mmn", "planner", "random", *LONG]


class TestNames:
    @pytest.mark.parametrize(
        ("text", "lines"),
        [
            ("mylab.agents.planners:Planner", ["mylab.agents.", "planners:Planner"]),
            ("agents:PlannerWithoutMemory", ["agents:Planner", "WithoutMemory"]),
            ("local, 13 × 13, map flip 0.05", ["local, 13 × 13,", "map flip 0.05"]),
            ("abcdefghijklmnopqrstuvwxyz", ["abcdefghijklmnop", "qrstuvwxyz"]),
            ("mmn", ["mmn"]),
        ],
    )
    def test_lines_end_where_words_do(self, text, lines):
        assert wrap(text, 16).split("\n") == lines

    def test_only_very_long_names_lose_their_middle_and_stay_apart(self):
        names = shorten([*LONG, "x" * 500, "x" * 400])
        assert names[:-2] == LONG
        assert names[-2:] == [f"{'x' * 60}…{'x' * 60} (1)", f"{'x' * 60}…{'x' * 60} (2)"]


class TestLooks:
    def test_no_two_of_forty_agents_look_alike(self):
        looks = agent_looks([f"agent {number}" for number in range(40)]).values()
        assert len({(look.color, look.marker, look.dashes) for look in looks}) == 40

    def test_up_to_twelve_agents_have_markers_of_their_own(self):
        assert len({look.marker for look in agent_looks(TWELVE).values()}) == 12

    def test_what_the_paper_printed_looks_like_no_agent_and_not_alike(self, tmp_path):
        labels = ["mmn", "mah", "dqn", "random"]
        for agent in labels:
            make_result(tmp_path / agent, agent, "hierarchical", num_mazes=1, record=False)
        table = build_tables(read_results([tmp_path], print), labels)[0]
        axes = new_figure(WIDTH, 2.0).add_subplot()
        draw_curves(axes, table, "spl_grid", agent_looks(labels))
        assert [column.label for column in table.columns] == [*labels, *PAPER_MARKERS]
        curves = [line for line in axes.lines if line.get_marker() not in ("None", "|", "_")]
        looks = {(line.get_color(), line.get_marker()) for line in curves}
        assert len(looks) == 8
        assert not {color for color, marker in looks if marker in PAPER_MARKERS.values()} & {
            color for color, marker in looks if marker not in PAPER_MARKERS.values()
        }

    def test_all_agents_of_the_paper_have_a_marker(self):
        printed = {f"{agent} (paper)" for table in reference()["tables"] for agent in table["agents"]}
        assert printed == set(PAPER_MARKERS)
        assert len(set(PAPER_MARKERS.values())) == len(PAPER_MARKERS)


class TestLegends:
    def test_it_stands_below_the_axes_within_the_figure_with_every_name_once(self, tmp_path):
        figure = new_figure(WIDTH, 2.0)
        axes = figure.add_subplot()
        for look in agent_looks(TWELVE).values():
            axes.plot([0, 1], [0, 1], label=wrap(look.name, 40))
        finish(figure, "A title", tmp_path / "figure")
        [legend] = figure.legends
        names = [text.get_text().replace("\n", "") for text in legend.get_texts()]
        assert names == TWELVE
        box = legend.get_window_extent()
        assert box.x0 >= 0
        assert box.x1 <= figure.bbox.x1
        assert 0 <= box.y0 < box.y1 <= axes.get_window_extent().y0
        assert axes.get_window_extent().height > 0.6 * 2.0 * figure.dpi  # the figure grows, the axes do not shrink


class TestCurves:
    def test_one_distance_has_intervals_and_agents_that_agree_stand_apart(self, tmp_path):
        for agent in ("mah", "mmn"):
            make_result(tmp_path / agent, agent, skill=1.0, num_mazes=5, distances=(4,), record=False)
        labels = ["mah", "mmn"]
        [table, _] = build_tables(read_results([tmp_path], print), labels)
        axes = new_figure(WIDTH, 2.0).add_subplot()
        draw_curves(axes, table, "success_rate", agent_looks(labels))
        bars = [container.lines[2][0].get_segments()[0] for container in axes.containers]
        (left, low), (_, high) = bars[0]
        assert (0.4 < low < 0.7, high, bars[1][0][0] - left) == (True, 1.0, pytest.approx(0.12))

    def test_the_star_of_an_untrained_scale_is_in_the_legend(self, tmp_path):
        folder = make_result(tmp_path / "mah", "mah", track="lost", num_mazes=2, record=False)
        edit_summary(folder, untrained_scale=True)
        table = next(t for t in build_tables(read_results([tmp_path], print), ["mah"]) if t.name == "track-lost")
        axes = new_figure(WIDTH, 2.0).add_subplot()
        draw_curves(axes, table, "success_rate", agent_looks(["mah"]))
        assert "never trained on maps of this scale" in axes.get_legend_handles_labels()[1]


class TestTrajectories:
    def test_every_agent_has_a_row(self, tmp_path):
        for number, agent in enumerate(TWELVE):
            make_result(tmp_path / str(number), agent, num_mazes=2)
        results = read_results([tmp_path], print)
        labels = sorted(result.label for result in results)
        first, second = build_galleries(results, labels)  # of at most eight agents
        assert [label for gallery in (first, second) for label, _ in gallery.drives] == labels
        assert (second.name, second.title[-8:]) == (f"{first.name}-part-2", "(2 of 2)")
        assert [drive.maze for drive in first.drives[0][1]] == [drive.maze for drive in second.drives[0][1]]

    def test_own_maps_have_a_figure_with_the_farthest_of_several_episodes_in_one_maze(self, tmp_path):
        for name in ("den", "office"):
            of_own_mazes(make_result(tmp_path / name, "mah", num_mazes=1, episodes_per_distance=3), name)
        results = read_results([tmp_path], print)
        den, office = build_galleries(results, ["mah"])
        assert (den.name, office.name) == ("trajectories-custom-1-local-13", "trajectories-custom-2-local-13")
        [(_, drives)] = office.drives
        assert [drive.maze for drive in drives] == ["office-00"] * 5
        episodes = results[1].episodes
        farthest = {tuple(start) for start in episodes.start[episodes.distance == 4].tolist()}
        assert farthest <= {drive.start for drive in drives}

    def test_the_goal_has_the_colour_of_the_world(self, tmp_path):
        make_result(tmp_path / "mah", "mah", num_mazes=1)
        results = read_results([tmp_path], print)
        [gallery] = build_galleries(results, ["mah"])
        draw_gallery(gallery, agent_looks(["mah"]), tmp_path / "figure")
        pixels = imread(tmp_path / "figure.png")[..., :3]
        for color in (colors.START, colors.GOAL):
            assert (abs(pixels - color).max(axis=-1) < 0.01).sum() > 50
