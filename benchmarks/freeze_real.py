"""Makes the benchmark `real`, mazes and episodes in real buildings, from maps that public repositories hold.

`python -m benchmarks.freeze_real MAPS DIR` reads the maps (YAML and PNG), their table `INDEX.md` and the folder
`licences` in MAPS. `benchmarks/real_maps.csv` says which maps are taken, in which split, and why others are not.

Mazes, changed buildings and episodes follow from seeds and from how this version reads maps. The manifest has the
SHA-256 of each file, and docs/real.md tells what the settings are.
"""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import itertools
import pathlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import typer

from benchmarks.freeze import rows_of_trials, write_benchmark
from mazebench.errors import InputError
from mazebench.maps.benchmark import FROZEN_SPLITS, REAL_BENCHMARK
from mazebench.maps.changes import change
from mazebench.maps.maze import Maze
from mazebench.maps.maze_files import read_maze, read_with_older
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.older_map import OlderMap
from mazebench.maps.real_buildings import RIGHT, TABLE, YEARS, Building
from mazebench.tasks.arena import Arena
from mazebench.tasks.episode import sample_pair
from mazebench.tasks.task import Task, resolve
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import DISTANCES, MAX_CELL_SIZE, cells_of
from mazebench.tasks.trials import COLUMNS, Trial, buildings_file, make_trial

CHOICE = pathlib.Path(__file__).with_name("real_maps.csv")
SOURCES, LEFT_OUT = "sources.csv", "left_out.csv"
EPISODES = 12  # in each building
STRENGTHS = (1, 2)  # of changes
LEAST_SHARE = 0.1  # of pairs of cells that lie as far apart as start and goal do
_NUM_CELLS = 200  # from which that share is measured
_SEED = 4  # each building adds the number of its line, and each strength its own
_COLUMNS = ("name", "repository", "commit", "path", "licence", "licence_file", "metres_per_pixel", "image_sha256")
_REPOSITORY = re.compile(r"(\S+) @ ([0-9a-f]+)")


@dataclasses.dataclass(frozen=True)
class Frozen:
    """A building with what is shown of it, and its episodes."""

    building: Building
    maze: Maze
    older: OlderMap | None
    trials: list[Trial]

    @property
    def task(self) -> Task:
        """The task in which the oracle's steps are measured."""
        asked = TaskOptions(task="building", level=(1,), mazes=(self.maze,))
        return resolve(asked, arena=Arena((self.maze,), self.older and (self.older,)))


def freeze_real(maps: pathlib.Path, folder: pathlib.Path) -> None:
    """Writes mazes, older maps, episodes, sources and licences into `folder`."""
    chosen = list(csv.DictReader(CHOICE.read_text().splitlines()))
    used = {name for row in chosen if not row["reason"] for name in (row["map"], row["older"]) if name}
    sources = [row for row in read_index(maps) if row["name"] in used]
    faults: list[tuple[str, str]] = []
    frozen = []
    for each in freeze_buildings(maps, chosen, faults):
        frozen.append(each)
        print(each.building.name, each.maze.size, flush=True)

    # What the files hold: the buildings and the older maps that no other building is, then episodes by split.
    files: dict[str, str | bytes] = {TABLE: _to_csv(Building._fields, [each.building for each in frozen])}
    for each in frozen:
        files[f"{each.building.name}.png"] = to_png(each.maze.walls)
        if each.older is not None:
            files.setdefault(f"{each.building.older}.png", to_png(each.older.walls))
    for split in FROZEN_SPLITS:
        own = [each for each in frozen if each.building.split == split]
        rows = [
            [each.building.name, *row[1:]] for each in own for row in rows_of_trials(each.task, each.trials)
        ]  # the first column is the number of the maze
        files[buildings_file(split)] = _to_csv(COLUMNS, rows)

    # Where the maps come from. The licence of each repository is that of its maps.
    files[SOURCES] = _to_csv(_COLUMNS, [[row[name] for name in _COLUMNS] for row in sources])
    faults += [(row["map"], row["reason"]) for row in chosen if row["reason"]]
    files[LEFT_OUT] = _to_csv(("map", "reason"), faults)
    for name in sorted({row["licence_file"] for row in sources}):
        files[f"licences/{name}"] = (maps / "licences" / name).read_bytes()
    write_benchmark(folder, REAL_BENCHMARK, {"seed": _SEED, "episodes": EPISODES}, files)


def freeze_buildings(
    maps: pathlib.Path, chosen: Iterable[Mapping[str, str]], faults: list[tuple[str, str]]
) -> Iterator[Frozen]:
    """Yields the buildings of the lines of `CHOICE`, each with its changed ones; adds to `faults` what is left out."""
    for number, row in enumerate(chosen):
        if row["reason"]:
            continue
        name, path = row["building"], maps / f"{row['map']}.yaml"
        described: dict[str, Any] = {each: row[each] for each in ("split", "site", "use", "origin")}
        described["source"] = row["map"]
        if row["older"]:
            older_path, is_aligned = maps / f"{row['older']}.yaml", bool(row["align"])
            (maze,), (older,) = read_with_older(path, older_path, ReadOptions(), is_aligned)
            maze = dataclasses.replace(maze, name=name)
            built = [(YEARS, name, maze, older)]
        else:
            maze = dataclasses.replace(read_maze(path), name=name)
            if maze.cell_size > MAX_CELL_SIZE:
                raise InputError(f"{name}: expected cells of at most {MAX_CELL_SIZE} m, found {maze.cell_size}")
            if (share := share_in_reach(maze)) < LEAST_SHARE:
                raise InputError(f"{name}: expected {LEAST_SHARE} of the pairs of cells in reach, found {share:.2f}")
            built = [(RIGHT, name, maze, None)]
            for strength in STRENGTHS:
                rng = np.random.default_rng([_SEED, number, strength])
                try:
                    changed, _ = change(maze, strength, rng, f"{name}-changed-{strength}")
                except InputError:
                    faults.append((row["map"], f"as a changed building of strength {strength}, which it can't carry"))
                    break
                built.append((f"changed-{strength}", changed.name, changed, OlderMap(maze.walls, changed)))
        for setting, own_name, own, shown in built:
            of_shown = "" if shown is None else f"{name}-older" if setting == YEARS else name
            building = Building(own_name, setting=setting, cell_size=f"{own.cell_size:g}", older=of_shown, **described)
            rng = np.random.default_rng([_SEED, number, len(setting), *own_name.encode()])
            yield Frozen(building, own, shown, draw_trials(own, shown, rng))


def share_in_reach(maze: Maze) -> float:
    """Returns the share of the pairs of free cells that lie as far apart as start and goal of an episode do."""
    cells = np.random.default_rng(0).permutation(maze.free_cells)[:_NUM_CELLS]
    metres = np.concatenate([maze.distances(tuple(cell))[~maze.walls] for cell in cells]) * maze.cell_size
    return float(((metres >= DISTANCES[0]) & (metres <= DISTANCES[-1])).mean())


def draw_trials(maze: Maze, older: OlderMap | None, rng: np.random.Generator) -> list[Trial]:
    """Returns the episodes in a building, the nearest goals first.

    Starts and goals are free and joined on the older map, too. Each distance comes up about as often as every other
    one that the building has.
    """
    joined = None if older is None else older.joined
    trials: list[Trial] = []
    distances = itertools.chain.from_iterable(rng.permutation(DISTANCES).tolist() for _ in range(EPISODES))
    for distance in distances:
        if len(trials) == EPISODES:
            break
        try:
            pair = sample_pair(maze, cells_of(distance, maze.cell_size, "building"), rng, joined=joined)
        except InputError:  # none are so far apart
            continue
        trials.append(make_trial(maze, 0, pair, rng))
    if len(trials) < EPISODES:
        raise InputError(f"{maze.name}: expected {EPISODES} episodes, found {len(trials)}")
    return sorted(trials, key=lambda trial: trial.distance)


def read_index(maps: pathlib.Path) -> Iterator[dict[str, str]]:
    """Yields the lines of the table of sources, by the names in `sources.csv`."""
    for line in (maps / "INDEX.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) != 10 or (found := _REPOSITORY.fullmatch(cells[3])) is None:
            continue
        name, _, _, _, path, licence, resolution, *_ = cells
        repository, commit = found.groups()
        yield {
            "name": name,
            "repository": repository,
            "commit": commit,
            "path": path,
            "licence": licence.removesuffix(" (LICENSE)"),
            "licence_file": f"{repository.replace('/', '__')}__LICENSE.txt",
            "metres_per_pixel": resolution,
            "image_sha256": hashlib.sha256((maps / f"{name}.png").read_bytes()).hexdigest(),
        }


def to_png(walls: np.ndarray) -> bytes:
    """Returns a picture of walls `[N, N]` bool, a pixel for each cell, black for wall."""
    is_written, content = cv2.imencode(".png", np.where(walls, 0, 255).astype(np.uint8), [cv2.IMWRITE_PNG_BILEVEL, 1])
    assert is_written
    return content.tobytes()


def _to_csv(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    return text.getvalue()


if __name__ == "__main__":
    typer.run(freeze_real)
