"""Speed on this machine, as ratios taken in one run: what an environment costs beside the bare simulation in it.

Each ratio is the median over rounds in which the two sides take turns, so that a machine whose speed drifts slows both.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
import timeit
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

import mujoco
import numpy as np

from mazebench.agent_loading import agent_names, load_agent_class
from mazebench.commands.summary_table import print_table
from mazebench.constants import ACTIONS, STEPS_PER_ACTION
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.tasks.task import TRAIN_DISTANCES, Task
from mazebench.training.collector import Collector
from mazebench.training.loop import num_updates_due
from mazebench.training.protocol import LearningAgent
from mazebench.world.backend import RenderingError
from mazebench.world.batch import open_batch
from mazebench.world.mjcf import action_controls
from mazebench.world.near_walls import WallGeoms, near_walls_of
from mazebench.world.simulation import MujocoSimulation

_SIZES = (13, 31, 51, 101, 255)
_NUM_ENVS = (1, 16, 256, 1024, 4096)
_LIDAR_NUM_ENVS = (1, 16, 256)
_MAZES_PER_SIZE = 8
_PICTURE_ENVS = 16
_TITLES = {
    "environments": "agent steps a second, beside the bare simulation's",
    "training": "training, and where its time goes",
    "resets": "resets",
    "pictures": "pictures as observations, 64 pixels a side",
    "lidar": "the range sensor, against the number of environments",
    "sizes": "against the size of the maze",
    "num_envs": "against the number of environments",
}
_SECONDS, _ROUNDS = 0.5, 7  # of each side of a ratio
_QUICK_SECONDS, _QUICK_ROUNDS = 0.1, 3

# Takes an action number of a round and does one agent step in all its environments.
Step = Callable[[int], Any]


def run(quick: bool = False, say: Callable[[str], None] = print) -> dict[str, Any]:
    """Measures everything and returns it as plain values; `quick`, in fewer and shorter rounds."""
    seconds, rounds = (_QUICK_SECONDS, _QUICK_ROUNDS) if quick else (_SECONDS, _ROUNDS)
    results: dict[str, Any] = {"machine": {"cores": os.cpu_count(), "mujoco": mujoco.__version__}}
    spec = Task.of()
    say("environments beside the bare simulation")
    results["environments"] = [
        _ratio("vector, 256 environments, all threads", 256, *_vector_pair(spec, 256, 0), seconds, rounds),
        _ratio("vector, 256 environments, 1 thread", 256, *_vector_pair(spec, 256, 1), seconds, rounds),
        _ratio("Gymnasium, 1 environment", 1, *_gym_pair(spec), seconds, rounds),
    ]
    if find_spec("dm_control"):
        row = _ratio("dm_control, 1 environment", 1, *_dm_control_pair(spec), seconds, rounds)
        results["environments"].append(row)
    say("training")
    results["training"] = _training_rows(spec, seconds * rounds)
    say("resets")
    results["resets"] = _resets(spec, 20 if quick else 200)
    say("pictures")
    results["pictures"] = _picture_rows(spec, seconds * rounds)
    say("the range sensor")
    sensing = spec.replace(sensors=("lidar",))
    results["lidar"] = [_vector_row(sensing, num_envs, seconds, rounds) for num_envs in _LIDAR_NUM_ENVS]
    say("cost against size")
    results["sizes"] = _size_rows(_SIZES, seconds, rounds)
    say("cost against the number of environments")
    results["num_envs"] = [_vector_row(spec, num_envs, seconds, rounds) for num_envs in _NUM_ENVS]
    return results


def print_tables(results: dict[str, Any]) -> None:
    """Prints what `run` returned, for people."""
    print(f"{results['machine']['cores']} cores, MuJoCo {results['machine']['mujoco']}")
    for name, title in _TITLES.items():
        rows = results[name]
        if not rows:  # training, where no learning agent is installed; pictures, where nothing can be rendered
            continue
        cells = [
            [f"{value:,.2f}" if isinstance(value, float) else str(value) for value in row.values()] for row in rows
        ]
        print_table(title, list(rows[0]), cells)


def bare_simulation(task: Task, num_envs: int, num_threads: int = 0) -> Callable[[np.ndarray], None]:
    """Returns a function that takes agent steps (0.16 s) in B simulations, and does nothing else.

    It takes the actions, `[B]` int. It is what the environments simulate, without a task: the bodies begin in the first
    free cells of the mazes, the walls near them are those of their cells, and they drive on without end.

    Args:
      task: the task whose mazes are simulated.
      num_envs: B.
      num_threads: 0 uses all cores.
    """
    walls = near_walls_of(task.mazes, num_envs)
    batch = open_batch(walls.model, num_envs, num_threads)
    geoms, qpos, ctrl = WallGeoms.of_batch(batch), batch.bind("qpos"), batch.bind("ctrl")
    maze, around, controls = np.arange(num_envs) % len(task.mazes), np.full(num_envs, -1), action_controls()
    batch.reset()
    qpos[:, :2] = [task.mazes[index].point(task.mazes[index].free_cells[0]) for index in maze.tolist()]

    def step(actions: np.ndarray) -> None:
        nonlocal around
        cell = task.mazes[0].cell_index(qpos[:, :2])
        moved = np.flatnonzero(cell != around)
        walls.write(geoms, moved, maze[moved], cell[moved])
        around = cell
        ctrl[:] = controls[actions]
        batch.step(nstep=STEPS_PER_ACTION)

    return step


def _rates(steps: Sequence[Step], num_envs: int, seconds: float, rounds: int) -> np.ndarray:
    """Returns `[rounds, steps]`: agent steps per second of several steps that take turns."""
    return np.array([[_rate(step, num_envs, seconds) for step in steps] for _ in range(rounds)])


def _ratio(what: str, num_envs: int, step: Step, bare: Step, seconds: float, rounds: int) -> dict[str, Any]:
    """Returns the agent steps per second of `step` and of `bare`, and their ratio."""
    rates = _rates((step, bare), num_envs, seconds, rounds)
    steps, bare_steps = np.median(rates, axis=0)
    ratio = float(np.median(rates[:, 0] / rates[:, 1]))
    return {"what": what, "steps/s": round(steps), "bare steps/s": round(bare_steps), "ratio": ratio}


def _rate(step: Step, num_envs: int, seconds: float) -> float:
    count, begin = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - begin) < seconds:
        step(count)
        count += 1
    return count * num_envs / elapsed


def _random_actions(num_envs: int) -> np.ndarray:
    return np.random.default_rng(0).integers(len(ACTIONS), size=(512, num_envs))


def _vector_pair(spec: Task, num_envs: int, num_threads: int) -> tuple[Step, Step]:
    """Returns a step of the vector environment, resets included, and one of the bare simulation."""
    env = MazeVectorEnv(spec, num_envs, seed=0, num_threads=num_threads)
    env.reset()
    actions, bare = _random_actions(num_envs), bare_simulation(spec, num_envs, num_threads)
    return _stepping(env), lambda count: bare(actions[count % len(actions)])


def _stepping(env: MazeVectorEnv) -> Step:
    actions = _random_actions(env.num_envs)
    return lambda count: env.step(actions[count % len(actions)])


def _bare_loop(spec: Task, actions: list[int]) -> Step:
    """Returns a step of one simulation by mj_step, and nothing else."""
    walls, maze = near_walls_of(spec.mazes, 1), spec.mazes[0]
    simulation = MujocoSimulation(walls.model, walls)
    model, data, controls = simulation.model, simulation.data, action_controls()
    data.qpos[:2] = maze.point(maze.free_cells[0])

    def step(count: int) -> None:
        row, column = maze.cell_at(*data.qpos[:2].tolist())
        simulation.surround(0, row * maze.size + column)
        data.ctrl[:] = controls[actions[count % len(actions)]]
        mujoco.mj_step(model, data, STEPS_PER_ACTION)

    return step


def _dm_control_pair(spec: Task) -> tuple[Step, Step]:
    from mazebench.envs.dm_control import Environment

    actions = _random_actions(1)[:, 0].tolist()
    environment = Environment(spec, 0)
    environment.reset()
    return lambda count: environment.step(actions[count % len(actions)]), _bare_loop(spec, actions)


def _gym_pair(spec: Task) -> tuple[Step, Step]:
    actions = _random_actions(1)[:, 0].tolist()
    env = MazeEnv(spec, 0)
    env.reset()

    def step(count: int) -> None:
        *_, terminated, truncated, _ = env.step(actions[count % len(actions)])
        if terminated or truncated:
            env.reset()

    return step, _bare_loop(spec, actions)


def _training_rows(spec: Task, seconds: float) -> list[dict[str, Any]]:
    """Returns the speed of each installed agent that learns, in 256 environments where it can."""
    rows = []
    for name in agent_names():
        try:
            agent_class: Any = load_agent_class(name)
        except InputError:  # what it needs is not installed
            continue
        if issubclass(agent_class, LearningAgent):
            rows.append(_training_row(name, agent_class, spec, seconds))
    return rows


def _training_row(name: str, agent_class: Any, spec: Task, seconds: float) -> dict[str, Any]:
    spec = spec.replace(**agent_class.task_options())
    try:
        learner = agent_class.build_learner(spec, overrides={"num_envs": "256"})
    except InputError:  # it calls its number of environments by another name, or has none
        learner = agent_class.build_learner(spec)
    experience = Collector(spec, learner.num_envs).collect(learner.actor, seed=0)
    steps = updates = 0
    collecting = learning = 0.0  # seconds
    while collecting < seconds or learning < seconds or updates == 0:
        begin = time.perf_counter()
        learner.observe(next(experience))
        steps += learner.num_envs
        collecting += time.perf_counter() - begin
        due = num_updates_due(learner, steps)
        begin = time.perf_counter()
        while updates < due and (learning < seconds or updates == 0):
            learner.update()
            updates += 1
        learning += time.perf_counter() - begin
    collecting /= steps  # seconds a step
    learning /= updates * learner.steps_per_update
    return {
        "what": f"{name}, {learner.num_envs} envs",
        "collected steps/s": round(1 / collecting),
        "updates/s": 1 / (learning * learner.steps_per_update),
        "trained steps/s": round(1 / (collecting + learning)),
        "% update": 100 * learning / (collecting + learning),
    }


def _resets(spec: Task, count: int) -> list[dict[str, Any]]:
    """Milliseconds per reset, after the first ones."""
    env, envs = MazeEnv(spec, 0), MazeVectorEnv(spec, 256, seed=0)
    rows = [
        ("Gymnasium", _milliseconds(env.reset, count)),
        ("vector of 256, an environment", _milliseconds(envs.reset, max(3, count // 20)) / 256),
    ]
    return [{"what": what, "ms": value} for what, value in rows]


def _picture_rows(spec: Task, seconds: float) -> list[dict[str, Any]]:
    """Returns the cost of a step of the vector environment with each camera, and with none."""
    rows = []
    for cameras in ((), ("egocentric",), ("top",), ("egocentric", "top")):
        env = MazeVectorEnv(spec.replace(sensors=cameras), _PICTURE_ENVS, seed=0)
        try:
            env.reset()
        except RenderingError:
            return []
        rate = _rate(_stepping(env), _PICTURE_ENVS, seconds)
        env.close()
        rows.append({"what": " and ".join(cameras) or "no camera", "steps/s": round(rate), "ms a step": 1e3 / rate})
    return rows


def _vector_row(spec: Task, num_envs: int, seconds: float, rounds: int) -> dict[str, Any]:
    """Returns the speed of the vector environment in a task, next to a simulation that observes nothing."""
    return _ratio(f"{num_envs} environments", num_envs, *_vector_pair(spec, num_envs, 0), seconds, rounds)


def _milliseconds(call: Callable[[], Any], count: int) -> float:
    call()
    return 1e3 * statistics.median(timeit.repeat(call, number=1, repeat=count))


def _size_rows(sizes: Sequence[int], seconds: float, rounds: int) -> list[dict[str, Any]]:
    """Returns the speed of 256 environments in mazes of several sizes, which take turns, and their memory."""
    tasks = [_task_of_size(size) for size in sizes]
    envs = [MazeVectorEnv(task, 256, seed=0) for task in tasks]
    for env in envs:
        env.reset()
    rates = _rates([_stepping(env) for env in envs], 256, seconds, rounds)
    return [
        {
            "what": f"{size} x {size}",
            "steps/s": round(np.median(rates[:, index])),
            f"of {sizes[0]} x {sizes[0]}": float(np.median(rates[:, index] / rates[:, 0])),
            "walls": round(statistics.mean(len(maze.boxes) for maze in tasks[index].fixed_mazes)),
            "reset ms": _milliseconds(envs[index].reset, 3) / 256,
            "kB per environment": round((_memory(size, 320) - _memory(size, 64)) / 256),
        }
        for index, size in enumerate(sizes)
    ]


def _task_of_size(size: int) -> Task:
    mazes = [generate("dfs", size, np.random.default_rng([size, index])) for index in range(_MAZES_PER_SIZE)]
    return Task.of(mazes=mazes, distances=TRAIN_DISTANCES)


def _memory(size: int, num_envs: int) -> float:
    """Returns the memory, in kB, of a process that has stepped environments in mazes of a size; 0 if not on Linux."""
    program = (
        "import numpy; from mazebench.bench import measure; from mazebench.envs.vector import MazeVectorEnv; "
        f"env = MazeVectorEnv(measure._task_of_size({size}), {num_envs}, seed=0); env.reset(); "
        f"env.step(numpy.zeros({num_envs}, int)); print(open('/proc/self/statm').read().split()[1])"
    )
    if not os.path.exists("/proc/self/statm"):
        return 0
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return int(done.stdout) * os.sysconf("SC_PAGE_SIZE") / 1024
