"""Shows that today's code of agents gives the episodes that earlier code gave, as `records/` has them.

    python -m benchmarks.equal_code FOLDER...      of an archive, such as tracks/navigator; agents that learn nothing

An episode in each maze is played again: with the same steps and path, the hashes of both versions of the code go to
`benchmarks/equal_code.json`. Columns of one table may be of different code only if they stand there together.
"""

from __future__ import annotations

import json
import pathlib
import shutil
import sys
import tempfile
from collections.abc import Mapping

from mazebench.evaluation.evaluate import evaluate
from mazebench.results.reading import SUMMARY, Result, load_result
from mazebench.results.records import Record

LIST = pathlib.Path(__file__).with_name("equal_code.json")
_RECORDS = pathlib.Path(__file__).parent.parent / "records"
_SAME = ("maze", "start", "goal", "leg", "success", "steps", "path_length")


def equal_code() -> dict[str, list[list[str]]]:
    """Returns for each agent the groups of hashes of its code that were shown to give equal episodes."""
    return json.loads(LIST.read_text("ascii"))


def is_one_code(played: Mapping[str, set[str]]) -> bool:
    """Returns whether one version of the code gives the episodes of all agents, as far as was shown.

    Args:
      played: by agent, the hashes of the code that its episodes were played by.
    """
    groups, versions = equal_code(), []
    for agent, hashes in played.items():
        found = (set(group) for group in groups.get(agent, []) if hashes <= set(group))
        versions.append(next(found, hashes if len(hashes) == 1 else set()))
    return bool(set.intersection(*versions))


def played_again(result: Result) -> str:
    """Plays the first episode in each maze of a result again, and returns the hash of today's code.

    Raises:
      ValueError: if an episode differs.
    """
    task = result.summary.task.replace(distances=None)
    with tempfile.TemporaryDirectory() as folder:
        summary = evaluate(result.summary.agent, task, folder, episodes_per_maze=1)
        again = load_result(pathlib.Path(folder)).records
    before = {_key(record): record for record in result.records}
    for record in again:
        for name in _SAME:
            old, new = (getattr(each, name) for each in (before[_key(record)], record))
            if old != new:
                raise ValueError(f"{result.folder}, maze {record.maze}: expected {name} {old}, found {new}")
    return str(summary.provenance.agent_code_sha256)


def _key(record: Record) -> tuple[object, ...]:
    return record.maze, record.start, record.goal, record.leg, record.seed


def main(folders: list[str]) -> None:
    groups = equal_code() if LIST.exists() else {}
    for name in folders:
        archive = name.partition("/")[0]
        with tempfile.TemporaryDirectory() as folder:
            shutil.unpack_archive(_RECORDS / f"{archive}.tar.xz", folder, filter="data")
            for path in sorted(pathlib.Path(folder, name).rglob(SUMMARY)):
                result = load_result(path.parent)
                summary = result.summary
                if summary.provenance.checkpoint_sha256 or summary.task.track is None:
                    continue
                hashes = {str(summary.provenance.agent_code_sha256), played_again(result)}
                print(f"{archive}: {summary.row}, {path.parent.name}: equal", flush=True)
                own = groups.setdefault(summary.agent, [])
                joined = hashes.union(*(group for group in own if hashes & set(group)))
                groups[summary.agent] = [*(group for group in own if not joined & set(group)), sorted(joined)]
        LIST.write_text(json.dumps(groups, indent=1) + "\n", "ascii")


if __name__ == "__main__":
    main(sys.argv[1:])
