"""YAML files of a user."""

from __future__ import annotations

import pathlib
from typing import Any

import yaml

from mazebench.errors import InputError
from mazebench.storage.files import read_at_most

_MAX_BYTES = 2**16


class _Loader(yaml.SafeLoader):
    """Reads YAML without aliases, by which a few bytes can stand for a content of any size."""

    def compose_node(self, *place: Any) -> yaml.Node | None:
        """Composes the node of the next event."""
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("an alias, which no such file needs")
        return super().compose_node(*place)


def load_yaml(path: pathlib.Path, kind: str) -> Any:
    """Returns the content of the YAML file of a kind of thing, such as "ROS map".

    Raises:
      InputError: if it can't be read or is no YAML.
    """
    text = read_at_most(path, _MAX_BYTES, kind.rpartition(" ")[2])
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: of a date that does not exist
        found = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: expected the YAML file of a {kind}, found {found}") from error
