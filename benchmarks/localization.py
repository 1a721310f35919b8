"""Measures the navigator's localization on the track `lost`: `python benchmarks/localization.py [EPISODES]`.

Bodies drive in train mazes of this script's own by three policies: along free corridors without regard to the belief,
to the goal from the likeliest pose, or as `disambiguate` says until the pose is known and then to the goal. A pose is
right within 0.3 m and 10 degrees, and sure with a probability above 0.95. An episode that has ended keeps its last
values.
"""

from __future__ import annotations

import cmath
import math
import sys
import time

import numpy as np
from mazebench_agents.navigator import exploration, localization
from mazebench_agents.robot.body import YAW, Body, X, Y, observed_body
from mazebench_agents.robot.cells import marked_cell, nearest_cell
from mazebench_agents.robot.pilot import Pilot, steer

import mazebench
from mazebench.maps.generators import dfs_walls
from mazebench.maps.maze import path_through_walls
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.world.angles import wrap_angle
from mazebench.world.lidar import NUM_RAYS

SIZE = 13
NUM_MAZES = 100
NUM_STEPS = 200
STEPS = (0, 1, 5, 10, 20, 40)
SURE = 0.95


class Driver:
    """One episode: the belief, and a policy that drives by it."""

    def __init__(self, policy: str, context: np.ndarray):
        self.policy = policy
        self.walls = context[GLOBAL_MAP] > 0.5
        self.goal = marked_cell(context[GOAL])
        start = context[START]
        self.start_distribution = start / start.sum() if start.any() else ~self.walls / np.sum(~self.walls)
        self.belief: localization.Belief | None = None
        self.direction: float | None = None  # in the odometry's frame, of `wander`
        self.seconds: list[float] = []

    def act(self, state: np.ndarray, ranges: np.ndarray) -> int:
        """Updates the belief and returns an action."""
        odometry = state[[X, Y, YAW]]
        began = time.thread_time()
        if self.belief is None:
            self.belief = localization.begin(self.walls, self.start_distribution, odometry, ranges, self.goal)
        else:
            self.belief = localization.update(self.belief, self.walls, odometry, ranges, self.goal)
        self.seconds.append(time.thread_time() - began)
        body = observed_body(state.tolist())
        if self.policy == "wander":
            return self._wander(body, ranges)
        x, y, yaw = self.belief.pose.tolist()
        return Pilot.along(self._path(), SIZE).action(body._replace(x=x, y=y, yaw=yaw))

    def _path(self) -> list[tuple[int, int]]:
        if self.policy == "disambiguate" and self.belief.confidence < SURE:
            path = exploration.disambiguate(self.belief, self.walls)
            if len(path) > 1:
                return path
        x, y, _ = self.belief.pose.tolist()
        return path_through_walls(self.walls, nearest_cell(x, y, SIZE), self.goal)

    def _wander(self, body: Body, ranges: np.ndarray) -> int:
        """Drives straight on until a wall is near, then along the longest ray but backwards."""
        angles = body.yaw + 2 * math.pi / NUM_RAYS * np.arange(NUM_RAYS)
        if self.direction is None:
            self.direction = float(angles[np.argmax(ranges)])
        ahead = np.abs(wrap_angle(angles - self.direction))
        if ranges[np.argmin(ahead)] < 0.75:
            self.direction = float(angles[np.argmax(np.where(ahead < 2.4, ranges, 0.0))])
        aim = complex(body.x, body.y) + cmath.rect(1.0, self.direction)
        return steer(body, (aim.real, aim.imag))


def measure(level: int, policy: str, num_episodes: int) -> None:
    """Prints what became of `num_episodes` episodes."""
    rng = np.random.default_rng(level)
    mazes = tuple(mazebench.Maze(dfs_walls(SIZE, rng), f"train-{i}") for i in range(NUM_MAZES))
    env = mazebench.make_vec(
        "lost", num_episodes, maps=mazes, level=(level,), sensors=("lidar",), seed=1000 * level, num_threads=1
    )
    observed, info = env.reset()
    drivers = [Driver(policy, context) for context in observed["context"]]
    errors, turns, sure = np.zeros((3, NUM_STEPS + 1, num_episodes))
    going, steps = np.ones(num_episodes, dtype=bool), np.full(num_episodes, NUM_STEPS)
    for step in range(NUM_STEPS + 1):
        actions = np.zeros(num_episodes, dtype=np.int64)
        errors[step], turns[step], sure[step] = errors[step - 1], turns[step - 1], sure[step - 1]
        for b in np.flatnonzero(going):
            actions[b] = drivers[b].act(observed["state"][b], observed["lidar"][b])
            belief = drivers[b].belief
            errors[step, b] = math.dist(belief.pose[:2], info["position"][b])
            turns[step, b] = abs(wrap_angle(belief.pose[2] - info["yaw"][b]))
            sure[step, b] = belief.confidence
        observed, _, terminated, truncated, info = env.step(actions)
        steps[going & terminated] = step + 1
        going &= ~(terminated | truncated)
    report(level, policy, (errors < 0.3) & (turns < math.radians(10)), errors, sure > SURE, steps)
    begin, updates = [d.seconds[0] for d in drivers], [s for d in drivers for s in d.seconds[1:]]
    print(f"  ms of begin {1e3 * np.mean(begin):.2f}, of an update {1e3 * np.mean(updates):.3f}", flush=True)


def report(level: int, policy: str, right: np.ndarray, errors: np.ndarray, sure: np.ndarray, steps: np.ndarray) -> None:
    """Prints a few lines; `[T, B]` right, errors (m), sure, and `[B]` steps to the goal."""
    until_sure = np.where(sure.any(axis=0), sure.argmax(axis=0), steps)  # or until the end
    print(f"level {level}, {policy}")
    print("  right after", ", ".join(f"{step}: {right[step].mean():.3f}" for step in STEPS))
    print("  sure after", ", ".join(f"{step}: {sure[step].mean():.3f}" for step in STEPS))
    print(f"  wrong but sure {(sure & ~right).mean():.5f}; steps until sure {until_sure.mean():.2f}", end="")
    print(f", 90 % {np.quantile(until_sure, 0.9):.0f}, 99 % {np.quantile(until_sure, 0.99):.0f}")
    median, largest = 1e3 * np.median(errors[right]), 1e3 * errors[right].max()
    print(f"  error when right: median {median:.3f} mm, largest {largest:.0f} mm")
    reached = steps < NUM_STEPS
    print(f"  goal reached {reached.mean():.3f}, in {steps[reached].mean():.1f} steps")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    for level in (1, 2, 3):
        for policy in ("wander", "goal", "disambiguate"):
            measure(level, policy, count)
