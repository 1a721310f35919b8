"""Checkpoints: safetensors with JSON metadata, never pickle; written whole or not at all."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping
from typing import Any

import safetensors
import safetensors.torch
import torch

from mazebench.errors import InputError, shortened
from mazebench.maps.file_kinds import kind_of, way_out
from mazebench.options import Config, override
from mazebench.storage.files import open_whole, read_at_most
from mazebench.storage.json_files import parse_json

FORMAT = "mazebench-agent-1"
AGENT_FILE = "agent.safetensors"

_MAX_BYTES = 256 * 2**20


def save_checkpoint(path: pathlib.Path, tensors: Mapping[str, torch.Tensor], metadata: Mapping[str, Any]) -> None:
    """Writes `tensors` and `metadata` all or nothing."""
    # Under one key, because the order of several in the file is not defined.
    header = {FORMAT: json.dumps(metadata, sort_keys=True)}
    content = safetensors.torch.save({name: tensor.detach().contiguous() for name, tensor in tensors.items()}, header)
    with open_whole(path) as file:
        file.write(content)


def load_checkpoint(path: pathlib.Path, agent: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """Returns the tensors and the metadata of a checkpoint of `agent`.

    Raises:
      InputError: if the file can't be read, is damaged or larger than 256 MiB, or is another agent's checkpoint.
    """
    content = read_at_most(path, _MAX_BYTES, "checkpoint")
    try:
        tensors = safetensors.torch.load(content)
        # The header is JSON, after eight bytes with its length.
        header = parse_json(content[8 : 8 + int.from_bytes(content[:8], "little")])
        metadata = parse_json(header["__metadata__"][FORMAT])
    except (safetensors.SafetensorError, ValueError, KeyError) as error:
        kind = kind_of(content)
        found = f"a damaged one: {str(error)[:120]}" if kind is None else f"{kind}{way_out(kind)}"
        raise InputError(f"{path}: expected a checkpoint of {FORMAT}, found {found}") from error
    name = metadata.get("agent") if isinstance(metadata, dict) else metadata
    if not isinstance(metadata, dict) or name != agent:
        raise InputError(f"{path}: expected a checkpoint of agent {agent!r}, found one of {str(name)[:80]!r}")
    return tensors, metadata


def load_agent(path: pathlib.Path, agent: str, default: Config) -> tuple[dict[str, torch.Tensor], Config, int]:
    """Returns the tensors of a checkpoint of `agent`, its config, of the type of `default`, and its context size M.

    Raises:
      InputError: as `load_checkpoint`, or if config or context size are missing or illegal.
    """
    tensors, metadata = load_checkpoint(path, agent)
    try:
        config, context_size = override(default, metadata["config"]), int(metadata["context_size"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: expected metadata with config and context_size, found {error}") from error
    return tensors, config, context_size


def load_into(path: pathlib.Path, module: torch.nn.Module, tensors: Mapping[str, torch.Tensor]) -> None:
    """Copies `tensors` into `module`.

    Raises:
      InputError: if a name or a shape differs.
    """
    try:
        module.load_state_dict(dict(tensors))
    except RuntimeError as error:
        raise InputError(f"{path}: {shortened(str(error))}") from error
