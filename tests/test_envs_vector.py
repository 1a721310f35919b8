"""The vector environment plays bit for bit what the single ones play, and resets as Gymnasium says."""

from __future__ import annotations

import collections
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from simple_mazes import corridor

import mazebench
from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.episode import Episode
from mazebench.tasks.rules import Names
from mazebench.tasks.task import Task

NUM_STEPS = 200
SEEDS = [3, 1000, 17, 4]
NUM_ENVS = len(SEEDS)
INFOS = (
    *("is_first", "success", "steps", "path_length", "position", "maze", "landmark"),
    *("time_limit", "steps_left", "way_left", "distance", "blocked", "kind", "track", "level"),
)
FORWARD, LOOK_LEFT = 0, 4


def dfs_mazes() -> list[Maze]:
    rng = np.random.default_rng(0)
    return [generate("dfs", 9, rng) for _ in range(3)]


def small_mazes() -> list[Maze]:
    """So small that random actions now and then go from corner to corner."""
    rng = np.random.default_rng(0)
    return [generate("obstacles", 6, rng) for _ in range(4)]


SPECS = {
    "local": Task.of(mazes=dfs_mazes(), distances=[1, 2], time_limit=25),
    "hierarchical": Task.of("hierarchical", mazes=small_mazes(), landmark_distance=2, time_limit=12),
    "map_flip": Task.of("hierarchical", mazes=small_mazes(), landmark_distance=2, time_limit=12, map_flip=0.2),
    "map_warp": Task.of(mazes=dfs_mazes(), distances=[1, 2], time_limit=25, map_warp=0.2),
    "position_noise": Task.of(mazes=dfs_mazes(), distances=[1, 2], time_limit=25, position_noise=0.4),
    "context_size": Task.of(mazes=dfs_mazes(), distances=[1, 2], time_limit=25, context_size=6),
    "progress": Task.of(mazes=dfs_mazes(), distances=[1, 2], time_limit=25, reward="progress"),
    "num_goals": Task.of(mazes=dfs_mazes(), distances=[1, 2], time_limit=15, num_goals=3),
    "fresh": Task.of(kinds=("dfs", "obstacles"), size=13, fresh=True, distances=[1, 2], time_limit=25),
    "cell_size": Task.of(mazes=dfs_mazes(), cell_size=0.6, distances=[1, 2], time_limit=25),
}
every_spec = pytest.mark.parametrize("spec", SPECS.values(), ids=SPECS)


class Step(NamedTuple):
    """Outputs of one environment: after a step that ended an episode, the state before the next one began."""

    state: np.ndarray
    context: np.ndarray
    reward: float | None
    terminated: bool
    truncated: bool
    info: dict


def random_actions(num_steps: int, num_envs: int, seed: int = 0) -> np.ndarray:
    """`[num_steps, num_envs]`, kept up for a few steps each and mostly forward, so that bodies get somewhere."""
    rng = np.random.default_rng(seed)
    actions = rng.integers(6, size=(num_steps, num_envs))
    actions[rng.random(actions.shape) < 0.4] = FORWARD
    for step in range(1, num_steps):
        kept = rng.random(num_envs) < 0.5
        actions[step, kept] = actions[step - 1, kept]
    return actions


def play_dm_env(spec: Task, seed: int, actions: np.ndarray) -> Iterator[Step]:
    env = Environment(spec)

    def seen(time_step) -> Step:
        ended, info = time_step.last(), env.task.rules.info(0)
        info = {name: info[name] for name in INFOS}
        terminated = ended and time_step.discount == 0
        state, context = time_step.observation["state"], time_step.observation["context"]
        return Step(state, context, time_step.reward, terminated, ended and not terminated, info)

    yield seen(env.reset(seed=seed))
    for action in actions:
        time_step = env.step(action)
        yield seen(time_step)
        if time_step.last():
            yield seen(env.reset())


def play_vector(env: MazeVectorEnv, actions: np.ndarray, seeds) -> list[list[Step]]:
    """Outputs of each slot, in the order in which a single environment would give them."""
    slots = range(env.num_envs)

    def seen(slot: int, observation: dict, infos: dict, reward: float | None = None, ends=(False, False)) -> Step:
        info = {name: infos[name][slot] for name in INFOS}
        return Step(observation["state"], observation["context"], reward, *ends, info)

    def of_slot(observations: dict, slot: int) -> dict:
        return {key: value[slot] for key, value in observations.items()}

    observations, infos = env.reset(seed=seeds)
    steps = [[seen(slot, of_slot(observations, slot), infos)] for slot in slots]
    for action in actions:
        observations, rewards, terminated, truncated, infos = env.step(action)
        for slot in slots:
            reward, ends = rewards[slot], (bool(terminated[slot]), bool(truncated[slot]))
            if any(ends):
                steps[slot].append(seen(slot, infos["final_obs"][slot], infos["final_info"], reward, ends))
                reward, ends = None, (False, False)
            steps[slot].append(seen(slot, of_slot(observations, slot), infos, reward, ends))
    return steps


def stacked(steps: Iterable[Step]) -> list[np.ndarray]:
    """Each output, of all steps in one array."""
    rows = ((*step[:5], *step.info.values()) for step in steps)
    return list(map(np.array, zip(*rows, strict=True)))


class TestSameEpisodes:
    @every_spec
    def test_steps_are_those_of_dm_env(self, spec):
        actions = random_actions(NUM_STEPS, NUM_ENVS)
        kinds = collections.Counter()
        for slot, steps in enumerate(play_vector(MazeVectorEnv(spec, NUM_ENVS), actions, SEEDS)):
            np.testing.assert_equal(stacked(steps), stacked(play_dm_env(spec, SEEDS[slot], actions[:, slot])))
            kinds["terminated"] += sum(step.terminated for step in steps)
            kinds["truncated"] += sum(step.truncated for step in steps)
            kinds["mazes"] += len({step.info["maze"] for step in steps}) - 1
            kinds["switches"] += sum(step.info["is_first"] and step.reward is not None for step in steps)
        # What is to be compared did happen.
        assert kinds["terminated"] > 0
        assert kinds["truncated"] > 0
        assert kinds["mazes"] > 0
        assert (kinds["switches"] > 0) == spec.has_legs

    @pytest.mark.parametrize("name", ["hierarchical", "position_noise"])
    @pytest.mark.parametrize(("num_envs", "num_threads"), [(1, 1), (7, 2)])
    def test_steps_do_not_depend_on_the_number_of_environments_or_threads(self, name, num_envs, num_threads):
        spec, others = SPECS[name], random_actions(100, num_envs, seed=1)
        mine = random_actions(100, 1)[:, 0]
        for slot in {0, num_envs - 1}:
            others[:, slot] = mine
            seeds = list(range(50, 50 + num_envs))
            seeds[slot] = SEEDS[0]
            env = MazeVectorEnv(spec, num_envs, num_threads=num_threads)
            steps = play_vector(env, others, seeds)[slot]
            np.testing.assert_equal(stacked(steps), stacked(play_dm_env(spec, SEEDS[0], mine)))


class TestSeeds:
    @pytest.mark.parametrize(
        ("constructor_seed", "seed", "seeds"),
        [(None, 7, [7, 8, 9]), (None, [9, 9, 2], [9, 9, 2]), (7, None, [7, 8, 9])],
    )
    def test_seeds_are_those_of_single_environments_whose_streams_go_on(self, constructor_seed, seed, seeds):
        env = MazeVectorEnv(SPECS["local"], 3, seed=constructor_seed)
        first, _ = env.reset(seed=seed)
        second, _ = env.reset(seed=[5, None, None])
        singles = [MazeEnv(SPECS["local"]) for _ in seeds]
        for slot, single in enumerate(singles):
            np.testing.assert_array_equal(first["state"][slot], single.reset(seed=seeds[slot])[0]["state"])
            expected = single.reset(seed=5 if slot == 0 else None)[0]["state"]
            np.testing.assert_array_equal(second["state"][slot], expected)

    def test_gymnasiums_generator_follows_the_seed_as_elsewhere(self):
        env, sync, single = MazeVectorEnv(SPECS["local"], 2), sync_vector_env(SPECS["local"]), MazeEnv(SPECS["local"])
        for seed in (np.int64(5), 5):
            env.reset(seed=seed), single.reset(seed=5)
            assert env.np_random_seed == single.np_random_seed == 5
            assert env.np_random.random() == single.np_random.random()
        drawn = []
        for _ in range(2):
            env.reset(seed=SEEDS[:2]), sync.reset(seed=SEEDS)
            assert env.np_random_seed == sync.np_random_seed[:2]
            drawn.append(env.np_random.random())
        assert drawn[0] == drawn[1]


def sync_vector_env(spec: Task, mode: AutoresetMode = AutoresetMode.SAME_STEP) -> SyncVectorEnv:
    return SyncVectorEnv([lambda: MazeEnv(spec)] * NUM_ENVS, autoreset_mode=mode)


def assert_same_infos(ours, theirs) -> None:
    """Observations and infos of two vector environments are the same."""
    for key in ("state", "context"):
        np.testing.assert_array_equal(ours[0][key], theirs[0][key], strict=True)
    compare_infos(ours[1], theirs[1])


def compare_infos(ours: dict, theirs: dict) -> None:
    """Each info is the same where its mask says that there is one."""
    assert ours.keys() == theirs.keys()
    for key in theirs:
        if key == "final_info":
            compare_infos(ours[key], theirs[key])
        else:
            mask = theirs.get(f"_{key}", ...)
            one, other = ours[key][mask], theirs[key][mask]
            if key == "final_obs":
                np.testing.assert_equal(list(one), list(other))
            else:
                assert np.array_equal(one, other), key


class TestAutoreset:
    @pytest.mark.parametrize("mode", AutoresetMode)
    @pytest.mark.parametrize("spec", [SPECS["hierarchical"], SPECS["position_noise"], SPECS["fresh"]])
    def test_steps_and_infos_are_those_of_a_sync_vector_env(self, spec, mode):
        ours, theirs = MazeVectorEnv(spec, NUM_ENVS, autoreset_mode=mode), sync_vector_env(spec, mode)
        assert ours.metadata["autoreset_mode"] is mode
        assert ours.observation_space == theirs.observation_space
        assert ours.action_space == theirs.action_space
        assert_same_infos(ours.reset(seed=SEEDS), theirs.reset(seed=SEEDS))
        num_ended = 0
        for action in random_actions(150, NUM_ENVS):
            one, other = ours.step(action), theirs.step(action)
            for expected, found, dtype in zip(other[1:4], one[1:4], (np.float32, bool, bool), strict=True):
                np.testing.assert_array_equal(found, expected)
                assert found.dtype == dtype
            assert_same_infos((one[0], one[4]), (other[0], other[4]))
            ended = one[2] | one[3]
            num_ended += ended.sum()
            if mode is AutoresetMode.DISABLED and ended.any():
                resets = (env.reset(options={"reset_mask": ended.copy()}) for env in (ours, theirs))
                assert_same_infos(*resets)
        assert num_ended > 3

    def test_a_mode_may_be_given_by_its_value(self):
        env = gymnasium.make_vec("mazebench/Local-13-v1", num_envs=2, autoreset_mode="NextStep")
        assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP

    @pytest.mark.parametrize("mode", AutoresetMode)
    def test_a_masked_reset_begins_episodes_where_the_mask_says_so(self, mode):
        spec = SPECS["position_noise"]  # what is observed elsewhere must not be drawn anew
        ours, theirs = MazeVectorEnv(spec, NUM_ENVS, autoreset_mode=mode), sync_vector_env(spec, mode)
        assert_same_infos(ours.reset(seed=SEEDS), theirs.reset(seed=SEEDS))
        for action in random_actions(10, NUM_ENVS):
            mask = action < 3
            steps = [env.step(action) for env in (ours, theirs)]
            assert_same_infos(*((step[0], step[4]) for step in steps))
            resets = (env.reset(seed=7, options={"reset_mask": mask.copy()}) for env in (ours, theirs))
            assert_same_infos(*resets)

    def test_a_step_is_refused_where_an_episode_ended_if_autoreset_is_disabled(self):
        env = MazeVectorEnv(Task.of(mazes=corridor(), time_limit=1), 3, autoreset_mode=AutoresetMode.DISABLED)
        env.reset(seed=0)
        env.step(np.full(3, LOOK_LEFT))
        env.reset(options={"reset_mask": np.array([True, False, False])})
        with pytest.raises(gymnasium.error.ResetNeeded, match=r"reset_mask.*environments 1, 2$"):
            env.step(np.full(3, LOOK_LEFT))

    def test_a_reset_of_some_before_all_is_refused(self):
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            MazeVectorEnv(SPECS["local"], 2).reset(options={"reset_mask": np.array([True, False])})


class TestEpisodeSource:
    """Episodes in a corridor for three slots: the goal is 6 steps forward."""

    def env(self, num_episodes: int, time_limit: int = 100, **arguments) -> MazeVectorEnv:
        waiting = collections.deque(Episode(0, (1, 1), (1, 4), 0.0, seed) for seed in range(num_episodes))
        spec = Task.of(mazes=corridor(), time_limit=time_limit)
        return MazeVectorEnv(spec, 3, episode_source=lambda slot: waiting.popleft() if waiting else None, **arguments)

    def test_slots_stand_still_when_episodes_run_out(self):
        env = self.env(num_episodes=3)
        env.reset()
        for _ in range(6):
            last = env.step(np.zeros(3, dtype=int))
        np.testing.assert_array_equal(last[2], [True, True, True])
        for action in (FORWARD, LOOK_LEFT):
            for _ in range(120):  # more than the time limit
                observation, rewards, terminated, truncated, infos = env.step(np.full(3, action))
                np.testing.assert_array_equal(rewards, 0)
                assert not (terminated | truncated).any()
                assert "final_obs" not in infos
                np.testing.assert_array_equal(infos["position"], last[4]["position"])
                np.testing.assert_array_equal(observation["state"], last[0]["state"])
        assert env.episodes == [None, None, None]

    def test_a_slot_goes_on_with_the_next_episode(self):
        # The slot that reaches its goal gets the fourth episode; the two others turn until their time is out.
        env = self.env(num_episodes=4, time_limit=8)
        env.reset()
        ended = np.zeros(3, dtype=int)
        for _ in range(6 + 6):
            _, _, terminated, truncated, infos = env.step(np.array([FORWARD, LOOK_LEFT, LOOK_LEFT]))
            ended += terminated | truncated
        np.testing.assert_array_equal(ended, [2, 1, 1])
        np.testing.assert_array_equal(infos["_final_info"], [True, False, False])


class TestSeveralTracks:
    @pytest.mark.parametrize("context_size", [None, 31])
    def test_episodes_are_those_of_each_track(self, context_size):
        tracks = ("building", "adrift", "rough")
        envs = mazebench.make_vec(tracks, 24, level=(1, 3), context_size=context_size, seed=0)
        observations, infos = envs.reset()
        assert observations["context"].shape == (24, 4, context_size or 62, context_size or 62)
        assert set(infos["track"]) == set(tracks)
        for track in tracks:
            i = list(infos["track"]).index(track)
            with mazebench.make(track, level=(1, 3)) as env:
                observation, info = env.reset(options={"episode": envs.episodes[i]})
                for name in ("level", "maze", "distance", "time_limit", "blocked"):
                    assert info[name] == infos[name][i], name
                np.testing.assert_array_equal(observation["lidar"], observations["lidar"][i])
                if len(observation["context"][0]) == len(observations["context"][i, 0]):
                    np.testing.assert_array_equal(observation["context"], observations["context"][i])

    def test_an_environment_draws_a_track_in_each_episode(self):
        envs = mazebench.make_vec(("building", "rebuilt"), 1, kinds="dfs", fresh=True, seed=0)
        assert {envs.reset()[1]["track"].item() for _ in range(20)} == {"building", "rebuilt"}
        envs.draw_distances([5])
        assert {envs.reset()[1]["distance"].item() for _ in range(4)} == {5}

    @pytest.mark.parametrize("tracks", [(), ("building", "local"), ("building", "building")], ids=str)
    def test_others_than_different_tracks_are_refused(self, tracks):
        with pytest.raises(
            InputError, match="expected different tracks of building, rebuilt, adrift, rough, doors, found"
        ):
            mazebench.make_vec(tracks)


class TestArrays:
    def test_arrays_may_be_written_to(self):
        spec = SPECS["hierarchical"]
        actions = random_actions(40, NUM_ENVS)
        clean, dirty = MazeVectorEnv(spec, NUM_ENVS), MazeVectorEnv(spec, NUM_ENVS)
        expected, found = clean.reset(seed=1), dirty.reset(seed=1)
        for action in actions:
            assert_same_infos((found[0], found[-1]), (expected[0], expected[-1]))
            self.scribble(found)
            expected, found = clean.step(action), dirty.step(action.copy())
            for one, other in zip(expected[1:4], found[1:4], strict=True):
                np.testing.assert_array_equal(one, other)

    def test_other_libraries_take_kinds_and_tracks_as_numbers(self):
        torch = pytest.importorskip("torch")
        _, infos = mazebench.make_vec(("building", "rough"), 4, seed=0).reset()
        for name in ("kind", "track"):
            numbers = torch.from_dlpack(infos[name])
            assert [Names.NAMES[number] for number in numbers] == infos[name].tolist()
        assert torch.from_dlpack(infos["track"] == "rough").tolist() == [name == "rough" for name in infos["track"]]

    @pytest.mark.parametrize("mode", ["NextStep", "Disabled"])
    def test_gymnasium_turns_them_into_tensors(self, mode):
        pytest.importorskip("array_api_compat")
        torch = pytest.importorskip("torch")
        wrappers = pytest.importorskip("gymnasium.wrappers.vector")
        envs = wrappers.NumpyToTorch(mazebench.make_vec("building", 2, autoreset_mode=mode))
        observations, infos = envs.reset(seed=0)
        *_, others = envs.step(torch.zeros(2, dtype=torch.int64))
        assert all(isinstance(each, torch.Tensor) for part in (observations, infos, others) for each in part.values())

    def scribble(self, result: tuple) -> None:
        for part in result:
            if isinstance(part, dict):
                self.scribble(tuple(part.values()))
            elif isinstance(part, np.ndarray) and part.dtype != object:
                part[...] = 1 if part.dtype == bool else 77


class TestBadInput:
    def test_a_step_before_the_first_reset_is_refused(self):
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            MazeVectorEnv(SPECS["local"], 3).step(np.zeros(3, dtype=int))

    @pytest.mark.parametrize(
        "options",
        [
            3,
            {"episode": None},
            {"reset_mask": np.ones(2)},
            {"reset_mask": np.zeros(2, bool)},
        ],
    )
    def test_wrong_options_are_refused(self, options):
        with pytest.raises(InputError, match=r"options as a dict|unknown option 'episode'|expected reset_mask"):
            MazeVectorEnv(SPECS["local"], 2).reset(options=options)
