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

from mazebench.storage.array_files import read_arrays
from mazebench.tasks.context import GLOBAL_MAP
from mazebench.tasks.rules import reward
from mazebench.training.experience import Experience

from .sum_tree import SumTree

_NO_ACTION = -1  # in the row after a trajectory's last step
# Without gaps between the fields, whose bytes would be undefined in a file.
_ROW = np.dtype(
    [
        ("trajectory", np.int64),  # a number that no two trajectories of a ring share
        ("leg", np.int64),  # likewise, of the leg to one goal
        ("state", np.float32, 12),
        ("origin", np.float32, 2),  # x and y observed where the leg started
        ("anchor_origin", np.float32, 2),  # likewise, the trajectory
        ("maze", np.uint32),
        ("cell", np.uint16),
        ("start", np.uint16),  # the cell where the leg started
        ("anchor", np.uint16),  # the cell where the trajectory started
        ("goal", np.uint16),
        ("action", np.int32),
    ]
)


class Contexts(NamedTuple):
    """The contexts of G groups; the steps of a group share one, so that it is encoded once for all of them."""

    maze: np.ndarray  # [G] int
    start: np.ndarray  # [G] int, cell
    goal: np.ndarray  # [G] int, cell
    anchor: np.ndarray  # [G] int, the cell where `origin` was observed
    origin: np.ndarray  # [G, 2] float32, x and y observed where the context's leg started, or the trajectory
    shown: np.ndarray | None  # [G, N, N] bool, walls on the shown maps; None unless the replay keeps them


class Sample(NamedTuple):
    """G groups of K steps."""

    row: np.ndarray  # [G] int, the rows whose priorities the groups were drawn by
    weight: np.ndarray  # [G] float32, importance weights, at most 1
    contexts: Contexts
    cell: np.ndarray  # [G, K] int, the body's true cell at `state`
    state: np.ndarray  # [G, K, 12] float32
    action: np.ndarray  # [G, K] int
    reward: np.ndarray  # [G, K] float32, the sum of up to n rewards towards the context's goal
    discount: np.ndarray  # [G, K] float32, of `next_state`: 0 where the goal was reached within the n steps, else 1
    next_state: np.ndarray  # [G, K, 12] float32, after up to n steps; a trajectory's last one where it ends before
    valid: np.ndarray  # [G, K] bool, whether the step was taken outside of the goal


class SequenceSample(NamedTuple):
    """G groups of S sequences of L steps and so L + 1 states."""

    contexts: Contexts
    state: np.ndarray  # [G, S, L + 1, 12] float32
    cell: np.ndarray  # [G, S, L + 1] int, the body's true cell at `state`
    action: np.ndarray  # [G, S, L] int, taken in the first L states
    exists: np.ndarray  # [G, S, L + 1] bool, whether the trajectory goes as far; then its last state is repeated


@dataclasses.dataclass(frozen=True)
class Hindsight:
    """Settings of the relabelling of goals in a sample."""

    ratio: float = 0.8  # share of relabelled groups
    mean_offset: float = 16.0  # steps ahead of the row at which the goal was reached; geometric
    window: int = 60  # steps; a goal lies at most as far ahead, and a group's steps at most as far before the goal
    relabel_start: bool = False  # whether the context's start becomes the cell of the group's first step
    keep_anchor: bool = False  # whether displacements are measured from the trajectory's start, not from the leg's


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
        self._rows = np.zeros((num_envs, self._length), _ROW)
        self._rows["action"] = self._rows["trajectory"] = self._rows["leg"] = -1
        self._next = np.zeros(num_envs, dtype=np.int64)  # the row each environment writes next, without wrapping
        self._current = np.zeros(num_envs, _ROW)  # the leg and the trajectory each environment is in
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
        leaves = self._tree.priorities(np.arange(self._num_envs * self._length)).reshape(self._num_envs, -1)[:, used]
        np.savez(
            path,
            rows=self._rows[:, used],
            next=self._next,
            current=self._current,
            maps=self._maps,
            priorities=leaves,
            largest_priority=self._largest_priority,
        )

    def load(self, path: pathlib.Path) -> None:
        """Restores what `save` wrote.

        Raises:
          InputError: if the file is damaged.
        """
        loaded = read_arrays(path, "replay")
        used = loaded["rows"].shape[1]
        self._rows[:, :used] = loaded["rows"]
        self._next, self._current, self._maps = loaded["next"], loaded["current"], loaded["maps"]
        items = np.arange(self._num_envs * self._length).reshape(self._num_envs, -1)[:, :used]
        self._tree.set(items.ravel(), loaded["priorities"].ravel())
        self._largest_priority = float(loaded["largest_priority"])

    @property
    def num_bytes(self) -> int:
        """The memory of all rows, used or not, and of maps."""
        return self._rows.nbytes + self._maps.nbytes

    def add(self, experience: Experience) -> None:
        """Stores one step of each environment."""
        envs = np.arange(self._num_envs)
        begins, begins_leg = experience.new_episode, experience.new_context
        current = self._current
        current["trajectory"] += begins
        current["leg"] += begins_leg
        current["origin"][begins_leg] = experience.state[begins_leg, :2]
        current["anchor_origin"][begins] = experience.state[begins, :2]
        current["anchor"][begins] = experience.start[begins]
        for name in ("start", "goal", "maze"):
            current[name] = getattr(experience, name)
        if self._map_size:
            walls = experience.context[begins, GLOBAL_MAP].reshape(-1, self._map_size**2) > 0.5
            self._maps[envs[begins], current["trajectory"][begins] % self._length] = np.packbits(walls, axis=-1)
        self._write(envs, experience.state, experience.cell, experience.action)
        if (ended := experience.ended).any():
            no_action = np.full(ended.sum(), _NO_ACTION)
            self._write(envs[ended], experience.final_state[ended], experience.final_cell[ended], no_action)

    def _write(self, envs: np.ndarray, state: np.ndarray, cell: np.ndarray, action: np.ndarray) -> None:
        """Writes a row for each of `envs`."""
        rows, index = self._current[envs], self._next[envs] % self._length
        rows["state"], rows["cell"], rows["action"] = state, cell, action
        self._rows[envs, index] = rows
        self._tree.set(envs * self._length + index, np.where(action == _NO_ACTION, 0.0, self._largest_priority))
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
        row, steps, contexts = self._draw_groups(num_groups, num_steps, hindsight, rng)
        env, goal = row[:, None] // self._length, contexts.goal[:, None]

        # Returns. A step that ends in the goal ends its return with discount 0; a trajectory that ends earlier was cut
        # short, so that its return bootstraps from its last state.
        total = np.zeros(steps.shape, dtype=np.float32)
        going, hit = np.ones(steps.shape, dtype=bool), np.zeros(steps.shape, dtype=bool)
        last = steps.copy()
        for _ in range(n):
            going &= self._has_next(env, last)
            last = np.where(going, (last + 1) % self._length, last)
            hit |= going & (self._rows["cell"][env, last] == goal)
            total += going * reward(hit)
            going &= ~hit

        rows, priority = self._rows[env, steps], self._tree.priorities(row)
        return Sample(
            row=row,
            weight=((priority.min() / priority) ** beta).astype(np.float32),
            contexts=contexts,
            cell=rows["cell"].astype(np.int64),
            state=rows["state"],
            action=rows["action"].astype(np.int64),
            reward=total,
            discount=(~hit).astype(np.float32),
            next_state=self._rows["state"][env, last],
            valid=(rows["cell"] != goal) & (last != steps),
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
        row, index, contexts = self._draw_groups(num_groups, num_sequences, hindsight, rng)

        # From the first row of each sequence on, as long as its trajectory goes.
        env, going = row[:, None] // self._length, np.ones(index.shape, dtype=bool)
        indices, exists = [index], [going]
        for _ in range(num_steps):
            going = going & self._has_next(env, index)
            index = np.where(going, (index + 1) % self._length, index)
            indices.append(index)
            exists.append(going)
        rows = self._rows[env[..., None], np.stack(indices, axis=-1)]
        return SequenceSample(
            contexts=contexts,
            state=rows["state"],
            cell=rows["cell"].astype(np.int64),
            action=np.maximum(rows["action"][..., :-1], 0).astype(np.int64),
            exists=np.stack(exists, axis=-1),
        )

    def _draw_groups(
        self, num_groups: int, num_steps: int, hindsight: Hindsight, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, Contexts]:
        """Draws rows `[G]`, indices in the ring of groups' steps `[G, K]`, and contexts, a share of them relabelled."""
        row = self._tree.sample(num_groups, rng)
        env, index = np.divmod(row, self._length)
        drawn = self._rows[env, index]

        # The goal: that of the leg, or the cell that the trajectory reached some steps later.
        offset = np.minimum(rng.geometric(1 / hindsight.mean_offset, size=num_groups), hindsight.window)
        reached = self._forward(env, index, offset)
        relabelled = rng.random(num_groups) < hindsight.ratio
        goal = np.where(relabelled, self._rows["cell"][env, reached], drawn["goal"]).astype(np.int64)

        # The steps: the drawn one, and others in a window before the goal is reached, or around the drawn one.
        # The drawn row replaces each that would lie outside of its leg, or of its trajectory.
        end = np.where(relabelled, reached, self._forward(env, index, np.full_like(index, hindsight.window // 2)))
        part = self._rows["trajectory" if hindsight.relabel_start else "leg"]
        back = rng.integers(1, hindsight.window + 1, size=(num_groups, num_steps))
        back[:, 0] = (end - index) % self._length
        steps = (end[:, None] - back) % self._length
        inside = part[env[:, None], steps] == part[env, index][:, None]
        inside &= self._is_later(env[:, None], steps, end[:, None])
        steps = np.where(inside, steps, index[:, None])

        # Where the context starts, and from where displacements are measured.
        start, origin = drawn["start"].astype(np.int64), drawn["origin"]
        if hindsight.relabel_start:
            age = (self._next[env, None] - 1 - steps) % self._length
            first = np.take_along_axis(steps, age.argmax(axis=1)[:, None], axis=1)[:, 0]
            earliest = self._rows[env, first]  # step of each group
            start = np.where(relabelled, earliest["cell"], start)
            origin = np.where(relabelled[:, None], earliest["state"][:, :2], origin)
        anchor = start
        if hindsight.keep_anchor:
            anchor, origin = drawn["anchor"].astype(np.int64), drawn["anchor_origin"]

        # The map that the trajectory was shown.
        shown = None
        if self._map_size:
            bits = np.unpackbits(self._maps[env, drawn["trajectory"] % self._length], axis=-1, count=self._map_size**2)
            shown = bits.reshape(-1, self._map_size, self._map_size).astype(bool)
        return row, steps, Contexts(drawn["maze"].astype(np.int64), start, goal, anchor, origin, shown)

    def update_priorities(self, row: np.ndarray, error: np.ndarray) -> None:
        """Sets the priorities of `row` `[K]`, of a sample, by the errors `[K]` of learning."""
        if self._exponent == 0 or not len(row):
            return
        priority = (np.abs(error) + 1e-3) ** self._exponent
        # Meanwhile a trajectory's last row, which must not be drawn, may have overwritten a row.
        priority[self._rows["action"][np.divmod(row, self._length)] == _NO_ACTION] = 0.0
        self._largest_priority = max(self._largest_priority, float(priority.max()))
        self._tree.set(row, priority)

    def _forward(self, env: np.ndarray, index: np.ndarray, offset: np.ndarray) -> np.ndarray:
        """Returns the index up to `offset` rows after `index` in its trajectory, found by jumps of halving length."""
        trajectories, here = self._rows["trajectory"], index
        jump = 1 << int(offset.max()).bit_length()
        left = offset.copy()
        while jump:
            there = (here + np.minimum(jump, left)) % self._length
            ok = (trajectories[env, there] == trajectories[env, index]) & self._is_later(env, here, there)
            moved = np.where(ok, np.minimum(jump, left), 0)
            here = (here + moved) % self._length
            left = left - moved
            jump >>= 1
        return here

    def _is_later(self, env: np.ndarray, here: np.ndarray, there: np.ndarray) -> np.ndarray:
        """Returns whether the row at `there` was written after the one at `here`, or is the same."""
        newest = self._next[env] - 1
        return (newest - there) % self._length <= (newest - here) % self._length

    def _has_next(self, env: np.ndarray, index: np.ndarray) -> np.ndarray:
        """Returns whether the row after `index` belongs to the same trajectory."""
        after = (index + 1) % self._length
        # The newest row has no next one yet; where collecting began anew, the next row is of another trajectory.
        newest = index == (self._next[env] - 1) % self._length
        rows = self._rows[env, index]
        same = self._rows["trajectory"][env, after] == rows["trajectory"]
        return (rows["action"] != _NO_ACTION) & ~newest & same
