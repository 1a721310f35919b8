"""The replay and its hindsight, against a list of trajectories and by hand."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings, strategies
from mazebench_agents.common.replay import Hindsight, Replay

from mazebench.training.experience import Experience

# What the replay doesn't read: it makes rewards and ends for the goals that it relabels.
UNREAD = dict.fromkeys(("pose", "velocity", "reward", "terminated", "stream", "notes"))
NO_HINDSIGHT = Hindsight(ratio=0.0)
ALWAYS = Hindsight(ratio=1.0, mean_offset=2.0, window=10)
WINDOW = 5


class Row(NamedTuple):
    """A row as a plain value; x of its state is a number that no other row has, from which all else can be found."""

    x: int
    cell: int
    action: int | None  # None in the row after a trajectory's last step
    leg: Row | None  # its first row; None in that row itself
    trajectory: Row | None  # likewise
    start: int
    goal: int
    maze: int
    walls: tuple[bool, ...]  # on the map that the trajectory was shown


class Reference:
    """All rows that were ever written, by environment and in order; the replay keeps the last `length` of each."""

    def __init__(self, num_envs: int, length: int):
        self.length = length
        self.rows: list[list[Row]] = [[] for _ in range(num_envs)]
        self.where: dict[int, tuple[int, int]] = {}  # environment and position of a row, by its x

    def add(self, env: int, row: Row) -> None:
        self.where[row.x] = env, len(self.rows[env])
        self.rows[env].append(row)

    def is_kept(self, x: int) -> bool:
        env, position = self.where[x]
        return position >= len(self.rows[env]) - self.length

    def after(self, x: int, num_steps: int) -> list[Row]:
        """The row and those that follow it in its trajectory, up to `num_steps`."""
        env, position = self.where[x]
        found = [self.rows[env][position]]
        for row in self.rows[env][position + 1 : position + 1 + num_steps]:
            if found[-1].action is None or first_of(row) != first_of(found[-1]):
                break
            found.append(row)
        return found

    def outcome(self, x: int, goal: int, n: int) -> tuple[float, float, int]:
        """Reward, discount and the x of the last row of a return of up to n steps."""
        reward, (row, *later) = 0.0, self.after(x, n)
        for row in later:
            if row.cell == goal:
                return reward, 0.0, row.x
            reward -= 1
        return reward, 1.0, row.x


def first_of(row: Row) -> int:
    return (row.trajectory or row).x


def state_of(x: Any) -> np.ndarray:
    return np.pad(np.asarray(x, dtype=np.float32)[..., None], [(0, 0)] * np.ndim(x) + [(0, 11)])


def played(seed: int, num_envs: int, length: int, num_steps: int) -> tuple[Replay, Reference]:
    """A replay and its reference after random experience: legs, ends, and trajectories that are cut short."""
    rng, numbers = np.random.default_rng(seed), itertools.count(1)
    replay, reference = Replay(num_envs, num_envs * length, map_size=3), Reference(num_envs, length)
    row: list[Row | None] = [None] * num_envs
    ended = np.ones(num_envs, dtype=bool)
    for _ in range(num_steps):
        new_episode = ended | (rng.random(num_envs) < 0.05)  # as where a run was resumed
        new_context = new_episode | (rng.random(num_envs) < 0.2)
        ended = rng.random(num_envs) < 0.1
        cell, final_cell, goal, action = rng.integers(6, size=(4, num_envs))
        maze, walls = rng.integers(4, size=num_envs), rng.random((num_envs, 3, 3)) < 0.5
        x = np.array([next(numbers) for _ in range(num_envs)])
        final_x = np.array([next(numbers) for _ in range(num_envs)])
        for env in range(num_envs):
            before = row[env]
            begins = before is None or new_episode[env]
            now = Row(
                x=int(x[env]),
                cell=int(cell[env]),
                action=int(action[env]),
                leg=None if new_context[env] else before.leg or before,
                trajectory=None if begins else before.trajectory or before,
                start=int(cell[env]) if new_context[env] else before.start,
                goal=int(goal[env]) if new_context[env] else before.goal,
                maze=int(maze[env]) if begins else before.maze,
                walls=tuple(walls[env].ravel().tolist()) if begins else before.walls,
            )
            reference.add(env, now)
            if ended[env]:
                last = {"x": int(final_x[env]), "cell": int(final_cell[env]), "action": None}
                reference.add(env, now._replace(**last, leg=now.leg or now, trajectory=now.trajectory or now))
            row[env] = now
        context = np.zeros((num_envs, 4, 3, 3), dtype=np.float32)
        context[:, 0] = np.array([each.walls for each in row]).reshape(-1, 3, 3)
        replay.add(
            Experience(
                state=state_of(x),
                action=action,
                cell=cell,
                new_episode=new_episode,
                new_context=new_context,
                maze=np.array([each.maze for each in row]),
                start=np.array([each.start for each in row]),
                goal=np.array([each.goal for each in row]),
                ended=ended,
                final_state=state_of(final_x),
                final_cell=final_cell,
                context=context,
                sensors={},
                **UNREAD,
            )
        )
    return replay, reference


PLAYED = strategies.builds(
    played,
    seed=strategies.integers(0, 2**32),
    num_envs=strategies.integers(1, 3),
    length=strategies.integers(WINDOW + 1, 25),
    num_steps=strategies.integers(1, 60),
)
HINDSIGHT = strategies.builds(
    Hindsight,
    ratio=strategies.sampled_from([0.0, 1.0]),
    mean_offset=strategies.floats(1, 5),
    window=strategies.just(WINDOW),
    relabel_start=strategies.booleans(),
    keep_anchor=strategies.booleans(),
)


def check_group(reference: Reference, hindsight: Hindsight, sample: Any, g: int, x: np.ndarray) -> None:
    """Asserts that the context of group g is one that its steps, whose numbers are `x`, may be learned with."""
    rows = [reference.rows[env][position] for env, position in map(reference.where.get, x.tolist())]
    drawn = rows[0]
    assert all(reference.is_kept(row.x) for row in rows)
    assert drawn.action is not None

    # The goal is the leg's, or was reached by the drawn row's trajectory; all steps lie a window before some end.
    ahead = reference.after(drawn.x, WINDOW)
    if hindsight.ratio:
        ends = [row for row in ahead[1:] or ahead if row.cell == sample.contexts.goal[g]]
    else:
        assert sample.contexts.goal[g] == drawn.goal
        ends = [ahead[: WINDOW // 2 + 1][-1]]
    position = [reference.where[row.x][1] for row in rows]
    assert any(
        all(step == position[0] or end - WINDOW <= step < end for step in position)
        for end in (reference.where[row.x][1] for row in ends)
    )
    part = first_of if hindsight.relabel_start else lambda row: (row.leg or row).x
    assert {part(row) for row in rows} == {part(drawn)}

    # Where the context starts, and from where displacements are measured.
    earliest = rows[int(np.argmin(position))]
    moves = hindsight.relabel_start and hindsight.ratio
    assert sample.contexts.start[g] == (earliest.cell if moves else drawn.start)
    begin = drawn.trajectory or drawn
    origin = begin if hindsight.keep_anchor else earliest if moves else drawn.leg or drawn
    assert sample.contexts.origin[g].tolist() == [origin.x, 0]
    assert sample.contexts.maze[g] == drawn.maze
    assert tuple(sample.contexts.shown[g].ravel().tolist()) == drawn.walls


@settings(max_examples=60, deadline=None)
@given(PLAYED, HINDSIGHT, strategies.integers(1, 5), strategies.integers(0, 2**32))
def test_a_sample_is_what_the_trajectories_say(both, hindsight, n, seed):
    replay, reference = both
    assert replay.num_rows == sum(min(len(rows), reference.length) for rows in reference.rows)
    if not any(row.action is not None and reference.is_kept(row.x) for rows in reference.rows for row in rows):
        return
    sample = replay.sample(8, 3, n, hindsight=hindsight, rng=np.random.default_rng(seed))
    xs = sample.state[..., 0].astype(int)
    for g, k in np.ndindex(8, 3):
        x, goal = int(xs[g, k]), int(sample.contexts.goal[g])
        check_group(reference, hindsight, sample, g, xs[g])
        env, position = reference.where[x]
        row = reference.rows[env][position]
        reward, discount, last = reference.outcome(x, goal, n)
        assert sample.cell[g, k] == row.cell
        assert sample.next_state[g, k, 0] == last
        assert sample.valid[g, k] == (row.cell != goal and last != x)
        if sample.valid[g, k]:
            assert (sample.action[g, k], sample.reward[g, k], sample.discount[g, k]) == (row.action, reward, discount)


@settings(max_examples=60, deadline=None)
@given(PLAYED, HINDSIGHT, strategies.integers(1, 5), strategies.integers(0, 2**32))
def test_sequences_are_what_the_trajectories_say(both, hindsight, num_steps, seed):
    replay, reference = both
    if not any(row.action is not None and reference.is_kept(row.x) for rows in reference.rows for row in rows):
        return
    rng = np.random.default_rng(seed)
    sample = replay.sample_sequences(8, 2, num_steps, hindsight=hindsight, rng=rng)
    xs = sample.state[..., 0].astype(int)
    for g in range(8):
        check_group(reference, hindsight, sample, g, xs[g, :, 0])
        env, position = reference.where[int(xs[g, 0, 0])]
        drawn = reference.rows[env][position]
        anchor = (drawn.trajectory or drawn).cell if hindsight.keep_anchor else sample.contexts.start[g]
        assert sample.contexts.anchor[g] == anchor
        for s in range(2):
            rows = reference.after(int(xs[g, s, 0]), num_steps)
            exists = sample.exists[g, s]
            assert exists.tolist() == [step < len(rows) for step in range(num_steps + 1)]
            assert xs[g, s][exists].tolist() == [row.x for row in rows]
            assert sample.cell[g, s][exists].tolist() == [row.cell for row in rows]
            assert sample.action[g, s, : len(rows) - 1].tolist() == [row.action for row in rows[:-1]]


def filled(cells: list[int], goal: int, final_cell: int, priority_exponent: float = 0.0) -> Replay:
    """A replay of one trajectory through `cells`, one a step, then `final_cell`; state x and action count the steps."""
    replay = Replay(1, 100, priority_exponent)
    for step, cell in enumerate(cells):
        replay.add(
            Experience(
                state=state_of([step]),
                action=np.array([step % 6]),
                cell=np.array([cell]),
                new_episode=np.array([step == 0]),
                new_context=np.array([step == 0]),
                maze=np.array([0]),
                start=np.array([cells[0]]),
                goal=np.array([goal]),
                ended=np.array([step == len(cells) - 1]),
                final_state=state_of([len(cells)]),
                final_cell=np.array([final_cell]),
                context=np.zeros((1, 4, 3, 3), dtype=np.float32),
                sensors={},
                **UNREAD,
            )
        )
    return replay


def test_priorities_after_an_update_decide_what_is_drawn():
    replay = filled([10, 11, 12, 13], goal=99, final_cell=14, priority_exponent=1.0)
    replay.update_priorities(np.arange(4), np.array([0.099, 0.099, 8.999, 0.099]))
    sample = replay.sample(1000, 1, 1, hindsight=NO_HINDSIGHT, rng=np.random.default_rng(0), beta=1.0)
    share = (sample.state[:, 0, 0] == 2).mean()
    assert share == pytest.approx(9.0 / 9.3, abs=0.002)
    # The rare ones weigh 1, the frequent one in proportion less.
    np.testing.assert_allclose(sample.weight[sample.row == 2], 0.1 / 9.0, rtol=1e-5)
    np.testing.assert_allclose(sample.weight[sample.row != 2], 1.0, rtol=1e-5)


def test_last_row_of_a_trajectory_is_not_drawn_even_if_it_has_overwritten_a_row_that_was_learned_from():
    replay = filled([10, 11], goal=99, final_cell=12, priority_exponent=0.6)
    replay.update_priorities(np.array([2]), np.array([5.0]))
    assert (replay.sample(64, 1, 1, hindsight=NO_HINDSIGHT, rng=np.random.default_rng(0)).row < 2).all()


def test_saved_and_loaded_replay_samples_the_same(tmp_path):
    replay = filled(list(range(10, 40)), goal=99, final_cell=41, priority_exponent=0.6)
    replay.update_priorities(np.arange(20), np.linspace(0, 3, 20))
    replay.update_priorities(np.arange(20), np.linspace(0, 1, 20))
    replay.save(tmp_path / "replay.npz")
    loaded = Replay(1, 100, priority_exponent=0.6)
    loaded.load(tmp_path / "replay.npz")
    loaded.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "replay.npz").read_bytes()
    samples = [
        each.sample(16, 4, 3, hindsight=ALWAYS, rng=np.random.default_rng(3), beta=0.4) for each in (replay, loaded)
    ]
    np.testing.assert_equal(*samples)
