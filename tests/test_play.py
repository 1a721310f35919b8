"""Driving by hand: the game itself and its window."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from processes import run_python
from simple_mazes import corridor, field

from mazebench.play import viewer
from mazebench.play.game import KEYS, Game
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task

SECONDS = 60  # to wait for what must come


@pytest.fixture
def game() -> Game:
    """From (1, 1), where the body looks at the goal in (1, 3)."""
    game = Game(Task.of(mazes=corridor(), distances=[2]), seed=0)
    game.env.runner.choose_episode(episode=Episode(0, (1, 1), (1, 3), 0.0, 0))
    game.begin()
    return game


class TestGame:
    def test_keys_stand_for_actions(self, game):
        for key, name, action in (("w", "up", 0), ("s", "down", 1), ("q", "left", 4), ("e", "right", 5)):
            states = []
            for pressed in (key, name):
                game.begin(game.env.runner.episode)
                game.press(pressed)
                states.append(game.observation["state"])
            game.begin(game.env.runner.episode)
            np.testing.assert_array_equal(states, [game.env.step(action)[0]["state"]] * 2)
        assert (KEYS["a"], KEYS["d"]) == (2, 3)

    def test_the_goal_is_reported_and_a_key_starts_again(self, game):
        for _ in range(20):
            game.press("w")
        assert game.status().startswith("GOAL REACHED after 4 steps")
        assert game.outcome() == "1 of 2 episodes ended at the goal"
        game.press("r")
        assert (game.env.runner.episode.start, game.env.runner.steps) == ((1, 1), 0)
        assert len(game.path) == 1


class TestViewer:
    def test_all_walls_are_drawn_of_each_maze_in_turn(self, game):
        scene = mujoco.MjvScene(game.env.simulation.model, maxgeom=80)
        walls = viewer.Walls(np.ones(4, np.float32))
        for maze in (corridor(), field(7), corridor()):
            walls.draw(scene, maze)
            shown = np.zeros((maze.size, maze.size), dtype=bool)
            for geom in scene.geoms[: scene.ngeom]:
                (x, y, _), (half_x, half_y, _) = geom.pos, geom.size
                rows = slice(round(maze.size - y - half_y), round(maze.size - y + half_y))
                shown[rows, round(x - half_x) : round(x + half_x)] = True
            np.testing.assert_array_equal(shown, maze.walls)

    def test_the_map_is_the_one_that_an_agent_is_shown(self):
        game = Game(Task.of("local", size=13, map_flip=0.3), seed=0)
        picture = viewer._map_picture(game.observation["context"], 260)
        seen = picture[2::20, 2::20].max(axis=-1) < 128  # beside the marks, which are discs
        np.testing.assert_array_equal(seen, game.env.runner.shown_map.walls)

    def test_a_display_that_does_not_open_is_named_in_one_line(self):
        display = {"DISPLAY": ":9876", "WAYLAND_DISPLAY": ""}
        assert run_python("-m", "mazebench", "play", status=2, variables=display).stderr == (
            "mazebench: can't open a window: there is no display, or it refuses; "
            "`mazebench render` films episodes without a window\n"
        )

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
            assert game.returncode == 0
        finally:
            server.terminate()
            server.wait()
