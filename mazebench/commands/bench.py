"""`mazebench bench`."""

from __future__ import annotations

import json
import sys
from typing import Annotated

import typer

from mazebench.commands.display import load_mujoco
from mazebench.errors import remark
from mazebench.world.backend import RenderingError


def bench(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter runs, noisier figures.")] = False,
) -> None:
    """Measure speed on this machine, as ratios to the bare simulation taken in the same run."""
    try:
        load_mujoco(renders=True)
    except RenderingError as error:
        remark(f"{error}; pictures are not measured")
        load_mujoco(renders=False)
    from mazebench.bench import measure

    results = measure.run(quick=quick, say=lambda line: print(line, file=sys.stderr))
    if as_json:
        print(json.dumps(results, indent=1))
    else:
        measure.print_tables(results)
