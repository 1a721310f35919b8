"""The game in a terminal, by Python's curses."""

from __future__ import annotations

import contextlib
import locale
import select
import signal
import sys
from collections.abc import Iterator
from typing import Any

from mazebench import stopping
from mazebench.errors import InputError
from mazebench.play.game import Game
from mazebench.play.picture import Style, draw

_ESCAPE = 27
_ESCAPE_DELAY = 25  # ms to wait for the rest of an arrow's sequence
_LOST = 8  # failed reads in a row, with input waiting, after which the terminal is taken to be gone
_IDLE_SECONDS = 0.2  # between checks of the terminal's size


def play(game: Game) -> None:
    """Plays until Escape or Ctrl-C. The terminal is restored in any case, also after an error or SIGTERM.

    Raises:
      InputError: if standard input or output is no terminal, or one that can't be drawn on.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise InputError("expected a terminal to play on, found a file or a pipe")
    try:
        import curses
    except ImportError as error:
        raise InputError("playing in a terminal needs Python's curses, which this system's Python lacks") from error
    locale.setlocale(locale.LC_ALL, "")
    with _ending_by_signals(), contextlib.suppress(KeyboardInterrupt):
        try:
            curses.wrapper(lambda screen: _Screen(curses, screen).run(game))
        except curses.error as error:
            raise InputError(f"can't draw on this terminal: {error}; is TERM set to its kind?") from error


@contextlib.contextmanager
def _ending_by_signals() -> Iterator[None]:
    """Turns the signals that end a process into an exception, so that the terminal is restored first."""

    def end(number: int, frame: Any) -> None:
        sys.exit(128 + number)

    with stopping.handling([signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])], end):
        yield


class _Screen:
    """A curses screen and its colours."""

    def __init__(self, curses: Any, screen: Any):
        self._curses, self._screen = curses, screen
        curses.set_escdelay(_ESCAPE_DELAY)
        with contextlib.suppress(curses.error):  # some terminals can't hide the cursor
            curses.curs_set(0)
        self._attributes = self._colours()
        self._plain = locale.getpreferredencoding(False).lower().replace("-", "") != "utf8"
        self._keys = {
            curses.KEY_UP: "up",
            curses.KEY_DOWN: "down",
            curses.KEY_LEFT: "left",
            curses.KEY_RIGHT: "right",
        }

    def _colours(self) -> dict[int, int]:
        """Returns the curses attribute of each style."""
        curses = self._curses
        if not curses.has_colors():
            return {Style.BODY: curses.A_BOLD, Style.WALL: curses.A_REVERSE}
        pairs = {
            Style.FLOOR: (curses.COLOR_BLACK, curses.COLOR_WHITE),
            Style.WALL: (curses.COLOR_BLUE, curses.COLOR_BLUE),
            Style.PATH: (curses.COLOR_MAGENTA, curses.COLOR_WHITE),
            Style.START: (curses.COLOR_WHITE, curses.COLOR_GREEN),
            Style.GOAL: (curses.COLOR_WHITE, curses.COLOR_RED),
            Style.LANDMARK: (curses.COLOR_BLACK, curses.COLOR_YELLOW),
            Style.BODY: (curses.COLOR_WHITE, curses.COLOR_BLACK),
            Style.RAY: (curses.COLOR_CYAN, curses.COLOR_WHITE),
        }
        for style, (ink, paper) in pairs.items():
            curses.init_pair(style, ink, paper)
        bold = {Style.GOAL, Style.START, Style.BODY}
        return {style: curses.color_pair(style) | (curses.A_BOLD if style in bold else 0) for style in pairs}

    def run(self, game: Game) -> None:
        """Draws the game and plays the keys that are pressed, until Escape."""
        self._show(game)
        while (code := self._next()) != _ESCAPE:
            game.press(self._keys.get(code) or (chr(code).lower() if code < 128 else ""))
            self._show(game)

    def _next(self) -> int:
        """Waits for a key or a change of size; returns its code, or Escape if the terminal is gone."""
        num_lost = 0
        # A waiting getch would miss a change of size that came just before it, until the next key.
        self._screen.nodelay(True)
        while num_lost < _LOST:
            if (code := self._screen.getch()) >= 0:
                return code
            ready, _, _ = select.select([sys.stdin], [], [], _IDLE_SECONDS)
            num_lost += bool(ready)
        return _ESCAPE

    def _show(self, game: Game) -> None:
        height, width = self._screen.getmaxyx()
        glyphs, styles = draw(game, width, height, self._plain)
        self._screen.erase()
        for row in range(height):
            # The last column stays empty: writing to the last character of the screen would scroll it.
            for column in range(width - 1):
                attribute = self._attributes.get(int(styles[row, column]), 0)
                with contextlib.suppress(self._curses.error):  # the terminal has become smaller
                    self._screen.addstr(row, column, glyphs[row, column], attribute)
        self._screen.refresh()
