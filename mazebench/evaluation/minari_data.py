"""Demonstrations as a Minari data set."""

from __future__ import annotations

import pathlib
import re
import shutil
from collections.abc import Iterable, Iterator
from typing import Any

import minari
from minari.data_collector import EpisodeBuffer
from minari.dataset.minari_storage import MinariStorage

from mazebench import __version__
from mazebench.envs.env_spec import env_spec_of
from mazebench.envs.spaces import action_space, observation_space
from mazebench.evaluation.demonstrations import load_demonstrations
from mazebench.storage.files import writing_to
from mazebench.tasks.task import Task


def write_dataset(folder: pathlib.Path, task: Task, agent: str, files: Iterable[pathlib.Path]) -> None:
    """Writes the demonstrations in some files as the data set `folder`, all or nothing.

    The observations have no context, which is in the infos once for each leg.

    Raises:
      InputError: if it can't be written.
    """
    space = observation_space(task)
    del space.spaces["context"]
    temporary = folder.absolute().with_name(folder.name + ".tmp")  # Minari can't make it at a relative path
    with writing_to(folder):
        shutil.rmtree(temporary, ignore_errors=True)
        storage = MinariStorage.new(
            temporary,
            observation_space=space,
            action_space=action_space(task),
            env_spec=env_spec_of(task),
            jpeg_encoding=False,  # which would change pictures
        )
        storage.update_metadata(
            {
                "dataset_id": "mazebench/{}-v0".format(re.sub(r"[^-\w]", "-", f"{task.options.slug}-{agent}")),
                "minari_version": minari.__version__,
                "algorithm_name": agent,
                "description": f"{task}, driven by {agent}",
                "requirements": [f"mazebench-mujoco=={__version__}"],
            }
        )
        storage.update_episodes(_buffers(files))
        temporary.rename(folder)


def _buffers(files: Iterable[pathlib.Path]) -> Iterator[EpisodeBuffer]:
    for episode in (episode for path in files for episode in load_demonstrations(path)):
        nested = _nested(episode.arrays)
        yield EpisodeBuffer(seed=episode.seed, options={"maze": episode.maze, "distance": episode.distance}, **nested)


def _nested(arrays: dict[str, Any]) -> dict[str, Any]:
    """Returns dicts in dicts for names like "infos/leg"."""
    nested: dict[str, Any] = {}
    for name, array in arrays.items():
        *outer, last = name.split("/")
        inner = nested
        for each in outer:
            inner = inner.setdefault(each, {})
        inner[last] = array
    return nested
