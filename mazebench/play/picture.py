"""The world from above and the map beside it, as characters for a terminal and as pixels for a window."""

from __future__ import annotations

import enum
import math
from typing import NamedTuple

import numpy as np

from mazebench.maps import colors
from mazebench.maps.maze import Cell
from mazebench.play.game import HELP, Game
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START


class Style(enum.IntEnum):
    """What a character shows."""

    TEXT, FLOOR, WALL, PATH, START, GOAL, LANDMARK, BODY, RAY = range(9)


_GLYPHS = {
    Style.FLOOR: " ",
    Style.WALL: "#",
    Style.PATH: ".",
    Style.START: "S",
    Style.GOAL: "G",
    Style.LANDMARK: "o",
    Style.RAY: ":",
}
_ARROWS = "→↗↑↖←↙↓↘"
_PLAIN_ARROWS = ">>^<<<v>"
# Rows and columns of characters for a cell, the largest first; a character is about twice as high as it is wide.
_SCALES = ((3, 6), (2, 4), (1, 2), (1, 1))
_GAP = 3  # columns between the world and the map
_LINES = 5  # of other text: title, headings, an empty line, status, help
_RAY_POINTS = 128  # at which a ray is drawn; 4 cm apart on the longest one
_MIN_WIDTH, _MIN_HEIGHT = 24, 10
_SHADES = {
    Style.FLOOR: (255, 255, 255),
    Style.WALL: (32, 34, 40),
    Style.START: colors.to_bytes(colors.START),
    Style.GOAL: colors.to_bytes(colors.GOAL),
}


class Characters(NamedTuple):
    """A rectangle of characters."""

    glyphs: np.ndarray  # [H, W] of one character each
    styles: np.ndarray  # [H, W] int, of `Style`


def draw(game: Game, width: int, height: int, plain: bool = False) -> Characters:
    """Returns what a terminal of `width` columns and `height` rows shows; with `plain`, in ASCII only."""
    screen = Characters(np.full((height, width), " "), np.full((height, width), Style.TEXT))
    if width < _MIN_WIDTH or height < _MIN_HEIGHT:
        _write(screen, 0, 0, "enlarge the terminal")
        return screen

    # The world on the left and the map on the right; of large ones, the part around the body.
    rows, columns = _scale(game, width, height)
    half = (width - _GAP) // 2
    centre = game.to_cells(game.path[-1]) / game.task_spec.size
    world = _focus(draw_world(game, rows, columns, plain), height - _LINES, half, centre)
    shown = _focus(draw_map(game, rows, columns), height - _LINES, half, centre)
    right = world.glyphs.shape[1] + _GAP
    for panel, left in ((world, 0), (shown, right)):
        area = slice(2, 2 + panel.glyphs.shape[0]), slice(left, left + panel.glyphs.shape[1])
        screen.glyphs[area], screen.styles[area] = panel.glyphs, panel.styles

    _write(screen, 0, 0, game.title())
    _write(screen, 1, 0, "the world")
    _write(screen, 1, right, "the map as an agent is given it")
    _write(screen, height - 2, 0, game.status())
    _write(screen, height - 1, 0, HELP)
    return screen


def draw_world(game: Game, rows: int, columns: int, plain: bool = False) -> Characters:
    """Returns the true maze with the path and the rays of the range sensor, `rows` x `columns` characters a cell."""
    # What is drawn later lies over what was drawn before.
    task, size = game.env.task, game.task_spec.size
    styles = np.where(game.walls, Style.WALL, Style.FLOOR).repeat(rows, axis=0).repeat(columns, axis=1)
    path = game.to_cells(game.path) * [columns, -rows] + [0, size * rows]
    if game.rays is not None:
        ends = game.to_cells(game.rays) * [columns, -rows] + [0, size * rows]
        points = np.linspace(path[-1], ends, _RAY_POINTS, endpoint=False).astype(int)  # [_RAY_POINTS, 32, 2]
        styles[points[..., 1], points[..., 0]] = Style.RAY
    styles[path[:, 1].astype(int), path[:, 0].astype(int)] = Style.PATH
    for cells, style in ((game.landmarks, Style.LANDMARK), ([task.route.goal], Style.GOAL)):
        for cell in cells:
            _mark(styles, cell, style, rows, columns)

    # The body as an arrow.
    panel = _characters(styles)
    x, y = path[-1].astype(int)
    octant = round(game.env.simulation.yaw() / (math.pi / 4)) % 8
    panel.glyphs[y, x], panel.styles[y, x] = (_PLAIN_ARROWS if plain else _ARROWS)[octant], Style.BODY
    return panel


def draw_map(game: Game, rows: int, columns: int) -> Characters:
    """Returns the map that an agent is shown: M x M cells, start and goal of the current leg."""
    walls = game.context[GLOBAL_MAP] > 0.5
    styles = np.where(walls, Style.WALL, Style.FLOOR).repeat(rows, axis=0).repeat(columns, axis=1)
    for plane, style in ((START, Style.START), (GOAL, Style.GOAL)):
        _mark(styles, divmod(int(game.context[plane].argmax()), len(walls)), style, rows, columns)
    return _characters(styles)


def map_pixels(game: Game, side: int) -> np.ndarray:
    """Returns `[side, side, 3]` uint8: a picture of the map that an agent is shown."""
    cells = draw_map(game, 1, 1).styles
    index = np.arange(side) * len(cells) // side
    shades = np.array([_SHADES.get(style, (0, 0, 0)) for style in Style], dtype=np.uint8)
    return shades[cells[index][:, index]]


def _scale(game: Game, width: int, height: int) -> tuple[int, int]:
    """Returns the largest scale at which everything fits; the smallest one if none fits."""
    cells = max(game.task_spec.size, game.task_spec.context_size)
    for rows, columns in _SCALES:
        if rows * cells <= height - _LINES and columns * cells <= (width - _GAP) // 2:
            return rows, columns
    return _SCALES[-1]


def _focus(panel: Characters, height: int, width: int, centre: np.ndarray) -> Characters:
    """Returns the part of a panel around `centre` that fits; `centre` is (x, y) as shares of its sides, y up."""
    spans = []
    for length, room, share in ((len(panel.glyphs), height, 1 - centre[1]), (panel.glyphs.shape[1], width, centre[0])):
        begin = int(np.clip(share * length - room / 2, 0, max(0, length - room)))
        spans.append(slice(begin, begin + room))
    return Characters(panel.glyphs[tuple(spans)], panel.styles[tuple(spans)])


def _mark(styles: np.ndarray, cell: Cell, style: Style, rows: int, columns: int) -> None:
    """Marks the middle of a cell, or all of it if it is one character."""
    row, column = cell[0] * rows + (rows - 1) // 2, cell[1] * columns + (columns - 1) // 2
    styles[row, column : column + max(1, columns // 2)] = style


def _characters(styles: np.ndarray) -> Characters:
    glyphs = np.array([_GLYPHS.get(style, " ") for style in Style])
    return Characters(glyphs[styles], styles)


def _write(screen: Characters, row: int, column: int, text: str) -> None:
    visible = list(text)[: max(0, screen.glyphs.shape[1] - column)]
    screen.glyphs[row, column : column + len(visible)] = visible
