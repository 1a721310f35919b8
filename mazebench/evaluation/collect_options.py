"""The options of a collection of demonstrations."""

from __future__ import annotations

import dataclasses
import importlib.util
from typing import Annotated

from annotated_types import Ge

from mazebench.errors import InputError
from mazebench.options import Doc, OneOf, Options

MINARI, NPZ = "minari", "npz"


@dataclasses.dataclass(frozen=True, kw_only=True)
class CollectOptions(Options):
    """Number and format of demonstrations that are collected.

    Raises:
      InputError: if a value is not allowed.
    """

    episodes: Annotated[int, Ge(1), Doc("How many episodes.")] = 100
    format: Annotated[
        str | None,
        OneOf(MINARI, NPZ),
        Doc("A Minari data set, or files of arrays; minari if not given and Minari is installed."),
    ] = None

    @property
    def format_in_use(self) -> str:
        """The format, also where none is given.

        Raises:
          InputError: if Minari is asked for and not installed.
        """
        is_installed = importlib.util.find_spec("minari") is not None
        if self.format == MINARI and not is_installed:
            raise InputError("--format minari needs Minari, which the extra [minari] brings (docs/start.md)")
        return self.format or (MINARI if is_installed else NPZ)
