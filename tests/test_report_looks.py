"""The looks of agents in figures: names that fit and differ, colours, markers and dashes, legends."""

from __future__ import annotations

import pytest
from made_results import edit_summary, make_result, of_own_mazes
from matplotlib.image import imread

from mazebench.maps import colors
from mazebench.report.figures.describe import describe_distributions, describe_table
from mazebench.report.figures.draw import WIDTH, lay_out
from mazebench.report.figures.figure import Figure, Panel, Point, Series
from mazebench.report.figures.galleries import build_galleries
from mazebench.report.figures.trajectories import draw_gallery
from mazebench.report.frame import join_episodes
from mazebench.report.looks import PAPER_COLOR, PAPER_MARKERS, all_looks, shorten, wrap
from mazebench.report.results import read_results
from mazebench.report.tables import build_tables
from mazebench.results.paper import reference

LONG = [f"mylab.navigation.experiments.variant_{number}.agents:PlannerWithRecurrentMemory" for number in range(9)]
TWELVE = ["mmn", "planner", "random", *LONG]


def episodes_of(folder):
    """The episodes of all results below a folder, and the labels."""
    results = read_results([folder])
    labels = list(dict.fromkeys(result.label for result in results))
    return join_episodes(results, labels), labels


def describe(folder, name):
    """The figure of a table."""
    episodes, labels = episodes_of(folder)
    return next(describe_table(table, all_looks(labels)) for table in build_tables(episodes) if table.name == name)


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
        looks = list(all_looks([f"agent {number}" for number in range(40)]).values())[:40]
        assert len({(look.color, look.marker, look.dashes) for look in looks}) == 40

    def test_up_to_twelve_agents_have_markers_of_their_own(self):
        assert len({look.marker for look in list(all_looks(TWELVE).values())[:12]}) == 12

    def test_what_the_paper_printed_looks_like_no_agent_and_not_alike(self, tmp_path):
        labels = ["dqn", "mah", "mmn", "random"]
        for agent in labels:
            make_result(tmp_path / agent, agent, "hierarchical", num_mazes=1, record=False)
        figure = describe(tmp_path, "hierarchical-13")
        panel = next(panel for panel in figure.panels if panel.metric == "spl_grid")
        assert [series.label for series in panel.series] == [*labels, *PAPER_MARKERS]
        looks = [figure.looks[series.label] for series in panel.series]
        assert len({(look.color, look.marker) for look in looks}) == 8
        assert [look.color == PAPER_COLOR for look in looks] == [False] * 4 + [True] * 4

    def test_all_agents_of_the_paper_have_a_marker(self):
        printed = {f"{agent} (paper)" for table in reference()["tables"] for agent in table["agents"]}
        assert printed == set(PAPER_MARKERS)
        assert len(set(PAPER_MARKERS.values())) == len(PAPER_MARKERS)


class TestLegends:
    def test_it_stands_below_the_axes_within_the_figure_with_every_name_once(self):
        series = tuple(Series(label, (Point(0, 0), Point(1, 1))) for label in TWELVE)
        panels = (Panel("A panel", "x", series), Panel("Another", "x", series))
        canvas = lay_out(Figure("made", "A title", "", panels, all_looks(TWELVE), panel_height=2.0))
        [legend] = canvas.legends
        names = [text.get_text().replace("\n", "") for text in legend.get_texts()]
        assert names == TWELVE
        axes, box = canvas.axes[0].get_window_extent(), legend.get_window_extent()
        assert canvas.get_figwidth() == WIDTH
        assert box.x0 >= 0
        assert box.x1 <= canvas.bbox.x1
        assert 0 <= box.y0 < box.y1 <= axes.y0
        assert axes.height > 0.5 * 2.0 * canvas.dpi  # the figure grows, the axes do not shrink


class TestCurves:
    def test_one_distance_has_intervals_and_agents_that_agree_stand_apart(self, tmp_path):
        for agent in ("mah", "mmn"):
            make_result(tmp_path / agent, agent, skill=1.0, num_mazes=5, distances=(4,), record=False)
        first, second = describe(tmp_path, "local-13").panels[0].series[:2]
        assert first.has_bars
        [left], [right] = first.points, second.points
        assert (0.4 < left.low < 0.7, left.high, right.x - left.x) == (True, 1.0, pytest.approx(0.12))

    def test_many_distances_have_bands_between_the_ends_of_intervals(self, tmp_path):
        make_result(tmp_path / "mah", "mah", num_mazes=3, distances=(2, 4, 6, 8), record=False)
        series = describe(tmp_path, "local-13").panels[0].series[0]
        [band] = series.areas
        assert not series.has_bars
        assert set(band) == {(point.x, end) for point in series.points for end in (point.low, point.high)}

    def test_the_star_of_an_untrained_scale_is_in_the_legend(self, tmp_path):
        folder = make_result(tmp_path / "mah", "mah", track="adrift", num_mazes=2, record=False)
        edit_summary(folder, untrained_scale=True)
        [legend] = lay_out(describe(tmp_path, "track-adrift")).legends
        assert [text.get_text() for text in legend.get_texts()] == ["mah", "never trained on maps of this scale"]


class TestViolins:
    def test_an_agent_has_a_panel_with_an_outline_around_the_scores_of_each_level(self, tmp_path):
        make_result(tmp_path / "plain", "mah", num_mazes=3, record=False)
        make_result(tmp_path / "noise", "mah", num_mazes=3, record=False, position_noise=0.5)
        episodes, labels = episodes_of(tmp_path)
        [figure] = describe_distributions(episodes, all_looks(labels))
        [panel] = figure.panels
        violins, means = panel.series
        assert (panel.agent, panel.ticks) == ("mah", ((0, "0"), (1, "0.5")))
        assert [point.value for point in means.points] == episodes.groupby("setting").spl.mean().tolist()
        for area in violins.areas:
            assert len({round(x) for x, _ in area}) == 1  # of one level
            assert all(0 <= y <= 1 for _, y in area)


class TestTrajectories:
    def test_every_agent_has_a_row(self, tmp_path):
        for number, agent in enumerate(TWELVE):
            make_result(tmp_path / str(number), agent, num_mazes=2)
        episodes, labels = episodes_of(tmp_path)
        first, second = build_galleries(episodes)  # of at most eight agents
        assert [label for gallery in (first, second) for label, _ in gallery.drives] == labels
        assert (second.name, second.title[-8:]) == (f"{first.name}-part-2", "(2 of 2)")
        assert [drive.maze for drive in first.drives[0][1]] == [drive.maze for drive in second.drives[0][1]]

    def test_own_maps_have_a_figure_with_the_farthest_of_several_episodes_in_one_maze(self, tmp_path):
        for name in ("den", "office"):
            of_own_mazes(make_result(tmp_path / name, "mah", num_mazes=1, episodes_per_distance=3), name)
        episodes, _ = episodes_of(tmp_path)
        den, office = build_galleries(episodes)
        assert (den.name, office.name) == ("trajectories-custom-1-local-13", "trajectories-custom-2-local-13")
        [(_, drives)] = office.drives
        assert [drive.maze for drive in drives] == ["office-00"] * 5
        farthest = set(episodes.start[(episodes.distance == 4) & episodes.maze.str.startswith("office")])
        assert farthest <= {drive.start for drive in drives}

    def test_the_goal_has_the_colour_of_the_world(self, tmp_path):
        make_result(tmp_path / "mah", "mah", num_mazes=1)
        episodes, labels = episodes_of(tmp_path)
        [gallery] = build_galleries(episodes)
        draw_gallery(gallery, all_looks(labels), tmp_path / "figure")
        pixels = imread(tmp_path / "figure.png")[..., :3]
        for color in (colors.START, colors.GOAL):
            assert (abs(pixels - color).max(axis=-1) < 0.01).sum() > 50
