"""The page of a check of an old map, with its figures, tables and numbers as files."""

from __future__ import annotations

import csv
import dataclasses
import io
import pathlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import scipy.ndimage
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D

from mazebench.maps.older_map import OlderMap
from mazebench.maps.pair import OF_PAIR, pair_of_walls
from mazebench.report.episodes import ReportedResult, reported
from mazebench.report.figures import STYLE, WIDTH, save
from mazebench.report.page import as_svg, with_explorer
from mazebench.report.write_report import FIGURES, provenance_of
from mazebench.results.map_costs import NONE, OLD, RIGHT, Answer, answer, driven
from mazebench.results.reading import SUMMARY, Result, load_result, read_suite
from mazebench.results.trajectories import TRAJECTORIES, load_trajectories
from mazebench.results.trouble import CLOSED, DETOUR, LEAST, OPENED, Spot, find_spots
from mazebench.storage.files import make_folder, open_whole, writing_to
from mazebench.storage.json_files import write_json

INDEX, NUMBERS, SPOTS = "index.html", "check.json", "trouble.csv"
_NAMES = {OLD: "old map", RIGHT: "right map", NONE: "no map"}
_COLORS = {OLD: "#d55e00", RIGHT: "#0072b2"}
_NOW = {
    CLOSED: "closed on the map's way of",
    OPENED: "open now, a wall on the map, on the way of",
    DETOUR: "a detour begins on",
}
_MOST_SPOTS, _MOST_WAYS = 8, 5  # ways of the worst trips in a building
_WALL, _SPOT = (118, 122, 130), "#9b1c86"


class Checked(NamedTuple):
    """The check of one agent."""

    agent: str
    results: dict[str, Result]  # by part
    answer: Answer
    lost: np.ndarray  # [E] m, with the old map more than with the right one
    spots: list[Spot]  # all, the one with the most metres first

    @property
    def worst(self) -> list[Spot]:
        """The spots at which metres are lost, as many as the page has."""
        return [spot for spot in self.spots if spot.metres >= LEAST][:_MOST_SPOTS]

    @property
    def elsewhere(self) -> float:
        """The metres that are not lost at these spots; less than 0 where other trips are shorter with the old map."""
        return float(self.lost.sum()) - sum(spot.metres for spot in self.worst)

    @property
    def has_several(self) -> bool:
        """True if the trips are in several buildings."""
        return len({record.maze for record in self.results[OLD].records}) > 1

    def describe(self, spot: Spot) -> str:
        """Returns a spot in words."""
        num = len(spot.trips)
        each = f"{spot.metres / num:.1f} m{' each' * (num > 1)}"
        return f"{self.label(spot)} m: {_NOW[spot.kind]} {num} of {len(self.lost)} trips, {each}"

    def label(self, spot: Spot) -> str:
        """Returns the point of a spot, after the name of the building if there are several."""
        return f"{spot.maze} " * self.has_several + f"({spot.point[0]:.1f}, {spot.point[1]:.1f})"


def read_checks(out: pathlib.Path, older: Sequence[OlderMap], top_speed: float) -> list[Checked]:
    """Returns the checks in a folder, of each agent that is done one; `top_speed` is that of the body, in m/s."""
    suite, checks = read_suite(out), []
    for agent, folder in suite.folders.items():
        parts = [part for part in suite.parts if (out / folder / part / SUMMARY).exists()]
        if not {OLD, RIGHT} <= set(parts):
            continue
        results = {part: load_result(out / folder / part) for part in parts}
        old, right = results[OLD].records, results[RIGHT].records
        paths = (load_trajectories(out / folder / part / TRAJECTORIES) for part in (OLD, RIGHT))
        drives = [(mine.pose[:, :2], its.pose[:, :2]) for mine, its in zip(*paths, strict=True)]
        found = answer(old, right, results[NONE].records if NONE in results else None, top_speed)
        lost = (driven(old, top_speed) - driven(right, top_speed))[:, 0]
        checks.append(Checked(agent, results, found, lost, find_spots(old, lost, older, drives)))
    return checks


def write_check(out: pathlib.Path, checks: Sequence[Checked], older: Sequence[OlderMap]) -> None:
    """Writes the page, the numbers, the trouble spots and the figures of checks to the folder of their results."""
    shown = [_in_explorer(check) for check in checks]
    figures = {}
    for check, results in zip(checks, shown, strict=True):
        ways = {part: results[part].trajectories or [] for part in (OLD, RIGHT)}
        name = results[OLD].folder.parent.name
        played = {record.maze for record in check.results[OLD].records}
        buildings = {each.maze.name: each for each in older if each.maze.name in played}
        figures[check.agent] = {f"{name}-{maze}": _draw_building(check, each, ways) for maze, each in buildings.items()}
    make_folder(out / FIGURES)
    with writing_to(out):
        for name, figure in (item for own in figures.values() for item in own.items()):
            save(figure, out / FIGURES / name)
        with open_whole(out / SPOTS) as file:
            file.write(_to_csv(checks).encode("utf-8"))
        write_json(out / NUMBERS, {check.agent: _to_json(check) for check in checks})
        with open_whole(out / INDEX) as file:
            file.write(_page(checks, shown, figures).encode("utf-8", "replace"))


def _in_explorer(check: Checked) -> dict[str, ReportedResult]:
    """Returns the results as the explorer shows them: one agent for each map, and groups of the trips of each spot."""
    shown: dict[str, ReportedResult] = {}
    for part, result in check.results.items():
        own = reported(result)
        facts = {f"{place}: {check.label(spot)} m": spot.trips for place, spot in enumerate(check.worst, 1)}
        columns = {name: np.isin(np.arange(len(own.episodes)), trips) for name, trips in facts.items()}
        setting = own.setting if part == OLD else shown[OLD].setting
        label = f"{check.agent}, {_NAMES[part]}"
        episodes = own.episodes.assign(**columns)
        shown[part] = dataclasses.replace(own, label=label, setting=setting, episodes=episodes, facts=tuple(facts))
    return shown


def _page(checks: Sequence[Checked], shown: Sequence[dict[str, ReportedResult]], figures: dict[str, Any]) -> str:
    results = [result for own in shown for result in own.values()]
    opens, sections = "", []
    for check, own in zip(checks, shown, strict=True):
        number = results.index(own[OLD])
        links = [f"#episode={number}-{spot.trips[0]}-{place}" for place, spot in enumerate(check.worst)]
        opens = opens or next(iter(links), "")
        images = {name: as_svg(figure) for name, figure in figures[check.agent].items()}
        sections.append({"check": check, "rows": list(zip(check.worst, links, strict=True)), "figures": images})
    agents, mazes = ", ".join(check.agent for check in checks), ", ".join(shown[0][OLD].episodes.maze.unique())
    subtitle = f"{agents}: {checks[0].answer.num_trips} trips in {mazes}"
    return with_explorer("check.html", results, provenance_of(results), opens, subtitle=subtitle, sections=sections)


def _to_csv(checks: Sequence[Checked]) -> str:
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["agent", "building", "x", "y", "now", "trips", "metres", "metres_per_trip"])
    for check in checks:
        for spot in check.spots:
            numbers = [*spot.point, spot.kind, len(spot.trips), spot.metres, spot.metres / len(spot.trips)]
            values = [round(each, 2) if isinstance(each, float) else each for each in numbers]
            writer.writerow([check.agent, spot.maze, *values])
    return file.getvalue()


def _to_json(check: Checked) -> dict[str, Any]:
    found = check.answer
    places = [spot._asdict() for spot in check.spots]
    return {"answer": found.sentence, "verdict": found.verdict, **dataclasses.asdict(found), "places": places}


@mpl.rc_context(STYLE)
def _draw_building(check: Checked, older: OlderMap, ways: dict[str, Any]) -> Figure:
    """Returns the old map with what has changed, the trouble spots, and the ways of the worst trips on both maps."""
    maze = older.maze
    pair = older.pair or pair_of_walls(older.walls, maze.walls, maze.cell_size)
    image = np.full((*maze.walls.shape, 4), 255, dtype=np.uint8)
    image[older.walls] = (*_WALL, 255)
    is_free = ~(maze.walls & older.walls)  # on one of them
    image[~scipy.ndimage.binary_dilation(is_free, np.ones((3, 3)))] = 0  # what only fills up the square
    for name in ("wall_now", "free_now"):
        image[getattr(pair, name)] = (*OF_PAIR[name], 255)

    # All in metres of the old map's frame, in which the maze may be turned.
    x, y, yaw = older.origin
    place = Affine2D().rotate(yaw).translate(x, y)
    free = place.transform(maze.point(np.argwhere(is_free)))
    (left, bottom), (right, top) = free.min(axis=0) - 1, free.max(axis=0) + 1
    height = float(np.clip(WIDTH * (top - bottom) / (right - left), 2.0, 9.0))
    figure = Figure(figsize=(WIDTH, height + 0.9), layout="constrained")
    axes = figure.add_subplot(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.grid(visible=False)
    axes.set(xlabel="x (m) on the old map", ylabel="y (m)")
    axes.imshow(image, extent=(0, maze.side, 0, maze.side), transform=place + axes.transData, interpolation="nearest")
    axes.set(xlim=(left, right), ylim=(bottom, top))  # which imshow moves

    records = check.results[OLD].records
    worst = [number for number in np.argsort(-check.lost).tolist() if check.lost[number] >= LEAST]
    own = [number for number in worst if records[number].maze == maze.name]
    for number in own[:_MOST_WAYS]:
        for part, dashes in ((RIGHT, (0, (4, 2))), (OLD, "-")):
            if ways[part]:
                points = place.transform(ways[part][number].pose[:, :2])
                axes.plot(*points.T, color=_COLORS[part], linestyle=dashes, linewidth=1.1, alpha=0.85)
    _mark_spots(axes, check, maze.name)
    _explain(axes, figure)
    return figure


def _mark_spots(axes: Axes, check: Checked, maze: str) -> None:
    """Draws the trouble spots of a building as circles with their numbers; an area is as large as the loss."""
    most = max((spot.metres for spot in check.worst), default=1.0)
    for place, spot in enumerate(check.worst, 1):
        if spot.maze == maze:
            axes.scatter(*spot.point, s=60 + 500 * spot.metres / most, color=_SPOT, alpha=0.35, linewidths=0, zorder=5)
            number: Any = {"ha": "center", "va": "center", "fontsize": 8, "fontweight": "bold", "zorder": 6}
            axes.text(*spot.point, str(place), color="#3d0635", **number)


def _explain(axes: Axes, figure: Figure) -> None:
    squares: Any = {"marker": "s", "linestyle": "", "markersize": 6}
    shades = {"wall now": OF_PAIR["wall_now"], "free now": OF_PAIR["free_now"], "wall on the old map": _WALL}
    for label, shade in shades.items():
        axes.plot([], [], **squares, color=np.array(shade) / 255, label=label)
    axes.plot([], [], marker="o", linestyle="", markersize=8, alpha=0.5, color=_SPOT, label="trouble spot")
    axes.plot([], [], color=_COLORS[OLD], label="worst trips, old map")
    axes.plot([], [], color=_COLORS[RIGHT], linestyle=(0, (4, 2)), label="the same, right map")
    figure.legend(loc="outside lower center", ncols=3)
