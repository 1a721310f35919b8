"""`mazebench bench`."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from mazebench.commands.display import load_mujoco


def bench(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter runs, noisier figures.")] = False,
) -> None:
    """Measure speed on this machine in a minute, as ratios taken in the same run."""
    load_mujoco(renders=False)
    from mazebench.bench import run
    from mazebench.commands.summary_table import print_table

    results = run(quick)
    if as_json:
        print(json.dumps(results, indent=1))
        return
    print(f"{results.pop('cores')} cores, MuJoCo {results.pop('mujoco')}")
    for name, rows in results.items():
        cells = [[row["name"], f"{row['steps/s']:,}", f"{row['ratio']:.2f}"] for row in rows]
        print_table(f"{name}: agent steps per second, and their ratio to the first row's", list(rows[0]), cells)
