"""Checkpoints: safetensors with JSON metadata, never pickle; written whole or not at all."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping
from typing import Any

import safetensors
import safetensors.torch
import torch

from mazebench.errors import InputError, UnplayableError, shortened
from mazebench.maps.file_kinds import kind_of, way_out
from mazebench.maps.maze import MAX_SIZE, MIN_SIZE
from mazebench.options import Config, override
from mazebench.storage.files import open_whole, read_at_most
from mazebench.storage.json_files import parse_json
from mazebench.world.bodies import SLIDER, Body
from mazebench.world.bodies.described import body_of

FORMAT = "mazebench-agent-1"
AGENT_FILE = "agent.safetensors"

_MAX_BYTES = 256 * 2**20
_MAX_TENSORS = 10_000
# Of weights, and of the counts and masks beside them.
_DTYPES = (torch.float32, torch.float64, torch.float16, torch.bfloat16, torch.int64, torch.bool)


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
      InputError: if the file can't be read, is damaged or larger than 256 MiB, or is another agent's checkpoint; if its
        tensors are many, of a type that no network has, or not finite, or its context size is no maze's.
    """
    content = read_at_most(path, _MAX_BYTES, "checkpoint")
    text = content[8 : 8 + int.from_bytes(content[:8], "little")]  # the header, after its length
    if (num_tensors := text.count(b'"data_offsets"')) > _MAX_TENSORS:  # before each takes time
        raise InputError(f"{path}: expected a checkpoint of at most {_MAX_TENSORS:,} tensors, found {num_tensors:,}")
    try:
        tensors = safetensors.torch.load(content)
        header = parse_json(text)
        metadata = parse_json(header["__metadata__"][FORMAT])
    except (safetensors.SafetensorError, ValueError, KeyError) as error:
        kind = kind_of(content)
        found = f"a damaged one: {str(error)[:120]}" if kind is None else f"{kind}{way_out(kind)}"
        raise InputError(f"{path}: expected a checkpoint of {FORMAT}, found {found}") from error
    name = metadata.get("agent") if isinstance(metadata, dict) else metadata
    if not isinstance(metadata, dict) or name != agent:
        raise InputError(f"{path}: expected a checkpoint of agent {agent!r}, found one of {str(name)[:80]!r}")
    for name, tensor in sorted(tensors.items()):
        if tensor.dtype not in _DTYPES:
            raise InputError(f"{path}: expected floats in {name[:80]}, found {tensor.dtype}")
        if not tensor.to(torch.float32).isfinite().all():
            raise InputError(f"{path}: expected finite numbers in {name[:80]}, found nan or inf")
    size = metadata.get("context_size", MIN_SIZE)  # files of an optimizer have none
    if type(size) is not int or not MIN_SIZE <= size <= MAX_SIZE:
        raise InputError(f"{path}: expected a context_size of {MIN_SIZE} to {MAX_SIZE}, found {str(size)[:80]}")
    return tensors, metadata


def require_body(metadata: Mapping[str, Any], agent: str, body: Body) -> None:
    """Raises `UnplayableError` if `agent` learned on another body than `body`: on the slider, if metadata says none."""
    values: Any = metadata
    for key in ("provenance", "task"):
        values = values.get(key) if isinstance(values, Mapping) else None
    learned = body_of(values["body"]) if isinstance(values, Mapping) and "body" in values else SLIDER.name
    if learned != body_of(body):
        name = learned if isinstance(learned, str) else learned.name
        raise UnplayableError(f"agent {agent!r}: learned on the body {name!r}, found {body.name!r}")


def load_agent(
    path: pathlib.Path, agent: str, default: Config, body: Body = SLIDER
) -> tuple[dict[str, torch.Tensor], Config, int]:
    """Returns the tensors of a checkpoint of `agent`, its config, of the type of `default`, and its context size M.

    Raises:
      InputError: as `load_checkpoint`, or if config or context size are missing or illegal.
      UnplayableError: as `require_body`.
    """
    tensors, metadata = load_checkpoint(path, agent)
    require_body(metadata, agent, body)
    try:
        config, context_size = override(default, metadata["config"]), metadata["context_size"]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: expected metadata with config and context_size, found {error}") from error
    return tensors, config, context_size


def load_into(path: pathlib.Path, module: torch.nn.Module, tensors: Mapping[str, torch.Tensor]) -> None:
    """Copies `tensors` into `module`.

    Raises:
      InputError: if a name or a shape differs, or there are whole numbers for floats.
    """
    for name, wanted in module.state_dict().items():
        if name in tensors and tensors[name].is_floating_point() != wanted.is_floating_point():
            raise InputError(f"{path}: expected {wanted.dtype} in {name}, found {tensors[name].dtype}")
    try:
        module.load_state_dict(dict(tensors))
    except RuntimeError as error:
        raise InputError(f"{path}: {shortened(str(error))}") from error
