"""Suites: evaluations by name that are run together, for one agent or several, into one folder.

`DIR/suite.json` says what is in it, `DIR/AGENT/PART/` is an evaluation as `evaluate` writes it.
"""

from __future__ import annotations

import concurrent.futures
import dataclasses
import pathlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from mazebench.agent import Interface
from mazebench.errors import InputError, RunError, UnplayableError, remark, unknown
from mazebench.evaluation.eval_options import WHOLE, EvalOptions, RunOptions, Shard
from mazebench.evaluation.evaluate import Job, Progress, run_jobs, say_cost
from mazebench.evaluation.plan import Plan, build_agent, make_plan
from mazebench.evaluation.pool import Pool, pool_of
from mazebench.evaluation.store import check_same_run, is_finished
from mazebench.maps.benchmark import DEV, SIZES, manifest_hash
from mazebench.maps.real_buildings import PREFIX, RIGHT, Building, buildings, is_real
from mazebench.results.reading import CONFIG, SUITE, Suite, read_suite
from mazebench.results.records import Summary
from mazebench.results.suite_groups import OF, WITH_RIGHT_MAP, WITHOUT_MAP, group_of
from mazebench.storage.files import make_folder, writing_to
from mazebench.storage.json_files import write_json
from mazebench.tasks.streams import ADRIFT, BUILDING, DOORS, REBUILT
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import LEVELS, STANDING, TRACKS
from mazebench.tasks.trials import Trial
from mazebench.world.bodies import SLIDER
from mazebench.world.looks import VARIED

_DEFAULT_RUN = RunOptions()
_TABLE_DISTANCES = (2, 4, 6, 8, 10)  # those that the paper prints
_CAMERA: dict[str, Any] = {"sensors": ("egocentric",), "camera_size": 64, "camera_fov": 75.0, "look": VARIED}


@dataclasses.dataclass(frozen=True, eq=False)
class Part:
    """One evaluation of a suite. Parts named `GROUP--BUILDING` are summed up by group."""

    name: str
    task: TaskOptions
    episodes_per_distance: int | None = None  # as in `EvalOptions`, likewise the other one
    episodes_per_maze: int | None = None
    # What is played, if that is there already: the task with these options, and the episodes.
    played: Task | None = None
    trials: tuple[Trial, ...] | None = None


def _hierarchical(name: str, **options: Any) -> Part:
    return Part(name, TaskOptions(task="hierarchical", **options))


def _local(name: str, distances: tuple[int, ...] = _TABLE_DISTANCES, episodes: int = 5, **options: Any) -> Part:
    return Part(name, TaskOptions(distances=distances, **options), episodes)


def _in_words(split: str = "eval") -> tuple[Part, ...]:
    """Returns parts with an episode in each maze, for agents whose answers cost; their names differ from all others."""
    return tuple(
        Part(f"{track}-{level}-words", TaskOptions(task=track, level=(level,), split=split), episodes_per_maze=1)
        for track, level in ((BUILDING, 1), (REBUILT, 2), (ADRIFT, 1), (ADRIFT, 2))
    )


def _for_people() -> tuple[Part, ...]:
    """Returns parts of four episodes each, in other mazes each, which get harder: some minutes in all."""
    chosen = (BUILDING, 1, (18,)), (REBUILT, 2, (27,)), (ADRIFT, 1, (34, 39))
    return tuple(
        Part(
            f"{track}-{level}-people",
            TaskOptions(task=track, level=(level,), split=DEV, distances=distances),
            episodes_per_maze=1,
        )
        for track, level, distances in chosen
    )


def _each_level(
    tracks: Iterable[str] = STANDING, suffix: str = "", split: str = "eval", **options: Any
) -> tuple[Part, ...]:
    return tuple(
        Part(f"{track}-{level}{suffix}", TaskOptions(task=track, level=(level,), split=split, **options))
        for track in tracks
        for level in LEVELS
    )


def _by_camera_in_real_buildings(split: str) -> tuple[Part, ...]:
    """Returns a part for each frozen real building with the right map, by camera alone."""
    chosen = (each for each in buildings().values() if (each.split, each.setting) == (split, RIGHT))
    tasks = (TaskOptions(task=BUILDING, level=(1,), mazes=f"{PREFIX}{each.name}", **_CAMERA) for each in chosen)
    return tuple(Part(f"{RIGHT}{OF}{task.mazes.removeprefix(PREFIX)}", task) for task in tasks)


def _in_real_buildings(split: str) -> tuple[Part, ...]:
    """Returns a part for each frozen real building and map that is shown of it; the settings follow each other.

    A building is played with the right map, with the older one where it has one, and with the map hidden, in the same
    episodes; and with the right map and the pose of `adrift` 2, where it has no older map.
    """
    parts: dict[str, list[Part]] = {}

    def add(group: str, building: Building, task: str = BUILDING, level: int = 1, **options: Any) -> None:
        asked = TaskOptions(task=task, level=(level,), mazes=f"{PREFIX}{building.name}", **options)
        parts.setdefault(group, []).append(Part(f"{group}{OF}{building.name}", asked))

    for building in buildings().values():
        if building.split != split:
            continue
        setting = building.setting
        if setting == RIGHT:
            add(setting, building)
            add(f"{setting}{WITHOUT_MAP}", building, hide=("map",))
            add("lost", building, ADRIFT, 2, shown=f"{PREFIX}{building.name}")
        else:
            add(setting, building, shown=f"{PREFIX}{building.older}")
            add(f"{setting}{WITH_RIGHT_MAP}", building)
            add(f"{setting}{WITHOUT_MAP}", building, hide=("map",))
    return tuple(part for group in parts.values() for part in group)


# A map flipped with probability 0 is hierarchical-13-k5; no warp and no noise are local-13: they are not run again.
SUITES: dict[str, tuple[Part, ...]] = {
    "paper": (
        *(Part(f"local-{size}", TaskOptions(size=size)) for size in SIZES),
        *(_hierarchical(f"hierarchical-13-k{cells}", landmark_distance=cells) for cells in range(1, 6)),
        *(_hierarchical(f"flip-{share}", map_flip=share) for share in (0.05, 0.1, 0.2, 0.3)),
        # The paper does not print the ratio of its transforms.
        *(_local(f"warp-{share}", map_warp=share) for share in (0.05, 0.1, 0.2)),
        *(_local(f"noise-{tenths / 10}", position_noise=tenths / 10) for tenths in range(1, 11)),
    ),
    "quick": (
        _local("local-13", episodes=2),
        _local("local-21", (2, 6, 10), size=21, episodes=1),
        _hierarchical("hierarchical-13-k5"),
        _hierarchical("flip-0.1", map_flip=0.1),
        _local("warp-0.1", (2, 6, 10), map_warp=0.1, episodes=1),
        _local("noise-0.5", (2, 6, 10), position_noise=0.5, episodes=1),
    ),
    "tracks": _each_level(),
    "tracks-dev": _each_level(split=DEV),  # to choose agents by
    "tracks-camera": _each_level(**_CAMERA),  # by camera alone
    "tracks-camera-dev": _each_level(split=DEV, **_CAMERA),
    # What agents are measured against: without the map, without map and goal, with the true pose.
    "tracks-no-map": _each_level(hide=("map",)),
    "tracks-no-goal": _each_level(hide=("map", "goal")),
    "tracks-true-pose": _each_level((name for name, track in TRACKS.items() if track.hides_pose), exact_pose=True),
    # Goals in a row on one wrong map; parts have names of their own, since their first goals are played on the tracks.
    "tracks-goals": _each_level((REBUILT,), "-goals", num_goals=3),
    "tracks-goals-dev": _each_level((REBUILT,), "-goals", num_goals=3, split=DEV),
    # Doors that close and open while one drives.
    "doors": _each_level((DOORS,)),
    "doors-dev": _each_level((DOORS,), split=DEV),
    "doors-no-map": _each_level((DOORS,), hide=("map",)),
    # Frozen real buildings: what old maps and right maps are worth there.
    "real": _in_real_buildings("eval"),
    "real-dev": _in_real_buildings(DEV),
    "real-camera": _by_camera_in_real_buildings("eval"),
    "llm": _in_words(),
    "llm-dev": _in_words(split=DEV),
    "people-dev": _for_people(),
}


def parts_of(suite: str) -> tuple[Part, ...]:
    """Returns the parts of the suite with a name; raises `InputError` if there is none."""
    if suite not in SUITES:
        raise unknown("suite", suite, SUITES)
    return SUITES[suite]


def run_suite(
    suite: str,
    agents: Sequence[str],
    out: pathlib.Path,
    run: RunOptions = _DEFAULT_RUN,
    progress: Progress = lambda ended, of: None,
    summing: Progress = lambda ended, of: None,
    *,
    checkpoint: str | None = None,
    seed: int = 0,
    overrides: Mapping[str, str] | None = None,
    executor: concurrent.futures.Executor | None = None,
    shard: Shard = WHOLE,
    own_parts: Sequence[Part] | None = None,
    body: Any = SLIDER.name,
    is_dry: bool = False,
    pool: Pool | None = None,
) -> list[Summary]:
    """Runs what is left of a suite for some agents; returns the summaries by agent and then in the suite's order.

    Parts that an agent can't play are left out; a `mazebench.errors.Remark` warns of it.

    Args:
      suite: a name in `SUITES`, or that of `own_parts`.
      agents: whom to evaluate.
      out: the suite's folder; with `run.resume`, agents that it does not have yet are added.
      run: how. `run.record` None writes trajectories, but does not run finished parts again that have none.
      progress: called as episodes end, with their number and that of all parts together.
      summing: called as the oracle's drives end, which are measured after the last episode of a part.
      checkpoint: of a single agent.
      seed: of what the agents draw.
      overrides: values of the config of a single agent.
      executor: runs the episodes, as in `mazebench.evaluation.evaluate.evaluate`.
      shard: whose episodes alone are run, with the summaries of the evaluations in which it has some.
      own_parts: the parts, instead of those in `SUITES`.
      body: what is driven, as the option of `TaskOptions` has it.
      is_dry: whether to say what the suite may cost and to run nothing.
      pool: runs the episodes, instead of the one that `run` asks for.

    Raises:
      InputError: if a name is unknown, an agent named twice, a checkpoint or values given to several agents, or the
        folder holds something else.
      UnplayableError: if an agent can play no part.
      RunError: if an agent or a worker failed; what ended until then is kept.
    """
    out = out.absolute()  # agents may change the working folder
    if (checkpoint is not None or overrides) and len(agents) > 1:
        raise InputError(f"expected one agent with --checkpoint or --set, found {len(agents)}")
    driven = own_parts or [dataclasses.replace(part, task=part.task.replace(body=body)) for part in parts_of(suite)]
    parts = {part.name: part for part in driven}

    def planned(agent: str, part: Part) -> Plan:
        plan = make_plan(
            EvalOptions(
                agent=agent,
                task=part.task,
                episodes_per_distance=part.episodes_per_distance,
                episodes_per_maze=part.episodes_per_maze,
                checkpoint=checkpoint,
                seed=seed,
                overrides=overrides or {},
            ),
            trials=part.trials,
            task=part.played,
        )
        plan.check_spread(run.workers, machines=(run.cluster, executor, shard) != (None, None, WHOLE))
        return plan

    # Plans in real buildings are made when they are played, but for the first of a group, which stands for the others.
    agent_of = {folder: agent for agent, folder in folders_of(agents).items()}
    firsts = {name: next(each for each in parts if group_of(each) == group_of(name)) for name in parts}
    plans = {
        (folder, name): planned(agent, part)
        for folder, agent in agent_of.items()
        for name, part in parts.items()
        if firsts[name] == name or not is_real(part.task.mazes)
    }
    left_out = _unplayable(plans, out, suite)
    chosen = [(folder, name) for folder in agent_of for name in parts if (folder, firsts[name]) not in left_out]
    for (folder, name), plan in plans.items():
        if (folder, name) not in left_out:
            plan.say_remarks(of_maps=False)
    episodes = {
        key: shard.numbers((plans.get(key) or plans[key[0], firsts[key[1]]]).trials, position)
        for position, key in enumerate(chosen)
    }

    say_cost(((plans.get(key) or plans[key[0], firsts[key[1]]], len(episodes[key])) for key in chosen), is_dry)
    if is_dry:
        return []

    def jobs() -> Iterator[Job]:
        for key in chosen:
            if episodes[key]:
                plan = plans.pop(key) if key in plans else planned(agent_of[key[0]], parts[key[1]])
                folder = out.joinpath(*key)
                yield Job(plan, folder, run.record, episodes[key], suite, key[1])

    with pool_of(run, executor, pool) as pool:
        make_folder(out)
        _prepare(
            out, suite, tuple(parts), agents, seed, {key: plans[key] for key in chosen if key in plans}, run.resume
        )
        how = dataclasses.replace(run, resume=True)
        return run_jobs(jobs(), len(chosen), sum(map(len, episodes.values())), pool, how, progress, summing)


def _unplayable(plans: dict[tuple[str, str], Plan], out: pathlib.Path, suite: str) -> set[tuple[str, str]]:
    """Returns the folders and parts of the plans that their agents can't play, and warns of them in a line an agent."""
    refusals: dict[tuple[str, Interface], str | None] = {}  # an agent is built once for equal environments
    left_out: dict[str, dict[str, str]] = {}  # reasons by folder and group of parts
    unplayable: set[tuple[str, str]] = set()
    for (folder, part), plan in plans.items():
        if is_finished(out / folder / part):
            continue
        key = folder, plan.task.interface
        if key not in refusals:
            refusals[key] = None
            try:
                build_agent(plan.options, plan.task, plan.agent_class)
            except UnplayableError as error:
                refusals[key] = str(error)
            except (InputError, RunError):  # which it raises again when its turn comes
                pass
        if (reason := refusals[key]) is not None:
            left_out.setdefault(folder, {})[group_of(part)] = reason
            unplayable.add((folder, part))
    for folder, reasons in left_out.items():
        reason = next(iter(reasons.values()))
        if all(key in unplayable for key in plans if key[0] == folder):
            raise UnplayableError(f"{reason}; it can play no part of the suite {suite!r}")
        remark(f"{reason}; left out: {', '.join(reasons)}")
    return unplayable


def _prepare(
    out: pathlib.Path,
    suite: str,
    parts: tuple[str, ...],
    agents: Sequence[str],
    seed: int,
    plans: dict[tuple[str, str], Plan],
    resume: bool,
) -> None:
    """Makes `out` ready to hold the suite, or refuses before anything is run."""
    found = sorted(path.name for path in out.iterdir() if path.suffix != ".tmp")
    before = None
    if found:
        if SUITE not in found:
            raise InputError(f"{out}: expected an empty folder or a suite's, found {found[0]!r} in it")
        if not resume:
            raise InputError(f"{out}: holds a run already; go on with --resume or name another folder")
        before = read_suite(out)
    folders = folders_of(list(dict.fromkeys([*(before.folders if before else ()), *agents])))
    benchmark = next(iter(plans.values())).task.options.benchmark  # the parts of a suite belong to one
    content = Suite(
        suite=suite,
        parts=parts,
        benchmark=benchmark,
        benchmark_manifest_sha256=manifest_hash(benchmark),
        seed=seed,
        agents=tuple(folders),
        folders=folders,
    )
    if before:
        for key in ("suite", "parts", "benchmark", "benchmark_manifest_sha256", "seed"):
            if getattr(before, key) != getattr(content, key):
                raise InputError(
                    f"{out}: holds another run: its {key} is {str(getattr(before, key))[:200]}, "
                    f"this one's {getattr(content, key)}"
                )
    for (folder, part), plan in plans.items():
        if (out / folder / part / CONFIG).exists():
            check_same_run(out / folder / part, plan.identity)
    with writing_to(out):
        write_json(out / SUITE, content.model_dump())


def folders_of(agents: Sequence[str]) -> dict[str, str]:
    """Returns the name of each agent's folder: letters, digits, dots, dashes and underscores."""
    folders: dict[str, str] = {}
    for agent in agents:
        folder = "".join(letter if letter.isalnum() or letter in "._-" else "-" for letter in agent)
        folder = f"agent{folder}" if folder.startswith(".") else folder
        if folder in folders.values():
            raise InputError(f"expected agents with folders of their own, found two for {folder!r}")
        folders[agent] = folder
    return folders
