"""The rule book of a task: how an episode begins, what a step leads to, what is observed and rewarded."""

from __future__ import annotations

import math
from typing import Any, overload

import numpy as np

from mazebench.maps.kinds import KINDS
from mazebench.maps.maze import Cell
from mazebench.maps.real_buildings import ORIGINS
from mazebench.tasks.context import NUM_PLANES
from mazebench.tasks.episode import Episode, episode_level, perturbations_of, schedule_of
from mazebench.tasks.observation import Noise, OpenSensors, state_errors
from mazebench.tasks.perturbations.perturbation import Of, ShownMap, Standing, StateError
from mazebench.tasks.route import Event, Route, plan_route
from mazebench.tasks.schedule import DoorKeeper, Schedule
from mazebench.tasks.shown_map import is_blocked, leg_context, show_map
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import PROGRESS
from mazebench.tasks.tracks import TRACKS
from mazebench.world.angles import wrap_angle

_UNKNOWN = -1  # a way that would take long to measure
_WAITS = 0.05  # m; a step in which the body moves less counts as waited
_OUT_OF_SIGHT = 1e6  # m, where cameras do not see the goal's disc


class Names(np.ndarray):
    """An array of kinds or tracks as text, which libraries that have no texts take by DLPack as their numbers.

    The number is the index in `NAMES`, from 0 for "", and -1 for other names.
    """

    NAMES = ("", *KINDS, *ORIGINS, *TRACKS)

    def __dlpack__(self, **options: Any) -> Any:
        if self.dtype != object:  # what was computed of names
            return super().__dlpack__(**options)
        numbers = {name: number for number, name in enumerate(self.NAMES)}
        return np.array([numbers.get(name, -1) for name in self.flat]).reshape(self.shape).__dlpack__(**options)


@overload
def reward(reached: bool) -> float: ...
@overload
def reward(reached: np.ndarray) -> np.ndarray: ...
def reward(reached: bool | np.ndarray) -> float | np.ndarray:
    """Returns the reward of steps: 0 for a step that reaches the goal, else -1."""
    return reached - 1.0


class Rules:
    """Drive to the goal cell of a maze that was never seen before, with a map of it.

    These are the rules of B episodes, one in each of B environments. An environment calls `begin` and simulates; after
    each agent step it calls `advance` with the poses of its bodies.

    Actions: one of six, 0.16 s each: forward, backward, strafe_left, strafe_right, look_left, look_right. With
    `actions="four"`, one of those that are no strafe. With `actions="velocity"`, `[3]` velocities for 0.16 s, each in
    [-1, 1]: forward and left as shares of the top speed (together no faster than it), turning to the left as a share of
    the turn rate. With `actions="diff"`, `[2]`: forward and turning.

    Observations:

    - state: `[12]` float32: x, y, z (m); roll, pitch, yaw (rad, yaw in [-pi, pi)); velocity forward, left, up (m/s);
      angular velocity about the body's x, y, z (rad/s). With `position_noise`, x and y are noisy; with
      `odometry_noise`, the pose and the velocities are.
    - context: `[4, M, M]` float32, constant until the next landmark: the map, the map around the start, goal, start.
    - is_first: bool, only in dm_env and if episodes may have several legs: whether this context is new. Gymnasium's
      environments have it in `info`.
    - egocentric, depth, labels: `[H, H, 3]` uint8, `[H, H]` float32 (m, at most 10) and `[H, H]` uint8 (0 sky, 1 floor,
      2 wall, 3 goal), if `sensors` names them: pictures of the true world, with a disc at the goal.
    - lidar: `[32]` float32, if `sensors` names it: metres from the body's centre to the nearest wall of the true maze,
      at most 5, along horizontal rays; the first straight ahead, then counter-clockwise every 360 / 32 degrees. With
      `lidar_noise`, they are noisy, and may reach less far.

    Reward: -1 for each step, 0 for the step that reaches the goal cell; there is no discount on the way. With `reward`
    "progress", the cells by which the way to the goal has become shorter are added.

    Termination: when the body's centre is in the goal cell after a step (discount 0). Otherwise the episode is
    truncated (discount 1) after `time_limit` steps, in the hierarchical task of the last leg. A goal that is
    entered on the last step is reached.
    """

    def __init__(self, task: Task, num_envs: int, num_threads: int = 1, *, shows_goal: bool = True):
        self.task = task
        self._shows_goal = shows_goal  # whether the agent's cameras see the goal's disc
        self._num_threads = num_threads  # of the sensors; 0 for all cores
        self._sensors = OpenSensors(task)

        # The episodes; those of an environment that has none, or none yet, are None.
        self.episodes: list[Episode | None] = [None] * num_envs
        self.shown: list[ShownMap | None] = [None] * num_envs
        self.routes: list[Route | None] = [None] * num_envs
        self._state_errors: list[list[StateError]] = [[] for _ in range(num_envs)]
        self._noise: list[Noise] = [self._sensors.begin(None)] * num_envs
        self._standing: dict[int, list[Standing]] = {}  # of the episodes in which the building changes
        self._keepers: dict[int, DoorKeeper] = {}  # of the episodes in which doors move
        self.maze, self.level, self.distance = np.zeros((3, num_envs), dtype=np.int64)  # see `infos`
        texts = "", task.options.track or ""
        self.kind, self.track = (np.full(num_envs, text, dtype=object).view(Names) for text in texts)
        self.blocked = np.zeros(num_envs, dtype=bool)
        self._ways: list[np.ndarray | None] = [None] * num_envs  # [N * N] int, in cells from each cell to the goal
        self.active = np.zeros(num_envs, dtype=bool)  # whether the environment has an episode

        # The current legs. Cells are given as row * N + column.
        self.context = np.zeros((num_envs, NUM_PLANES, task.context_size, task.context_size), dtype=np.float32)
        self.marker = np.zeros((num_envs, 3))  # m, of the goal
        self.landmark = np.zeros(num_envs, dtype=np.int64)  # index of the leg
        self.start, self.target, self._goal = np.zeros((3, num_envs), dtype=np.int64)
        self.time_limit = np.zeros(num_envs, dtype=np.int64)  # agent steps
        self._deadline = np.zeros(num_envs, dtype=np.int64)  # the step at which the leg times out

        # What steps have led to.
        self.pose = np.zeros((num_envs, 3))  # x, y (m), yaw (rad, not wrapped)
        self.cell = np.zeros(num_envs, dtype=np.int64)  # of the body; agents must not use it
        self.way_left = np.zeros(num_envs, dtype=np.int64)  # see `infos`
        self.progress = np.zeros(num_envs)  # cells by which the last step made the way shorter, if it is rewarded
        self.path_length = np.zeros(num_envs)  # m
        self.steps, self.waited = np.zeros((2, num_envs), dtype=np.int64)
        self.is_first, self.reached, self.timed_out = np.zeros((3, num_envs), dtype=bool)
        self.goal_reached = np.zeros(num_envs, dtype=bool)  # also a goal that another one follows

    def begin(self, i: int, episode: Episode | None, task: Task | None = None) -> None:
        """Begins an episode in environment i, whose body must then be moved to `pose[i]`; None takes its episode.

        `task` is its task, another of `tasks_of_tracks`; by default that of these rules.
        """
        self.episodes[i], self.active[i] = episode, episode is not None
        self.is_first[i] = self.reached[i] = self.timed_out[i] = self.goal_reached[i] = False
        self._state_errors[i], self._noise[i] = [], self._sensors.begin(episode)
        self._standing.pop(i, None)
        self._keepers.pop(i, None)
        if episode is None:
            return

        # What the agent is shown and senses, and where it is sent.
        task = task or self.task
        self.shown[i] = shown = show_map(task, episode)
        self.routes[i] = route = plan_route(task, episode, shown)
        self._state_errors[i] = state_errors(task, episode)
        changes = (each.standing(rng) for each, rng in perturbations_of(task, episode, Of.BUILDING))
        if standing := [change for change in changes if change is not None]:
            self._standing[i] = standing
        if (schedule := schedule_of(task, episode)) is not None:
            self._keepers[i] = DoorKeeper(schedule, len(task.mazes))
        maze = task.mazes[episode.maze]
        self.maze[i], self.kind[i] = episode.maze, maze.kind
        self.level[i] = 0 if task.options.track is None else episode_level(task, episode)
        self.track[i] = task.options.track or ""
        self.pose[i] = (*maze.point(episode.start), episode.yaw)
        self.path_length[i] = self.steps[i] = self.waited[i] = self.progress[i] = 0
        self.cell[i] = episode.start[0] * task.size + episode.start[1]
        self._seek(i, route, shown)
        self._begin_leg(i, route, shown)

    def _seek(self, i: int, route: Route, shown: ShownMap) -> None:
        """Measures the way to the goal of environment i, which is new."""
        maze, start = self.task.standing[self.maze.item(i)].as_built, route.cells[0]
        self.blocked[i] = shown.walls is not maze.walls and is_blocked(maze.walls, shown.walls, (start, route.goal))
        self.distance[i] = self.way_left[i] = _UNKNOWN
        self._ways[i] = None
        if maze.keeps_distances or self.task.options.reward == PROGRESS:
            distances = maze.distances(route.goal)
            self.distance[i] = self.way_left[i] = distances[start]
            self._ways[i] = distances.ravel()

    def _begin_leg(self, i: int, route: Route, shown: ShownMap) -> None:
        size = self.task.size
        self.is_first[i] = True
        self.context[i] = leg_context(self.task, shown, route.start, route.target)
        ends = (route.start, route.target, route.goal)
        self.start[i], self.target[i], self._goal[i] = (row * size + column for row, column in ends)
        self.marker[i, :2] = self.task.standing[self.maze.item(i)].point(route.goal)
        self.time_limit[i], self._deadline[i] = route.time_limit, route.deadline
        self.landmark[i] = route.leg

    def advance(self, poses: np.ndarray, running: np.ndarray) -> list[int]:
        """Takes note of an agent step after which the bodies have `poses` (`[B, 3]`: x, y, yaw).

        Afterwards, `is_first`, `reached` and `timed_out` (`[B]` bool) say where the step began a new leg, reached the
        goal, or used up the time. It was taken where `running` (`[B]` bool); elsewhere the body must not have moved.

        Returns the environments in which another maze stands from now on.
        """
        self._move(poses, running)
        return self._change(running) if self._standing or self._keepers else []

    def _move(self, poses: np.ndarray, running: np.ndarray) -> None:
        """Takes note of where the bodies are, and of what that led to."""
        if len(poses) == 1 and running.item():  # plain numbers take a fourth of the time of arrays
            self._move_one(poses[0])
            return

        for happened in (self.is_first, self.reached, self.timed_out, self.goal_reached, self.progress):
            happened.fill(0)
        moved = poses[:, :2] - self.pose[:, :2]
        moved *= moved
        moved = np.sqrt(moved[:, 0] + moved[:, 1])
        self.path_length += moved
        self.pose[:] = poses
        self.steps += running
        self.waited += (moved < _WAITS) & running

        # All mazes have one size and one cell size, so the first one converts the points of all.
        cells = self.task.mazes[0].cell_index(self.pose[:, :2])
        entered = (cells != self.cell).nonzero()[0]
        self.cell[:] = cells
        ways, is_rewarded = self._ways, self.task.options.reward == PROGRESS
        for i, cell in zip(entered.tolist(), cells[entered].tolist(), strict=True):
            if (way := ways[i]) is not None:
                if is_rewarded:
                    self.progress[i] = self.way_left[i] - way[cell]
                self.way_left[i] = way[cell]

        # Nothing happens to a route unless one of these holds; then the route's own rules decide.
        due = (self.cell == self.target) | (self.cell == self._goal) | (self.steps >= self._deadline)
        for i in np.flatnonzero(due & running).tolist():
            self._follow_route(i, divmod(int(self.cell[i]), self.task.size))

    def _move_one(self, pose: np.ndarray) -> None:
        """Does what `advance` does, for a single environment."""
        self.is_first[0] = self.reached[0] = self.timed_out[0] = self.goal_reached[0] = False
        self.progress[0] = 0.0
        (last_x, last_y, _), (x, y, _) = self.pose[0].tolist(), pose.tolist()
        moved_x, moved_y = x - last_x, y - last_y
        moved = math.sqrt(moved_x * moved_x + moved_y * moved_y)
        self.path_length[0] += moved
        self.waited[0] += moved < _WAITS
        self.pose[0] = pose
        self.steps[0] = steps = self.steps.item(0) + 1
        row, column = cell = self.task.mazes[0].cell_at(x, y)
        index = row * self.task.size + column
        if index != self.cell.item(0):
            self.cell[0] = index
            if (way := self._ways[0]) is not None:
                if self.task.options.reward == PROGRESS:
                    self.progress[0] = self.way_left.item(0) - way.item(index)
                self.way_left[0] = way.item(index)
        if index == self.target.item(0) or index == self._goal.item(0) or steps >= self._deadline.item(0):
            self._follow_route(0, cell)

    def _follow_route(self, i: int, cell: Cell) -> None:
        """Takes note of what the step led to in environment i, whose body is in `cell`."""
        route, shown = self.routes[i], self.shown[i]
        assert route is not None
        assert shown is not None
        self.goal_reached[i] = cell == route.goal
        event = route.advance(cell, self.steps.item(i))
        if event is Event.NONE:
            return
        self.reached[i] = event is Event.REACHED
        self.timed_out[i] = event is Event.TIMEOUT
        if event is Event.LANDMARK:
            if self.task.options.num_goals > 1:
                self._seek(i, route, shown)
            self._begin_leg(i, route, shown)

    def _change(self, running: np.ndarray) -> list[int]:
        """Exchanges the mazes of buildings that change now, and measures the ways in them; returns where."""
        if len(self.maze) == 1 and not self._standing:  # as in `_move`
            (before,), point = self.maze.tolist(), self.pose[0, :2].tolist()
            self.maze[0] = maze = self._keepers[0].after(self.steps.item(0), before, point)
            return [0] if maze != before else []
        before = self.maze.copy()
        for i, standing in self._standing.items():
            for stands in standing if running[i] else ():
                cell = divmod(self.cell.item(i), self.task.size)
                self.maze[i] = stands(self.steps.item(i), self.maze.item(i), cell)
        if self._keepers:
            runs, steps, mazes, points = (each.tolist() for each in (running, self.steps, self.maze, self.pose[:, :2]))
            for i, keeper in self._keepers.items():
                if runs[i] and (maze := keeper.after(steps[i], mazes[i], points[i])) != mazes[i]:
                    self.maze[i] = maze

        changed = np.flatnonzero(self.maze != before).tolist()
        for i in changed:
            built, last = (self.task.standing[number].as_built for number in (self.maze.item(i), before.item(i)))
            if built is not last and self._ways[i] is not None and (route := self.routes[i]) is not None:
                self._ways[i] = ways = built.distances(route.goal).ravel()
                self.way_left[i] = ways[self.cell[i]]
        return changed

    def schedules(self) -> list[Schedule | None]:
        """Returns the schedule of the doors in each environment; None where none moves."""
        keepers = map(self._keepers.get, range(len(self.maze)))
        return [None if keeper is None else keeper.schedule for keeper in keepers]

    def rewards(self) -> np.ndarray:
        """Returns the rewards `[B]` float32 of the last step."""
        return (reward(self.reached) + self.progress).astype(np.float32)

    def reward(self, i: int) -> float:
        """Returns the reward of environment i for the last step."""
        return reward(self.reached.item(i)) + self.progress.item(i)

    def observe(self, states: np.ndarray, indices: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Returns `[K, ...]` by name: all observations but the context, of the environments `indices` (`[K]` int).

        None stands for all B. `states` (`[K, 12]` float64) are the true ones, to which errors are added in place. Each
        call draws new noise.
        """
        errors, noise, worlds = self._state_errors, self._noise, (self.maze, self.pose, self.marker)
        if indices is not None:
            chosen = indices.tolist()
            errors, noise = [errors[i] for i in chosen], [noise[i] for i in chosen]
            worlds = self.maze[indices], self.pose[indices], self.marker[indices]
        for i, of_state in enumerate(errors):
            for add_error in of_state:
                add_error(states[i])
        observed = {"state": states.astype(np.float32)}
        if self.task.options.sensors:
            maze, pose, marker = worlds
            if not self._shows_goal:
                marker = np.full(marker.shape, _OUT_OF_SIGHT)
            observed |= self._sensors.read(maze, pose, marker, noise, self._num_threads)
        return observed

    def infos(self) -> dict[str, np.ndarray]:
        """Returns `[B, ...]` by name: what Gymnasium's environments tell in `info`.

        It is for training and for records. Agents must not use it in an evaluation, which does not give it to them.

        - is_first: bool, whether the context is new: an episode or the leg to the next landmark began.
        - success: bool, whether the last goal is reached. goal_reached: whether the step reached a goal, which
          another one may follow.
        - steps: since the episode began. waited: those of them in which the body moved less than 0.05 m.
        - path_length: m. landmark: the leg's index.
        - time_limit: the agent steps of the leg; on a track they depend on its distance. steps_left: of them.
        - position: `[B, 2]` m, and yaw: rad, both the true ones.
        - distance: the cells of a shortest path from start to goal in the true maze. way_left: from the body to the
          goal. They are -1 in a maze of more than 2,048 free cells, where they take long, unless progress is rewarded.
          Doors that close while one drives count as open.
        - blocked: bool, whether a wall of the true maze stands in the shortest path on the shown map.
        - Of several goals, these three are of the present one.
        - maze: index among the task's mazes. kind: of the maze's layout, "" for one of your own.
        - track: "" without one. level: of the track, 0 without one. Kinds and tracks are `Names`.
        """
        return {
            "is_first": self.is_first.copy(),
            "success": self.reached.copy(),
            "goal_reached": self.goal_reached.copy(),
            "steps": self.steps.copy(),
            "waited": self.waited.copy(),
            "path_length": self.path_length.copy(),
            "position": self.pose[:, :2].copy(),
            "yaw": wrap_angle(self.pose[:, 2]),
            "maze": self.maze % len(self.task.mazes),
            "landmark": self.landmark.copy(),
            "time_limit": self.time_limit.copy(),
            "steps_left": self._deadline - self.steps,
            "way_left": self.way_left.copy(),
            "distance": self.distance.copy(),
            "blocked": self.blocked.copy(),
            "kind": self.kind.copy(),
            "track": self.track.copy(),
            "level": self.level.copy(),
        }

    def info(self, i: int) -> dict[str, Any]:
        """Returns the `infos` of environment i as plain values, in a fraction of the time."""
        steps = self.steps.item(i)
        return {
            "is_first": self.is_first.item(i),
            "success": self.reached.item(i),
            "goal_reached": self.goal_reached.item(i),
            "steps": steps,
            "waited": self.waited.item(i),
            "path_length": self.path_length.item(i),
            "position": self.pose[i, :2].copy(),
            "yaw": wrap_angle(self.pose.item(i, 2)),
            "maze": self.maze.item(i) % len(self.task.mazes),
            "landmark": self.landmark.item(i),
            "time_limit": self.time_limit.item(i),
            "steps_left": self._deadline.item(i) - steps,
            "way_left": self.way_left.item(i),
            "distance": self.distance.item(i),
            "blocked": self.blocked.item(i),
            "kind": self.kind[i],
            "track": self.track[i],
            "level": self.level.item(i),
        }
