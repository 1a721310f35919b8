"""The report's figures: what they show, in which colours, and that names fit."""

from __future__ import annotations

import pandas as pd
import pytest
from made_results import make_result
from matplotlib.colors import to_hex
from matplotlib.image import imread

from mazebench.maps import colors
from mazebench.report.episodes import join_episodes, read_results
from mazebench.report.figures import Panel, draw_panels, draw_table, save
from mazebench.report.paper_figures import draw_paths, draw_violins
from mazebench.report.tables import build_tables

LONG = [f"mylab.navigation.experiments.variant_{number}.agents:PlannerWithRecurrentMemory" for number in range(9)]
TWELVE = ["mmn", "planner", "random", *LONG]


def episodes_of(folder):
    return join_episodes(read_results([folder]))


def draw(folder, name):
    """The figure of a table."""
    episodes = episodes_of(folder)
    [table] = [table for table in build_tables(episodes) if table.name == name]
    return draw_table(table, list(episodes.label.cat.categories))


def test_no_two_of_twelve_agents_look_alike_and_the_legend_fits(tmp_path):
    points = pd.DataFrame({"column": label, "x": [0, 1], "value": [0, 1]} for label in TWELVE).explode(["x", "value"])
    points = points.assign(low95=points.value, high95=points.value)
    panels = [Panel(title, "x", points, {0: "0", 1: "1"}) for title in ("One", "Two")]
    figure = draw_panels("A title", panels, TWELVE)
    lines = figure.axes[0].get_lines()
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == 12
    save(figure, tmp_path / "figure")
    [legend] = figure.legends
    assert [text.get_text().replace("\n", "") for text in legend.get_texts()] == TWELVE
    axes, box = figure.axes[0].get_window_extent(), legend.get_window_extent()
    assert (box.x0 >= 0, box.x1 <= figure.bbox.x1, 0 <= box.y0 < box.y1 <= axes.y0) == (True, True, True)
    assert axes.height > 0.5 * 2.0 * figure.dpi  # the figure grows, the axes do not shrink


def test_what_the_paper_printed_looks_like_no_agent(tmp_path):
    labels = ["dqn", "mah", "mmn", "random"]
    for agent in labels:
        make_result(tmp_path / agent, agent, "hierarchical", num_mazes=1, record=False)
    lines = [line for line in draw(tmp_path, "hierarchical-13").axes[-1].get_lines() if len(line.get_label()) > 2]
    looks = {line.get_label(): (line.get_color(), line.get_marker()) for line in lines}
    assert list(looks) == [*labels, *(f"{agent} (paper)" for agent in ("MMN", "MAH", "DQN", "Random"))]
    assert len(set(looks.values())) == 8


def test_violins_show_the_scores_of_each_level_and_their_mean(tmp_path):
    make_result(tmp_path / "plain", "mah", num_mazes=3, record=False)
    make_result(tmp_path / "noise", "mah", num_mazes=3, record=False, position_noise=0.5)
    episodes = episodes_of(tmp_path)
    [drawn] = draw_violins(episodes)
    [axes] = drawn.figure.axes
    assert (axes.get_title("left"), [text.get_text() for text in axes.get_xticklabels()]) == ("mah", ["0", "0.5"])
    assert len(axes.collections) == 3  # two violins, and the means
    means = episodes.groupby("position_noise").spl.mean().tolist()
    assert drawn.values["mean"].tolist() == pytest.approx(means, abs=1e-4)
    assert drawn.values[["agent", "strength", "count"]].values.tolist() == [["mah", 0.0, 6], ["mah", 0.5, 6]]


def test_paths_are_of_hierarchical_navigation_with_a_row_for_each_agent(tmp_path):
    for agent in ("mah", "mmn"):
        make_result(tmp_path / agent / "routes", agent, "hierarchical", num_mazes=2)
        make_result(tmp_path / agent / "flip", agent, "hierarchical", num_mazes=2, map_flip=0.2)
        make_result(tmp_path / agent / "local", agent, num_mazes=2)
    [drawn] = draw_paths(episodes_of(tmp_path))
    assert [axes.get_ylabel() for axes in drawn.figure.axes if axes.get_ylabel()] == ["mmn", "mah"]
    assert drawn.values.maze.tolist() == ["13-eval-00", "13-eval-00", "13-eval-01", "13-eval-01"]
    save(drawn.figure, tmp_path / "figure")
    pixels = imread(tmp_path / "figure.png")[..., :3]
    for color in (colors.START, colors.GOAL):
        assert (abs(pixels - color).max(axis=-1) < 0.01).sum() > 50, to_hex(color)
