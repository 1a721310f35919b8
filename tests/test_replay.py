"""The replay and its hindsight, on trajectories one can check by hand."""

import numpy as np
import pytest
from mazebench_agents.common.replay import Hindsight, Replay

from mazebench.training.experience import Experience

NO_HINDSIGHT = Hindsight(ratio=0.0)
ALWAYS = Hindsight(ratio=1.0, mean_offset=2.0, window=10)


def make_experience(**values):
    """One environment's step; state x counts the steps."""
    defaults = {
        "state": np.zeros((1, 12), dtype=np.float32),
        "action": np.array([0]),
        "cell": np.array([0]),
        "new_episode": np.array([False]),
        "new_context": np.array([False]),
        "maze": np.array([0]),
        "start": np.array([0]),
        "goal": np.array([99]),
        "ended": np.array([False]),
        "final_state": np.zeros((1, 12), dtype=np.float32),
        "final_cell": np.array([0]),
        "context": np.zeros((1, 4, 3, 3), dtype=np.float32),
        "sensors": {},
        "final_sensors": {},
    }
    return Experience(**{**defaults, **values})


def state(x):
    values = np.zeros((1, 12), dtype=np.float32)
    values[0, 0] = x
    return values


def fill(replay, cells, goal=99, final_cell=None, first_x=0):
    """A trajectory through `cells`, one a step, then `final_cell`; the action of step i is i % 6."""
    for step, cell in enumerate(cells):
        last = final_cell is not None and step == len(cells) - 1
        replay.add(
            make_experience(
                state=state(first_x + step),
                action=np.array([step % 6]),
                cell=np.array([cell]),
                new_episode=np.array([step == 0]),
                new_context=np.array([step == 0]),
                start=np.array([cells[0]]),
                goal=np.array([goal]),
                ended=np.array([last]),
                final_state=state(first_x + len(cells)),
                final_cell=np.array([final_cell or 0]),
            )
        )


def by_step(sample):
    """{x of the state: (reward, discount, x of the next state)} of the valid steps."""
    return {
        int(s[0]): (float(r), float(d), int(n[0]))
        for s, r, d, n, valid in zip(
            sample.state.reshape(-1, 12),
            sample.reward.ravel(),
            sample.discount.ravel(),
            sample.next_state.reshape(-1, 12),
            sample.valid.ravel(),
            strict=True,
        )
        if valid
    }


def test_three_step_returns_towards_the_original_goal_are_those_done_by_hand():
    replay = Replay(1, 100)
    fill(replay, [10, 10, 11, 11, 12], goal=13, final_cell=13)
    steps = by_step(replay.sample(64, 4, 3, NO_HINDSIGHT, np.random.default_rng(0)))
    # Step 4 ends in the goal: reward 0, and nothing follows. Step 3 pays one step before it, step 2 two.
    assert steps[4] == (0.0, 0.0, 5)
    assert steps[3] == (-1.0, 0.0, 5)
    assert steps[2] == (-2.0, 0.0, 5)
    assert steps[1] == (-3.0, 1.0, 4)
    assert steps[0] == (-3.0, 1.0, 3)


def test_return_over_the_end_of_a_trajectory_that_was_cut_short_goes_on_from_its_last_state():
    replay = Replay(1, 100)
    fill(replay, [10, 11, 12], goal=99, final_cell=13)
    steps = by_step(replay.sample(64, 4, 5, NO_HINDSIGHT, np.random.default_rng(0)))
    assert steps == {0: (-3.0, 1.0, 3), 1: (-2.0, 1.0, 3), 2: (-1.0, 1.0, 3)}


def test_relabelled_goals_were_reached_later_and_end_the_return_at_the_first_hit():
    replay = Replay(1, 100)
    cells = [10, 11, 12, 11, 13]
    fill(replay, cells, goal=99, final_cell=14)
    sample = replay.sample(256, 3, 4, ALWAYS, np.random.default_rng(0))
    path = [*cells, 14]
    for group in range(256):
        goal = sample.goal[group]
        for k in range(3):
            if not sample.valid[group, k]:
                continue
            step = int(sample.state[group, k, 0])
            assert path[step] != goal
            hits = [later for later in range(step + 1, len(path)) if path[later] == goal]
            assert hits, "a relabelled goal lies ahead of every step of its group"
            wanted = min(hits[0] - step, 4, len(path) - 1 - step)
            reached = hits[0] - step <= 4
            assert sample.reward[group, k] == -(wanted - 1 if reached else wanted)
            assert sample.discount[group, k] == (0.0 if reached else 1.0)
            assert sample.next_state[group, k, 0] == step + wanted
    assert (sample.maze == 0).all()
    assert (sample.start == 10).all()
    assert set(sample.goal.tolist()) <= set(path)


def test_relabelled_start_is_the_cell_of_the_groups_first_step():
    replay = Replay(1, 100)
    cells = [10, 11, 12, 13, 14, 15, 16]
    fill(replay, cells, goal=99, final_cell=17)
    moving = Hindsight(ratio=1.0, mean_offset=3.0, window=10, relabel_start=True)
    sample = replay.sample(64, 3, 1, moving, np.random.default_rng(0))
    first = sample.state[:, :, 0].min(axis=1).astype(int)
    np.testing.assert_array_equal(sample.start, np.array(cells)[first])
    np.testing.assert_array_equal(sample.origin[:, 0], first)


@pytest.mark.parametrize("keep_anchor", [True, False])
def test_anchor_is_the_trajectorys_start_or_moves_with_the_contexts(keep_anchor):
    replay = Replay(1, 100)
    cells = [10, 11, 12, 13, 14, 15, 16]
    fill(replay, cells, goal=99, final_cell=17)
    fill(replay, [30, 31, 32], goal=99, final_cell=33, first_x=100)
    hindsight = Hindsight(ratio=1.0, mean_offset=3.0, window=10, relabel_start=True, keep_anchor=keep_anchor)
    sample = replay.sample_sequences(64, 3, 2, hindsight, np.random.default_rng(0))
    second = sample.state[:, 0, 0, 0] >= 100
    assert second.any()
    assert not second.all()
    if keep_anchor:
        np.testing.assert_array_equal(sample.anchor, np.where(second, 30, 10))
        np.testing.assert_array_equal(sample.origin[:, 0], np.where(second, 100, 0))
    else:
        np.testing.assert_array_equal(sample.anchor, sample.start)
        np.testing.assert_array_equal(sample.origin[:, 0], sample.state[:, :, 0, 0].min(axis=1))


def test_sample_never_crosses_trajectories():
    replay = Replay(1, 1000)
    fill(replay, [10, 11, 12], final_cell=13)
    fill(replay, [20, 21, 22, 23], final_cell=24, first_x=100)
    sample = replay.sample(256, 4, 5, ALWAYS, np.random.default_rng(0))
    first = sample.state[:, :, 0] < 100
    np.testing.assert_array_equal(first, np.broadcast_to(first[:, :1], first.shape))
    np.testing.assert_array_equal(sample.goal < 20, first[:, 0])
    np.testing.assert_array_equal(sample.next_state[:, :, 0] < 100, first)


def test_return_never_goes_on_into_a_trajectory_that_began_before_the_last_one_ended():
    replay = Replay(1, 1000)
    fill(replay, [10, 11, 12])  # cut short, as where a run was resumed: no last row
    fill(replay, [20, 21, 22], final_cell=23, first_x=100)
    steps = by_step(replay.sample(256, 2, 5, NO_HINDSIGHT, np.random.default_rng(0)))
    assert steps[0] == (-2.0, 1.0, 2)
    assert steps[1] == (-1.0, 1.0, 2)
    assert 2 not in steps


def test_sample_after_the_ring_wrapped_holds_only_what_is_left():
    replay = Replay(1, 8)
    for begin in range(0, 60, 20):
        fill(replay, [begin + step for step in range(1, 6)], final_cell=begin + 6, first_x=begin)
    assert replay.num_rows == 8
    sample = replay.sample(256, 4, 3, ALWAYS, np.random.default_rng(0))
    assert sample.state[:, :, 0].min() >= 20
    same = (sample.state[:, :, 0] >= 40) == (sample.goal >= 40)[:, None]
    assert same.all()
    assert (sample.next_state[:, :, 0] >= sample.state[:, :, 0]).all()


def test_newest_step_without_a_next_state_is_not_learned_from():
    replay = Replay(1, 100)
    fill(replay, [10, 11, 12])
    sample = replay.sample(128, 2, 1, NO_HINDSIGHT, np.random.default_rng(0))
    assert not (sample.valid & (sample.state[:, :, 0] == 2)).any()


def test_priorities_after_an_update_decide_what_is_drawn():
    replay = Replay(1, 100, priority_exponent=1.0)
    fill(replay, [10, 11, 12, 13], final_cell=14)
    rows = np.arange(4)
    replay.update_priorities(rows, np.array([0.099, 0.099, 8.999, 0.099]))
    sample = replay.sample(1000, 1, 1, NO_HINDSIGHT, np.random.default_rng(0), beta=1.0)
    share = (sample.state[:, 0, 0] == 2).mean()
    assert share == pytest.approx(9.0 / 9.3, abs=0.002)
    # The rare ones weigh 1, the frequent one in proportion less.
    np.testing.assert_allclose(sample.weight[sample.row == 2], 0.1 / 9.0, rtol=1e-5)
    np.testing.assert_allclose(sample.weight[sample.row != 2], 1.0, rtol=1e-5)


def test_last_row_of_a_trajectory_is_never_drawn():
    replay = Replay(1, 100, priority_exponent=0.6)
    fill(replay, [10, 11], final_cell=12)
    sample = replay.sample(64, 1, 1, NO_HINDSIGHT, np.random.default_rng(0))
    assert sample.state[:, 0, 0].max() == 1
    replay.update_priorities(np.array([2]), np.array([5.0]))
    assert (replay.sample(64, 1, 1, NO_HINDSIGHT, np.random.default_rng(0)).row < 2).all()


def test_saved_and_loaded_replay_samples_the_same(tmp_path):
    replay = Replay(1, 50, priority_exponent=0.6)
    fill(replay, list(range(10, 40)), final_cell=41)
    replay.update_priorities(np.arange(20), np.linspace(0, 3, 20))
    replay.update_priorities(np.arange(20), np.linspace(0, 1, 20))
    replay.save(tmp_path / "replay.npz")
    other = Replay(1, 50, priority_exponent=0.6)
    other.load(tmp_path / "replay.npz")
    assert other._largest_priority == replay._largest_priority > 1.5
    for mine, theirs in zip(
        replay.sample(16, 4, 3, ALWAYS, np.random.default_rng(3), 0.4),
        other.sample(16, 4, 3, ALWAYS, np.random.default_rng(3), 0.4),
        strict=True,
    ):
        np.testing.assert_array_equal(mine, theirs)


def test_sequences_are_consecutive_and_stop_with_their_trajectory():
    replay = Replay(1, 100)
    fill(replay, [3, 4, 5, 6], final_cell=7)  # states x 0 to 4
    fill(replay, [20, 21, 22], first_x=10)  # still running: states x 10 to 12
    sample = replay.sample_sequences(64, 2, 3, ALWAYS, np.random.default_rng(0))
    first = {0: [0, 1, 2, 3], 1: [1, 2, 3, 4], 2: [2, 3, 4], 3: [3, 4], 10: [10, 11, 12], 11: [11, 12], 12: [12]}
    cell = {0: 3, 1: 4, 2: 5, 3: 6, 4: 7, 10: 20, 11: 21, 12: 22}
    seen = set()
    for state_, cells, action, exists in zip(
        sample.state.reshape(-1, 4, 12),
        sample.cell.reshape(-1, 4),
        sample.action.reshape(-1, 3),
        sample.exists.reshape(-1, 4),
        strict=True,
    ):
        xs = state_[exists, 0].astype(int).tolist()
        assert xs == first[xs[0]]
        assert cells[exists].tolist() == [cell[x] for x in xs]
        assert action[: len(xs) - 1].tolist() == [x % 10 for x in xs[:-1]]
        seen.add(xs[0])
    assert seen == set(first)


def test_sequences_have_goals_that_were_reached_later_if_relabelled():
    replay = Replay(1, 100)
    fill(replay, [3, 4, 5, 6], goal=50, final_cell=7)
    half = Hindsight(ratio=0.5, mean_offset=2.0, window=10)
    sample = replay.sample_sequences(200, 1, 2, half, np.random.default_rng(0))
    assert (sample.goal[~sample.relabelled] == 50).all()
    assert 60 < sample.relabelled.sum() < 140
    # The row that was drawn comes first, in a group of one sequence.
    first = sample.state[:, 0, 0, 0].astype(int)
    later = np.array([3, 4, 5, 6, 7])
    for x, goal in zip(first[sample.relabelled], sample.goal[sample.relabelled], strict=True):
        assert goal in later[x + 1 :]
    assert (sample.start == 3).all()  # the start stays
