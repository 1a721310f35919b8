"""Driving by hand: the game itself, its pictures, and a real process on a pseudo-terminal."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import shutil
import signal
import struct
import subprocess
import sys
import termios
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from acting import inputs_of
from processes import run_python
from simple_mazes import field

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.maps.maze import Maze
from mazebench.maps.text import write_text_maze
from mazebench.play import viewer
from mazebench.play.game import LETTERS, Game
from mazebench.play.picture import Style, draw, draw_map, draw_world
from mazebench.tasks.build import make_spec
from mazebench.tasks.episode import Episode

SECONDS = 60  # to wait for what must come
SIZE = (30, 100)  # rows and columns of the terminal
LETTER_OF = {action: letter for letter, action in LETTERS.items()}


@pytest.fixture
def corridor() -> Maze:
    """Of 3 cells, from (1, 1) to (1, 3) of 5 x 5."""
    walls = np.ones((5, 5), dtype=bool)
    walls[1, 1:4] = False
    return Maze(walls, "corridor")


@pytest.fixture
def game(corridor) -> Game:
    """From (1, 1), where the body looks at the goal in (1, 3)."""
    game = Game(make_spec(maps=corridor, distances=[2]), seed=0)
    game.env.task.choose_episode(episode=Episode(0, (1, 1), (1, 3), 0.0, 0))
    game.next_episode()
    return game


def text(glyphs: np.ndarray) -> list[str]:
    return ["".join(row).rstrip() for row in glyphs]


class TestGame:
    def test_keys_stand_for_actions(self, game):
        for key, name, action in (("w", "up", 0), ("s", "down", 1), ("q", "left", 4), ("e", "right", 5)):
            states = []
            for pressed in (key, name):
                game.restart()
                game.press(pressed)
                states.append(game.observation["state"])
            game.restart()
            np.testing.assert_array_equal(states, [game.env.step(action)[0]["state"]] * 2)
        assert (LETTERS["a"], LETTERS["d"]) == (2, 3)

    def test_other_keys_do_nothing(self, game):
        for key in ("x", "", "escape", "W"):
            game.press(key)
        assert (game.env.task.steps, game.num_episodes) == (0, 2)

    def test_the_goal_is_reported_and_a_key_starts_again(self, game):
        for _ in range(20):
            game.press("w")
        assert game.status().startswith("GOAL REACHED after 4 steps")
        assert game.outcome() == "1 of 2 episodes ended at the goal"
        game.press("r")
        assert (game.env.task.episode.start, game.env.task.steps) == ((1, 1), 0)
        assert len(game.path) == 1

    def test_the_end_of_time_is_reported(self, corridor):
        game = Game(make_spec(maps=corridor, distances=[2], time_limit=2), seed=0)
        for key in "qqq":
            game.press(key)
        assert game.status() == "OUT OF TIME after 2 steps, 0.00 m"

    def test_the_status_names_the_next_landmark(self):
        game = Game(make_spec("hierarchical", landmark_distance=5), seed=0)
        assert game.landmarks == game.env.task.route.cells[1:-1]
        assert "landmark 1" in game.status()


class TestPictures:
    def test_the_world_is_drawn_with_the_body_and_its_path(self, game):
        assert text(draw_world(game, 1, 2).glyphs) == ["##########", "## →  G ##", *["##########"] * 3]
        game.press("w")
        game.press("w")  # to x = 2.2 m
        assert text(draw_world(game, 1, 2).glyphs) == ["##########", "## .→ G ##", *["##########"] * 3]
        assert text(draw_world(game, 1, 1, plain=True).glyphs) == ["#####", "#.>G#", *["#####"] * 3]

    def test_the_map_is_drawn_without_the_body(self, game):
        game.press("w")
        assert text(draw_map(game, 1, 2).glyphs) == ["##########", "##S   G ##", *["##########"] * 3]
        assert text(draw_map(game, 1, 1).glyphs) == ["#####", "#S G#", *["#####"] * 3]

    def test_the_map_is_the_one_that_an_agent_is_shown(self):
        game = Game(make_spec("local", 13, map_flip=0.3), seed=0)
        seen = draw_map(game, 1, 1).styles == Style.WALL
        np.testing.assert_array_equal(seen, game.env.task.shown_map.walls)
        assert (seen != game.walls).any()
        np.testing.assert_array_equal(draw_world(game, 1, 1).styles == Style.WALL, game.walls)

    def test_rays_of_the_range_sensor_are_drawn_up_to_the_walls(self, corridor):
        game = Game(make_spec(maps=corridor, distances=[2], sensors="lidar"), seed=0)
        game.env.task.choose_episode(episode=Episode(0, (1, 1), (1, 3), 0.0, 0))
        game.next_episode()
        assert text(draw_world(game, 1, 2).glyphs) == ["##########", "##:→::G:##", *["##########"] * 3]
        assert ":" not in "".join(text(draw_map(game, 1, 2).glyphs))
        game.press("q")
        np.testing.assert_allclose(np.hypot(*(game.rays - game.path[-1]).T), game.observation["lidar"])

    @pytest.mark.parametrize(("width", "height"), [(100, 40), (56, 18), (24, 10), (1, 1)])
    @pytest.mark.parametrize("size", [13, 21, 101])
    def test_a_terminal_of_any_size_is_drawn_on(self, width, height, size):
        game = Game(make_spec(maps=field(size), distances=[3]), seed=0)
        glyphs, styles = draw(game, width, height)
        assert glyphs.shape == styles.shape == (height, width)
        if width >= 24 and height >= 10:
            assert (styles == Style.BODY).sum() == 1
            assert text(glyphs)[0].startswith("maze field, local: the goal"[:width])


def _take_terminal() -> None:
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    # Where the tests run in the background, interrupts are ignored, and processes inherit that.
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Terminal:
    """`mazebench play` on a pseudo-terminal of its own."""

    def __init__(self, *arguments: str, kind: str):
        self.master, self.slave = pty.openpty()
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack("HHHH", *SIZE, 0, 0))
        self.settings = termios.tcgetattr(self.slave)
        self.output = ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "mazebench", "play", "--terminal", *arguments],
            stdin=self.slave,
            stdout=self.slave,
            stderr=self.slave,
            env={key: value for key, value in os.environ.items() if key not in ("LINES", "COLUMNS")}
            | {"TERM": kind, "LC_ALL": "C.UTF-8"},
            start_new_session=True,
            preexec_fn=_take_terminal,
        )

    def expect(self, words: str) -> None:
        """Reads on until the words have come."""
        while words not in self.output:
            assert select.select([self.master], [], [], SECONDS)[0], f"waited for {words!r}, found {self.output!r}"
            self.output += os.read(self.master, 65536).decode(errors="replace")

    def type(self, keys: str) -> None:
        os.write(self.master, keys.encode())

    def end(self) -> int:
        """Waits for the end and checks that the terminal is as it was; returns the exit status."""
        with open(os.pidfd_open(self.process.pid)) as ended:
            while True:
                ready = select.select([self.master, ended], [], [], SECONDS)[0]
                assert ready, f"waited for the end, found {self.output!r}"
                if self.master not in ready:
                    break
                self.output += os.read(self.master, 65536).decode(errors="replace")
        self.process.wait()
        assert termios.tcgetattr(self.slave) == self.settings
        if "\x1b[?1049h" in self.output:  # the screen that programs draw on, and the cursor
            assert self.output.rindex("\x1b[?1049l") > self.output.rindex("\x1b[?1049h")
            assert max(self.output.rfind("\x1b[?25h"), self.output.rfind("\x1b[?12l\x1b[?25h")) > self.output.rindex(
                "\x1b[?25l"
            )
        return self.process.returncode

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self.slave)
        os.close(self.master)


@pytest.fixture
def terminal(request, tmp_path, corridor) -> Iterator[Terminal]:
    """One that shows the corridor, of the kind that a test names."""
    write_text_maze(corridor, tmp_path / "corridor.txt")
    options = ("--maps", str(tmp_path / "corridor.txt"), "--distances", "2", "--seed", "3")
    terminal = Terminal(*options, kind=getattr(request, "param", "xterm-256color"))
    yield terminal
    terminal.close()


def keys_to_the_goal(maze: Maze, seed: int) -> str:
    """What the closed-loop planner would press."""
    game, agent = Game(make_spec(maps=maze, distances=[2]), seed), load_agent_class("planner-closed-loop")
    planner, keys = agent.build(Interface("local", maze.size, maze.size)), ""
    state = planner.initial_state(1)
    while not game.ended:
        observation = {key: game.observation[key][None] for key in ("state", "context")}
        actions, state = planner.act(inputs_of(observation, np.array([game.env.task.is_first])), state)
        keys += LETTER_OF[int(actions[0])]
        game.press(keys[-1])
    return keys


class TestTerminal:
    def test_a_person_drives_to_the_goal(self, terminal, corridor):
        terminal.expect("quit")
        for words in ("maze corridor, local: the goal is 2 cells away", "the world", "the map as an agent"):
            assert words in terminal.output
        terminal.type(keys_to_the_goal(corridor, 3))
        terminal.expect("REACHED")
        terminal.type("\x1b")
        assert terminal.end() == 0
        assert "1 of 1 episodes ended at the goal" in terminal.output

    def test_arrows_work_and_the_window_may_change_its_size(self, terminal):
        terminal.expect("quit")
        terminal.type("\x1bOA\x1bOD")  # up and left, as a terminal in application mode sends them
        terminal.expect("98")  # steps left: only what changes is drawn
        fcntl.ioctl(terminal.slave, termios.TIOCSWINSZ, struct.pack("HHHH", 5, 22, 0, 0))
        terminal.process.send_signal(signal.SIGWINCH)
        terminal.expect("enlarge")
        terminal.type("n\x1b")
        assert terminal.end() == 0
        assert "0 of 2 episodes" in terminal.output

    def test_an_interrupt_ends_the_game(self, terminal):
        terminal.expect("quit")
        terminal.type("\x03")
        assert terminal.end() == 0
        assert "Traceback" not in terminal.output

    @pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
    def test_a_signal_ends_the_game(self, terminal, number):
        terminal.expect("quit")
        terminal.process.send_signal(number)
        assert terminal.end() == 128 + number

    @pytest.mark.parametrize("terminal", ["vt100"], indirect=True)
    def test_a_terminal_without_colours_shows_walls_as_letters(self, terminal):
        terminal.expect("quit")
        assert "##########" in terminal.output
        terminal.type("\x1b")
        assert terminal.end() == 0

    @pytest.mark.parametrize("terminal", ["no-such-terminal"], indirect=True)
    def test_a_terminal_of_an_unknown_kind_is_refused_in_one_line(self, terminal):
        assert terminal.end() == 2
        assert re.search(r"mazebench: can't draw on this terminal: .* is TERM set", terminal.output)


class TestViewer:
    def test_rays_of_the_range_sensor_are_drawn_in_the_world(self, corridor):
        game = Game(make_spec(maps=corridor, distances=[2], sensors="lidar"), seed=0)
        scene = mujoco.MjvScene(game.env.simulation.model, maxgeom=40)
        viewer._draw_rays(scene, game)
        assert scene.ngeom == 32
        middles = [geom.pos[:2] for geom in scene.geoms[:32]]
        np.testing.assert_allclose(middles, (game.path[-1] + game.rays) / 2, atol=1e-5)

    def test_only_the_range_sensor_is_shown(self):
        result = run_python("-m", "mazebench", "play", "--sensors", "top", status=2)
        said = "mazebench: expected sensors lidar or none, found top, which is not shown while you drive\n"
        assert result.stderr == said

    def test_a_display_that_does_not_open_is_named_in_one_line(self):
        command = [sys.executable, "-m", "mazebench", "play"]
        environment = os.environ | {"DISPLAY": ":9876"}
        environment.pop("WAYLAND_DISPLAY", None)
        result = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert result.returncode == 2
        assert result.stderr == "mazebench: can't open a window on this display; play with --terminal\n"

    def test_the_window_takes_keys(self):
        if not (shutil.which("Xvfb") and shutil.which("xdotool")):
            pytest.skip("needs Xvfb and xdotool")
        read, write = os.pipe()
        server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x900x24"],
            pass_fds=[write],
            stderr=subprocess.DEVNULL,
        )
        try:
            display = os.environ | {"DISPLAY": f":{os.read(read, 16).decode().strip()}"}
            command = [sys.executable, "-m", "mazebench", "play", "--seed", "1", "--sensors", "lidar"]
            game = subprocess.Popen(command, env=display, stdout=subprocess.PIPE, text=True)
            find = ["xdotool", "search", "--sync", "--onlyvisible", "--name", "MuJoCo"]
            window = subprocess.run(find, env=display, capture_output=True, text=True, check=True).stdout.split()[0]
            subprocess.run(["xdotool", "key", "--delay", "300", "--window", window, *"wsadqen", "Up"], env=display)
            subprocess.run(["xdotool", "key", "--window", window, "Escape"], env=display)
            assert game.communicate(timeout=SECONDS)[0] == "0 of 2 episodes ended at the goal\n"
        finally:
            server.terminate()
            server.wait()
