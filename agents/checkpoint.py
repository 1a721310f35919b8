"""Checkpoints: safetensors with JSON metadata, never pickle; written whole or not at all, read with suspicion."""

from __future__ import annotations

import json
import pathlib
import struct
from collections.abc import Callable, Mapping
from typing import Any

import safetensors
import safetensors.torch
import torch

from mazebench.errors import InputError
from mazebench.files import open_whole, read_at_most
from mazebench.maps.maze import MAX_SIZE
from mazebench.records import parse_json

from .overrides import Config, override

FORMAT = "mazebench-agent-1"
AGENT_FILE = "agent.safetensors"

_MAX_BYTES = 256 * 2**20
_MAX_HEADER_BYTES = 2**20


def save_checkpoint(path: pathlib.Path, tensors: Mapping[str, torch.Tensor], metadata: Mapping[str, Any]) -> None:
    """Writes `tensors` and `metadata`; a reader finds the file from before or the whole new one."""
    # One key only: the order of several in the file would be left to chance.
    header = {FORMAT: json.dumps(metadata, sort_keys=True)}
    content = safetensors.torch.save({name: tensor.detach().contiguous() for name, tensor in tensors.items()}, header)
    with open_whole(path) as file:
        file.write(content)


def load_checkpoint(path: pathlib.Path, agent: str) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """The tensors and the metadata of a checkpoint of `agent`.

    Raises:
      InputError: if the file can't be read, is no such checkpoint, or another agent's.
    """
    content = _read(path)
    _check_header(path, content)
    try:
        tensors = safetensors.torch.load(content)
        metadata = parse_json(parse_json(content[8 : 8 + _header_length(content)])["__metadata__"][FORMAT])
    # RuntimeError is torch's, of shapes that no tensor can have.
    except (safetensors.SafetensorError, ValueError, KeyError, TypeError, RuntimeError) as error:
        said = str(error)[:120]
        raise InputError(f"{path}: expected a checkpoint of {FORMAT}, found a damaged one: {said}") from error
    if not isinstance(metadata, dict) or metadata.get("agent") != agent:
        found = metadata.get("agent") if isinstance(metadata, dict) else metadata
        raise InputError(f"{path}: expected a checkpoint of agent {agent!r}, found one of {str(found)[:80]!r}")
    return tensors, metadata


def load_agent(path: pathlib.Path, agent: str, default: Config) -> tuple[dict[str, torch.Tensor], Config, int]:
    """The tensors of a checkpoint of `agent`, its config, in the kind of `default`, and the context size M it is for.

    Raises:
      InputError: if the file can't be read, is no such checkpoint, another agent's, or lacks any of them.
    """
    tensors, metadata = load_checkpoint(path, agent)
    try:
        config = override(default, metadata["config"])
        context_size = metadata["context_size"]
        if type(context_size) is not int or not 3 <= context_size <= MAX_SIZE:
            raise ValueError(f"context_size {str(context_size)[:80]}")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: expected metadata with config and context_size, found {error}") from error
    return tensors, config, context_size


def check_shapes(path: pathlib.Path, make: Callable[[], torch.nn.Module], tensors: Mapping[str, torch.Tensor]) -> None:
    """Does nothing if `tensors` are of the network that `make` makes, which takes no memory here.

    For before it is made: a config from outside may name sizes that no machine has room for.

    Raises:
      InputError: if a name or a shape doesn't fit; the message names the first.
    """
    with torch.device("meta"):
        wanted = make().state_dict()
    _check_kinds(path, wanted, tensors)


def load_into(path: pathlib.Path, module: torch.nn.Module, tensors: Mapping[str, torch.Tensor]) -> None:
    """Puts `tensors` into `module`.

    Raises:
      InputError: if a name, a shape or a type doesn't fit, or a number is not finite; the message names the first.
    """
    _check_kinds(path, module.state_dict(), tensors)
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise InputError(f"{path}: expected finite numbers in {name}, found others")
    module.load_state_dict(dict(tensors))


def _check_kinds(path: pathlib.Path, wanted: Mapping[str, torch.Tensor], tensors: Mapping[str, torch.Tensor]) -> None:
    for name in sorted(set(wanted) | set(tensors)):
        expected = _kind(wanted[name]) if name in wanted else "no such tensor"
        found = _kind(tensors[name]) if name in tensors else "no such tensor"
        if expected != found:
            raise InputError(f"{path}: expected {name} {expected}, found {found}")


def _kind(tensor: torch.Tensor) -> str:
    """Its shape, and its type where that is not the usual one."""
    kind = "" if tensor.dtype == torch.float32 else f" {tensor.dtype}"
    return f"{tuple(tensor.shape)}{kind}"


def _read(path: pathlib.Path) -> bytes:
    content = read_at_most(path, _MAX_BYTES, "checkpoint")
    if len(content) > _MAX_BYTES:
        raise InputError(f"{path}: expected a checkpoint of at most {_MAX_BYTES} bytes, found more")
    return content


def _check_header(path: pathlib.Path, content: bytes) -> None:
    """Refuses what the parser need not see: other formats (pickle) and headers of absurd length."""
    length = _header_length(content)
    if not 2 <= length <= min(_MAX_HEADER_BYTES, len(content) - 8) or content[8:9] != b"{":
        raise InputError(
            f"{path}: expected a safetensors file with a header of at most {_MAX_HEADER_BYTES} bytes, found none"
        )


def _header_length(content: bytes) -> int:
    return struct.unpack("<Q", content[:8])[0] if len(content) >= 8 else 0
