"""A replay of trajectories, and samples of it whose goals are relabelled in hindsight.

`B` is the number of environments, `G` the number of groups in a sample, `K` of steps in a group, `n` of the return's
steps. A cell is given by its index, row * N + column. A row is one observation; its context is not stored, but built
again from maze, start and goal.
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import NamedTuple

import numpy as np

from mazebench.storage.arrays import read_arrays
from mazebench.tasks.context import GLOBAL_MAP
from mazebench.training.experience import Experience

from .sum_tree import SumTree

_ROW_FIELDS = (
    "state",
    "origin",
    "anchor_origin",
    "action",
    "cell",
    "start",
    "anchor",
    "goal",
    "maze",
    "trajectory",
    "leg",
)
_ENV_FIELDS = ("next", "current", "current_leg", "leg_origin", "current_anchor", "current_anchor_origin", "maps")
_NO_ACTION = -1  # in the row after a trajectory's last step
_STATE_SIZE = 12


class Sample(NamedTuple):
    """G groups of K steps; the steps of a group share one context, so it is encoded once for all of them."""

    row: np.ndarray  # [G] int, the rows whose priorities the groups were drawn by
    weight: np.ndarray  # [G] float32, importance weights, at most 1
    maze: np.ndarray  # [G] int
    start: np.ndarray  # [G] int, cell
    goal: np.ndarray  # [G] int, cell
    origin: np.ndarray  # [G, 2] float32, x and y observed where the context's leg started
    cell: np.ndarray  # [G, K] int, the body's true cell at `state`
    state: np.ndarray  # [G, K, 12] float32
    action: np.ndarray  # [G, K] int
    reward: np.ndarray  # [G, K] float32, the sum of up to n rewards towards `goal`
    discount: np.ndarray  # [G, K] float32, of `next_state`: 0 where the goal was reached within the n steps, else 1
    next_state: np.ndarray  # [G, K, 12] float32, after up to n steps; a trajectory's last one where it ends before
    valid: np.ndarray  # [G, K] bool, whether the step was taken outside of the goal
    shown: np.ndarray | None  # [G, N, N] bool, walls on the shown maps; None unless the replay keeps them


class SequenceSample(NamedTuple):
    """G groups of S sequences of L steps and so L + 1 states; the sequences of a group share one context."""

    maze: np.ndarray  # [G] int
    start: np.ndarray  # [G] int, cell
    goal: np.ndarray  # [G] int, cell
    anchor: np.ndarray  # [G] int, the cell where `origin` was observed
    origin: np.ndarray  # [G, 2] float32, x and y observed where the context's leg started, or the trajectory
    state: np.ndarray  # [G, S, L + 1, 12] float32
    cell: np.ndarray  # [G, S, L + 1] int, the body's true cell at `state`
    action: np.ndarray  # [G, S, L] int, taken in the first L states
    exists: np.ndarray  # [G, S, L + 1] bool, whether the trajectory goes as far; then its last state is repeated
    shown: np.ndarray | None  # [G, N, N] bool, walls on the shown maps; None unless the replay keeps them


@dataclasses.dataclass(frozen=True)
class Hindsight:
    """How the goals of a sample are relabelled."""

    ratio: float = 0.8  # share of relabelled groups
    mean_offset: float = 16.0  # steps ahead of the row at which the goal was reached; geometric
    window: int = 60  # steps; a goal lies at most as far ahead, and a group's steps at most as far before the goal
    relabel_start: bool = False  # whether the context's start becomes the cell of the group's first step
    keep_anchor: bool = False  # whether displacements are measured from the trajectory's start, not from the leg's


class _Groups(NamedTuple):
    """The rows of a sample's groups and their contexts: see `Sample`."""

    row: np.ndarray  # [G]
    env: np.ndarray  # [G]
    steps: np.ndarray  # [G, K], indices in the ring
    maze: np.ndarray  # [G]
    start: np.ndarray  # [G]
    goal: np.ndarray  # [G]
    anchor: np.ndarray  # [G]
    origin: np.ndarray  # [G, 2]


class Replay:
    """A ring of rows for each of B environments."""

    def __init__(self, num_envs: int, capacity: int, priority_exponent: float = 0.0, *, map_size: int = 0):
        """Makes an empty replay.

        Args:
          num_envs: B.
          capacity: the number of rows of all environments together.
          priority_exponent: of the errors in the priorities (Schaul et al. 2016); with 0, all rows are drawn alike.
          map_size: N, if the map that each trajectory is shown is kept, read from contexts of N x N; else 0.
        """
        self._length = max(2, capacity // num_envs)  # rows of one environment
        self._num_envs = num_envs
        shape = (num_envs, self._length)
        self._state = np.zeros((*shape, _STATE_SIZE), dtype=np.float32)
        self._origin = np.zeros((*shape, 2), dtype=np.float32)
        self._anchor_origin = np.zeros((*shape, 2), dtype=np.float32)
        self._action = np.full(shape, _NO_ACTION, dtype=np.int8)
        self._cell = np.zeros(shape, dtype=np.uint16)
        self._start = np.zeros(shape, dtype=np.uint16)
        self._anchor = np.zeros(shape, dtype=np.uint16)
        self._goal = np.zeros(shape, dtype=np.uint16)
        self._maze = np.zeros(shape, dtype=np.uint32)
        self._trajectory = np.full(shape, -1, dtype=np.int64)  # numbers that no two trajectories of a ring share
        self._leg = np.full(shape, -1, dtype=np.int64)  # likewise, of the leg to one goal
        # The row that each environment writes next, counted without wrapping.
        self._next = np.zeros(num_envs, dtype=np.int64)
        self._current = np.zeros(num_envs, dtype=np.int64)  # the trajectory each environment is in
        self._current_leg = np.zeros(num_envs, dtype=np.int64)
        self._leg_origin = np.zeros((num_envs, 2), dtype=np.float32)
        self._current_anchor = np.zeros(num_envs, dtype=np.int64)  # the cell where its trajectory started
        self._current_anchor_origin = np.zeros((num_envs, 2), dtype=np.float32)
        self._tree = SumTree(num_envs * self._length)
        self._map_size = map_size
        # Bits of the maps, by trajectory; no more trajectories are stored than rows.
        self._maps = np.zeros((num_envs, self._length, (map_size**2 + 7) // 8), dtype=np.uint8)
        self._exponent = priority_exponent
        self._largest_priority = 1.0

    @property
    def num_rows(self) -> int:
        """The number of rows that are stored."""
        return int(np.minimum(self._next, self._length).sum())

    def save(self, path: pathlib.Path) -> None:
        """Writes the rows in use and everything that sampling depends on."""
        used = slice(0, min(self._length, int(self._next.max())))
        rows = {name: getattr(self, f"_{name}")[:, used] for name in _ROW_FIELDS}
        leaves = self._tree.priorities(np.arange(self._num_envs * self._length)).reshape(self._num_envs, -1)[:, used]
        envs = {name: getattr(self, f"_{name}") for name in _ENV_FIELDS}
        np.savez(path, **rows, **envs, priorities=leaves, largest_priority=self._largest_priority)

    def load(self, path: pathlib.Path) -> None:
        """Restores what `save` wrote.

        Raises:
          InputError: if the file is damaged.
        """
        loaded = read_arrays(path, "replay")
        used = loaded["priorities"].shape[1]
        for name in _ROW_FIELDS:
            getattr(self, f"_{name}")[:, :used] = loaded[name]
        for name in _ENV_FIELDS:
            getattr(self, f"_{name}")[:] = loaded[name]
        items = np.arange(self._num_envs * self._length).reshape(self._num_envs, -1)[:, :used]
        self._tree.set(items.ravel(), loaded["priorities"].ravel())
        self._largest_priority = float(loaded["largest_priority"])

    @property
    def num_bytes(self) -> int:
        """The memory of all rows, used or not, and of maps."""
        arrays = [getattr(self, f"_{name}") for name in (*_ROW_FIELDS, "maps")]
        return sum(array.nbytes for array in arrays)

    def add(self, experience: Experience, first_env: int = 0) -> None:
        """Stores one step of each of the environments from `first_env` on."""
        columns = np.arange(len(experience.action))
        envs = first_env + columns
        self._current[envs] += experience.new_episode
        self._current_leg[envs] += experience.new_context
        self._leg_origin[envs[experience.new_context]] = experience.state[experience.new_context, :2]
        begins = experience.new_episode
        if self._map_size:
            walls = experience.context[begins, GLOBAL_MAP].reshape(-1, self._map_size**2) > 0.5
            self._maps[envs[begins], self._current[envs[begins]] % self._length] = np.packbits(walls, axis=-1)
        self._current_anchor[envs[begins]] = experience.start[begins]
        self._current_anchor_origin[envs[begins]] = experience.state[begins, :2]
        self._write(envs, columns, experience, experience.state, experience.cell, experience.action)
        ended = np.flatnonzero(experience.ended)
        if len(ended):
            no_action = np.full(len(columns), _NO_ACTION)
            self._write(envs[ended], ended, experience, experience.final_state, experience.final_cell, no_action)

    def _write(
        self,
        envs: np.ndarray,
        columns: np.ndarray,
        experience: Experience,
        state: np.ndarray,
        cell: np.ndarray,
        action: np.ndarray,
    ) -> None:
        """Writes a row for each of `envs`, from the `columns` of the experience."""
        at = (envs, self._next[envs] % self._length)
        self._state[at] = state[columns]
        self._cell[at] = cell[columns]
        self._action[at] = action[columns]
        self._origin[at] = self._leg_origin[envs]
        self._anchor[at] = self._current_anchor[envs]
        self._anchor_origin[at] = self._current_anchor_origin[envs]
        self._start[at] = experience.start[columns]
        self._goal[at] = experience.goal[columns]
        self._maze[at] = experience.maze[columns]
        self._trajectory[at] = self._current[envs]
        self._leg[at] = self._current_leg[envs]
        priority = np.where(action[columns] == _NO_ACTION, 0.0, self._largest_priority)
        self._tree.set(at[0] * self._length + at[1], priority)
        self._next[envs] += 1

    def sample(
        self,
        num_groups: int,
        num_steps: int,
        n: int,
        *,
        hindsight: Hindsight,
        rng: np.random.Generator,
        beta: float = 0.0,
    ) -> Sample:
        """Draws groups by priority and relabels a share of them with goals that were reached later in the trajectory.

        The goal of a relabelled group is the cell in which the body was some steps after the drawn row. Rewards, ends
        and the context's goal follow from that. The map stays as it was; so does the start, unless
        `hindsight.relabel_start` is set.

        Args:
          num_groups, num_steps: G and K.
          n: largest number of steps of a return.
          hindsight: how to relabel.
          rng: the source of all draws.
          beta: exponent of the importance weights, 0 for none (Schaul et al. 2016).
        """
        group = self._draw_groups(num_groups, num_steps, hindsight, rng)
        env, steps, goal = group.env[:, None], group.steps, group.goal[:, None]
        reward, discount, last = self._returns(env, steps, goal, n)
        return Sample(
            row=group.row,
            weight=self._weights(group.row, beta),
            maze=group.maze,
            start=group.start,
            goal=group.goal,
            origin=group.origin,
            cell=self._cell[env, steps].astype(np.int64),
            state=self._state[env, steps],
            action=self._action[env, steps].astype(np.int64),
            reward=reward,
            discount=discount,
            next_state=self._state[env, last],
            valid=(self._cell[env, steps] != goal) & (last != steps),
            shown=self._shown_walls(group),
        )

    def sample_sequences(
        self,
        num_groups: int,
        num_sequences: int,
        num_steps: int,
        *,
        hindsight: Hindsight,
        rng: np.random.Generator,
    ) -> SequenceSample:
        """Draws groups as `sample` does, of sequences of `num_steps` L, or fewer where their trajectory ends."""
        group = self._draw_groups(num_groups, num_sequences, hindsight, rng)

        # From the first row of each sequence on, as long as its trajectory goes.
        env = group.env[:, None]
        index, going = group.steps, np.ones(group.steps.shape, dtype=bool)
        indices, exists = [index], [going]
        for _ in range(num_steps):
            going = going & self._has_next(env, index)
            index = np.where(going, (index + 1) % self._length, index)
            indices.append(index)
            exists.append(going)
        env, steps = env[..., None], np.stack(indices, axis=-1)
        return SequenceSample(
            maze=group.maze,
            start=group.start,
            goal=group.goal,
            anchor=group.anchor,
            origin=group.origin,
            state=self._state[env, steps],
            cell=self._cell[env, steps].astype(np.int64),
            action=np.maximum(self._action[env, steps[..., :-1]], 0).astype(np.int64),
            exists=np.stack(exists, axis=-1),
            shown=self._shown_walls(group),
        )

    def _draw_groups(self, num_groups: int, num_steps: int, hindsight: Hindsight, rng: np.random.Generator) -> _Groups:
        """Draws the rows of groups, and relabels a share of them."""
        row = self._tree.sample(num_groups, rng)
        env, index = np.divmod(row, self._length)

        # The goal: that of the leg, or the cell that the trajectory reached some steps later.
        offset = np.minimum(rng.geometric(1 / hindsight.mean_offset, size=num_groups), hindsight.window)
        reached = self._forward(env, index, offset)
        relabelled = rng.random(num_groups) < hindsight.ratio
        goal = np.where(relabelled, self._cell[env, reached], self._goal[env, index]).astype(np.int64)

        # The steps: the drawn one, and others in a window before the goal is reached, or around the drawn one.
        end = np.where(relabelled, reached, self._forward(env, index, np.full_like(index, hindsight.window // 2)))
        part = self._trajectory if hindsight.relabel_start else self._leg
        steps = self._draw_steps(env, index, end, part, num_steps, hindsight.window, rng)

        # Where the context starts, and from where displacements are measured.
        start, origin = self._start[env, index].astype(np.int64), self._origin[env, index]
        if hindsight.relabel_start:
            age = (self._next[env, None] - 1 - steps) % self._length
            first = np.take_along_axis(steps, age.argmax(axis=1)[:, None], axis=1)[:, 0]  # each group's earliest step
            start = np.where(relabelled, self._cell[env, first], start)
            origin = np.where(relabelled[:, None], self._state[env, first, :2], origin)
        anchor = start
        if hindsight.keep_anchor:
            anchor, origin = self._anchor[env, index].astype(np.int64), self._anchor_origin[env, index]
        return _Groups(
            row=row,
            env=env,
            steps=steps,
            maze=self._maze[env, index].astype(np.int64),
            start=start,
            goal=goal,
            anchor=anchor,
            origin=origin,
        )

    def _shown_walls(self, group: _Groups) -> np.ndarray | None:
        if not self._map_size:
            return None
        trajectory = self._trajectory.reshape(-1)[group.row]
        maps = self._maps[group.env, trajectory % self._length]
        shape = (-1, self._map_size, self._map_size)
        return np.unpackbits(maps, axis=-1, count=self._map_size**2).reshape(shape).astype(bool)

    def update_priorities(self, row: np.ndarray, error: np.ndarray) -> None:
        """Sets the priorities of `row` `[K]`, of a sample, by the errors `[K]` of learning."""
        if self._exponent == 0 or not len(row):
            return
        priority = (np.abs(error) + 1e-3) ** self._exponent
        # Meanwhile a trajectory's last row, which must not be drawn, may have overwritten a row.
        priority[self._action.reshape(-1)[row] == _NO_ACTION] = 0.0
        self._largest_priority = max(self._largest_priority, float(priority.max()))
        self._tree.set(row, priority)

    def _weights(self, row: np.ndarray, beta: float) -> np.ndarray:
        priority = self._tree.priorities(row)
        return ((priority.min() / priority) ** beta).astype(np.float32)

    def _forward(self, env: np.ndarray, index: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """Returns the index up to `offset` rows after `index` in its trajectory, found by jumps of halving length."""
        trajectory = self._trajectory[env, index]
        here = index
        jump = 1 << int(offset.max()).bit_length()
        left = offset.copy()
        while jump:
            there = (here + np.minimum(jump, left)) % self._length
            ok = (self._trajectory[env, there] == trajectory) & self._is_later(env, here, there)
            moved = np.where(ok, np.minimum(jump, left), 0)
            here = (here + moved) % self._length
            left = left - moved
            jump >>= 1
        return here

    def _is_later(self, env: np.ndarray, here: np.ndarray, there: np.ndarray) -> np.ndarray:
        """Returns whether the row at `there` was written after the one at `here`, or is the same."""
        newest = self._next[env] - 1
        age_here, age_there = (newest - here) % self._length, (newest - there) % self._length
        return age_there <= age_here

    def _draw_steps(
        self,
        env: np.ndarray,
        index: np.ndarray,
        end: np.ndarray,
        part: np.ndarray,
        num_steps: int,
        window: int,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """Returns indices `[G, K]`: the drawn row, then others of the same `part`, at most `window` rows before `end`.

        A row that would lie outside of its part is replaced by the drawn row.
        """
        back = rng.integers(1, window + 1, size=(len(env), num_steps))
        back[:, 0] = (end - index) % self._length
        steps = (end[:, None] - back) % self._length
        same = part[env[:, None], steps] == part[env, index][:, None]
        inside = same & self._is_later(env[:, None], steps, end[:, None])
        return np.where(inside, steps, index[:, None])

    def _returns(
        self, env: np.ndarray, steps: np.ndarray, goal: np.ndarray, n: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns reward sums, discounts and last indices `[G, K]` of returns of up to n steps towards `goal`.

        A step that ends in the goal is rewarded 0 and ends the return with discount 0; any other step is rewarded -1.
        A trajectory that ends earlier was cut short: its return bootstraps from its last state.
        """
        reward = np.zeros(steps.shape, dtype=np.float32)
        going, hit = np.ones(steps.shape, dtype=bool), np.zeros(steps.shape, dtype=bool)
        last = steps.copy()
        for _ in range(n):
            going &= self._has_next(env, last)
            last = np.where(going, (last + 1) % self._length, last)
            hit |= going & (self._cell[env, last] == goal)
            reward -= going & ~hit
            going &= ~hit
        return reward, (~hit).astype(np.float32), last

    def _has_next(self, env: np.ndarray, index: np.ndarray) -> np.ndarray:
        """Returns whether the row after `index` belongs to the same trajectory."""
        after = (index + 1) % self._length
        # The newest row has no next one yet; where collecting began anew, the next row is of another trajectory.
        newest = index == (self._next[env] - 1) % self._length
        same = self._trajectory[env, after] == self._trajectory[env, index]
        return (self._action[env, index] != _NO_ACTION) & ~newest & same
