"""Suites: evaluations by name that are run together, for one agent or several, into one folder.

`DIR/suite.json` says what is in it, `DIR/AGENT/PART/` is an evaluation as `evaluate` writes it.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence
from typing import Any

from mazebench.errors import InputError, unknown
from mazebench.evaluation.harness import Evaluation, Progress, run_evaluations
from mazebench.evaluation.options import EvalOptions
from mazebench.evaluation.results import SUITE, is_safe_name, load_result, read_suite
from mazebench.files import make_folder, refuse_links, writing_to
from mazebench.maps.benchmark import SIZES, VERSION, manifest_hash
from mazebench.records import CONFIG, FolderLock, write_json

_TABLE_DISTANCES = (2, 4, 6, 8, 10)  # those that the paper prints


@dataclasses.dataclass(frozen=True)
class Part:
    """One evaluation of a suite."""

    name: str
    changes: dict[str, Any]  # of `EvalOptions`, by field


def _hierarchical(name: str, **changes: Any) -> Part:
    return Part(name, {"task": "hierarchical", **changes})


def _local(name: str, distances: tuple[int, ...] = _TABLE_DISTANCES, **changes: Any) -> Part:
    return Part(name, {"task": "local", "distances": distances, **changes})


# A map flipped with probability 0 is hierarchical-13-k5; no warp and no noise are local-13: they are not run again.
SUITES: dict[str, tuple[Part, ...]] = {
    "paper": (
        *(Part(f"local-{size}", {"task": "local", "size": size}) for size in SIZES),
        *(_hierarchical(f"hierarchical-13-k{cells}", landmark_distance=cells) for cells in range(1, 6)),
        *(_hierarchical(f"flip-{share}", map_flip=share) for share in (0.05, 0.1, 0.2, 0.3)),
        # The paper does not print the ratio of its transforms.
        *(_local(f"warp-{share}", map_warp=share) for share in (0.05, 0.1, 0.2)),
        *(_local(f"noise-{tenths / 10}", position_noise=tenths / 10) for tenths in range(1, 11)),
    ),
    "quick": (
        _local("local-13", episodes_per_distance=2),
        _local("local-21", (2, 6, 10), size=21, episodes_per_distance=1),
        _hierarchical("hierarchical-13-k5"),
        _hierarchical("flip-0.1", map_flip=0.1),
        _local("warp-0.1", (2, 6, 10), map_warp=0.1, episodes_per_distance=1),
        _local("noise-0.5", (2, 6, 10), position_noise=0.5, episodes_per_distance=1),
    ),
}


class SuiteRun:
    """A suite for some agents in a folder; made without writing anything."""

    def __init__(
        self,
        suite: str,
        agents: Sequence[str],
        out: pathlib.Path,
        *,
        checkpoint: str | None = None,
        seed: int = 0,
        record: bool = True,
    ):
        """Reads what all parts need; `checkpoint` is for a single agent.

        Raises:
          InputError: if a name is unknown, an agent named twice, or a checkpoint given to several agents.
        """
        if suite not in SUITES:
            raise unknown("suite", suite, SUITES)
        if checkpoint is not None and len(agents) > 1:
            raise InputError(f"expected one agent with --checkpoint, found {len(agents)}")
        self.out = out
        self._suite, self._seed = suite, seed
        self._folders = _folders(agents)
        self.evaluations = [
            Evaluation(
                EvalOptions(agent=agent, checkpoint=checkpoint, seed=seed, **part.changes),
                out / folder / part.name,
                record,
                {"suite": suite, "part": part.name},
            )
            for agent, folder in self._folders.items()
            for part in SUITES[suite]
        ]

    @property
    def is_finished(self) -> bool:
        """Whether its folder holds the results of all parts."""
        return all(evaluation.is_finished for evaluation in self.evaluations)

    def run(
        self,
        *,
        resume: bool = False,
        num_envs: int = 256,
        workers: int = 0,
        ray_address: str | None = None,
        progress: Progress = lambda done, of: None,
    ) -> None:
        """Runs what is left of all parts; the arguments are those of `evaluate`.

        Raises:
          InputError: if the folder holds something else, or a part can't be run.
          RunError: if an agent or a worker failed; what ended until then is kept.
        """
        make_folder(self.out)
        with FolderLock(self.out):
            content = self._prepare(resume)
            for evaluation in self.evaluations:
                refuse_links(evaluation.out, within=self.out)
                if (evaluation.out / CONFIG).exists():
                    evaluation.check_same_run()
            with writing_to(self.out):
                write_json(self.out / SUITE, content)
            left = [evaluation for evaluation in self.evaluations if not evaluation.is_finished]
            finished = sum(len(evaluation.trials) for evaluation in self.evaluations if evaluation.is_finished)
            run_evaluations(
                left,
                resume=True,
                num_envs=num_envs,
                workers=workers,
                ray_address=ray_address,
                smallest_job=num_envs,
                progress=lambda done, of: progress(finished + done, finished + of),
            )

    def summaries(self) -> list[dict[str, Any]]:
        """Of all parts, by agent and then in the suite's order; all must be finished.

        Raises:
          InputError: if one is damaged.
        """
        return [{**load_result(evaluation.out).summary, **evaluation.labels} for evaluation in self.evaluations]

    def _prepare(self, resume: bool) -> dict[str, Any]:
        """What is to be said of the folder, or a refusal; agents that it does not have yet are added to it."""
        content = {
            "suite": self._suite,
            "parts": [part.name for part in SUITES[self._suite]],
            "benchmark": VERSION,
            "benchmark_manifest_sha256": manifest_hash(),
            "seed": self._seed,
        }
        found = sorted(path.name for path in self.out.iterdir())
        agents: dict[str, str] = {}
        if set(found) - {f"{SUITE}.tmp"}:
            if SUITE not in found:
                raise InputError(f"{self.out}: expected an empty folder or a suite's, found {found[0]!r} in it")
            if not resume:
                raise InputError(f"{self.out}: holds a run already; go on with --resume or name another folder")
            before = read_suite(self.out)
            for key, value in content.items():
                if before.get(key) != value:
                    raise InputError(
                        f"{self.out}: holds another run: its {key} is {str(before.get(key))[:200]}, this one's {value}"
                    )
            agents = before["folders"]
        agents = _folders([*agents, *(agent for agent in self._folders if agent not in agents)])
        return {**content, "agents": list(agents), "folders": agents}


def _folders(agents: Sequence[str]) -> dict[str, str]:
    """The name of each agent's folder.

    Raises:
      InputError: if two would have the same one.
    """
    folders: dict[str, str] = {}
    for agent in agents:
        folder = folder_name(agent)
        if folder in folders.values():
            raise InputError(f"expected agents with folders of their own, found two for {folder!r}")
        folders[agent] = folder
    return folders


def folder_name(agent: str) -> str:
    """An agent's name as a folder's: letters, digits, dots, dashes and underscores, `module-Class` for module:Class."""
    name = "".join(letter if letter.isalnum() or letter in "._-" else "-" for letter in agent)
    return name if is_safe_name(name) else f"agent{name}"
