"""Measures pictures per second of CPU time, here and in other simulators: one environment, random actions.

pip install vizdoom miniworld; python docs/examples/camera_peers.py

A simulator that is not installed is left out. Reads /proc, so it needs Linux.
"""

import importlib.util
import os
import pathlib
import time
from collections.abc import Callable

import numpy as np

SECONDS = 20  # of wall time for each
RNG = np.random.default_rng(0)


def cpu_seconds() -> float:
    """CPU time of this process and of those that it started, such as ViZDoom's game."""
    ticks = 0
    for children in pathlib.Path("/proc/self/task").glob("*/children"):
        for child in children.read_text().split():
            ticks += sum(map(int, pathlib.Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[11:13]))
    return time.process_time() + ticks / os.sysconf("SC_CLK_TCK")


def measure(name: str, step: Callable[[], None]) -> None:
    for _ in range(50):
        step()
    count, begin, cpu = 0, time.perf_counter(), cpu_seconds()
    while time.perf_counter() - begin < SECONDS:
        step()
        count += 1
    print(f"{name}: {count / (cpu_seconds() - cpu):,.0f} pictures per second of CPU time", flush=True)


def gym_step(env) -> Callable[[], None]:
    env.reset(seed=0)

    def step() -> None:
        *_, terminated, truncated, _ = env.step(int(RNG.integers(env.action_space.n)))
        if terminated or truncated:
            env.reset()

    return step


if importlib.util.find_spec("mazebench"):
    import mazebench

    for look in ("plain", "varied"):
        env = mazebench.make("building", level=2, sensors=("egocentric",), look=look)
        measure(f"mazebench, building, {look}, 64 x 64, with physics", gym_step(env))

if importlib.util.find_spec("vizdoom"):
    import vizdoom

    game = vizdoom.DoomGame()
    game.load_config(os.path.join(vizdoom.scenarios_path, "my_way_home.cfg"))
    game.set_window_visible(False)
    game.set_screen_resolution(vizdoom.ScreenResolution.RES_160X120)
    game.set_screen_format(vizdoom.ScreenFormat.RGB24)
    game.init()
    buttons = np.eye(game.get_available_buttons_size()).astype(int).tolist()

    def play() -> None:
        if game.is_episode_finished():
            game.new_episode()
        game.get_state().screen_buffer  # noqa: B018
        game.make_action(buttons[RNG.integers(len(buttons))])

    measure("ViZDoom, my_way_home, 160 x 120", play)
    game.close()

if importlib.util.find_spec("miniworld"):
    import gymnasium
    import pyglet

    pyglet.options["headless"] = True  # before the import of miniworld
    import miniworld  # noqa: F401

    env = gymnasium.make("MiniWorld-Maze-v0", obs_width=64, obs_height=64)
    measure("MiniWorld, Maze, 64 x 64", gym_step(env))
