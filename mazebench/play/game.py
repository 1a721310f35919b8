"""Episodes that a person drives, one agent step per key."""

from __future__ import annotations

import math

import numpy as np

from mazebench.envs.gym import MazeEnv
from mazebench.maps.maze import Maze
from mazebench.tasks.episode import Episode
from mazebench.tasks.sensors import LIDAR
from mazebench.tasks.task import Task
from mazebench.world.ray_casting import ray_ends

# The actions of letters and of arrow keys, as indices in `ACTIONS`.
KEYS = {"w": 0, "s": 1, "a": 2, "d": 3, "q": 4, "e": 5, "up": 0, "down": 1, "left": 4, "right": 5}
HELP = "w s a d  drive   q e  turn   arrows too   r  again   n  next   Esc  quit"


class Game:
    """An environment, the path driven in the current episode, and the number of episodes and of goals reached."""

    def __init__(self, task: Task, seed: int):
        """Begins the first episode of `seed`."""
        self.task = task
        self.env = MazeEnv(task, seed)
        self.num_episodes = 0
        self.num_reached = 0
        self.begin()

    def begin(self, episode: Episode | None = None) -> None:
        """Begins an episode, or the next one of the seed."""
        self.observation, _ = self.env.reset(options={"episode": episode})
        self.ended = False
        self.num_episodes += 1
        self.path = [self.env.simulation.position()]  # [2] m each: where the body was

    def press(self, key: str) -> None:
        """Does what a key stands for: a letter, or an arrow by its name. Other keys do nothing."""
        if key == "r":
            self.begin(self.env.runner.episode)
        elif key == "n":
            self.begin()
        elif key in KEYS and not self.ended:
            self.observation, _, terminated, truncated, _ = self.env.step(KEYS[key])
            self.ended = terminated or truncated
            self.path.append(self.env.simulation.position())
            self.num_reached += terminated

    @property
    def maze(self) -> Maze:
        """The maze of the episode."""
        return self.task.mazes[self.env.runner.episode.maze]

    @property
    def rays(self) -> np.ndarray | None:
        """`[32, 2]` m: where the rays of the range sensor end; None if the task does not have it."""
        if LIDAR not in self.task.sensors:
            return None
        pose = np.array([*self.path[-1], self.env.simulation.yaw()])
        return ray_ends(pose, self.observation[LIDAR])

    def title(self) -> str:
        """Returns a line that describes the episode."""
        maze, episode = self.maze, self.env.runner.episode
        distance = maze.distance(episode.start, episode.goal)
        scale = "" if maze.cell_size == 1 else f" of {maze.cell_size:g} m"
        return f"maze {maze.name}, {self.task.name}: the goal is {distance} cells{scale} away"

    def status(self) -> str:
        """Returns a line that describes the state of the episode."""
        runner, simulation = self.env.runner, self.env.simulation
        driven = f"{runner.steps} steps, {runner.path_length:.2f} m"
        if self.ended:
            return f"GOAL REACHED after {driven}" if runner.success else f"OUT OF TIME after {driven}"
        x, y = self.observation["state"][:2]
        heading = math.degrees(simulation.yaw())
        left = runner.route.deadline - runner.steps
        where = f"x {x:.2f}  y {y:.2f} m  heading {heading:+.0f} deg  {simulation.speed():.2f} m/s"
        to_landmark = self.task.options.is_hierarchical and runner.route.leg < len(runner.route.cells) - 2
        return f"{where}  {driven}, {left} steps left" + (f", landmark {runner.route.leg + 1}" if to_landmark else "")

    def outcome(self) -> str:
        """Returns a line that says how many episodes ended at the goal."""
        return f"{self.num_reached} of {self.num_episodes} episodes ended at the goal"
