"""`mazebench merge`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from mazebench.commands.display import load_mujoco


def merge(
    folder: Annotated[pathlib.Path, typer.Argument(metavar="DIR", help="The --out of `mazebench eval --shard`.")],
) -> None:
    """Make one run of the shares that `mazebench eval --shard` has run."""
    load_mujoco(renders=False)
    from mazebench.commands.summary_table import print_suite, print_summary
    from mazebench.evaluation.shards import merge as merge_shards

    results = merge_shards(folder)
    if results[0].summary.suite is None:
        print_summary(results[0].summary)
    else:
        print_suite(results)
    print(f"results in {folder}")
