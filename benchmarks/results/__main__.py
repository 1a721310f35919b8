"""Writes the tables and figures of results into README.md and docs, from the records that are kept: `make results`.

`records/` holds finished evaluations, an archive for each folder of results: `tar xf records/tracks.tar.xz` gives a
folder that `mazebench report` and `mazebench compare` read. `python -m benchmarks.results keep FOLDER...` adds some.
"""

from __future__ import annotations

import pathlib

import typer

from benchmarks.results.kept import keep, read_kept
from benchmarks.results.results_figures import figures
from benchmarks.results.results_tables import PAGES, RECORDS, ROOT, with_tables
from mazebench.report.figures import to_svg
from mazebench.storage.files import open_whole

app = typer.Typer(help="Write the tables and figures of results into the pages, from the records that are kept.")


@app.callback(invoke_without_command=True)
def write(context: typer.Context) -> None:
    """Write all tables and figures."""
    if context.invoked_subcommand is None:
        kept = read_kept(RECORDS)
        files = {name: with_tables((ROOT / name).read_text(encoding="utf-8"), kept).encode() for name in PAGES}
        files |= {f"docs/images/{drawn.name}.svg": to_svg(drawn.figure) for drawn in figures(kept)}
        for name, content in files.items():
            with open_whole(ROOT / name) as file:
                file.write(content)


@app.command("keep")
def keep_folders(folders: list[pathlib.Path]) -> None:
    """Keep folders of results in records/."""
    for folder in folders:
        path = keep(folder, RECORDS)
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


@app.command("episodes")
def write_episodes(out: pathlib.Path) -> None:
    """Write every episode that is kept as a line of a CSV file, for rliable and other tools."""
    columns = ["agent", "run", "setting", "episode", "maze", "success", "steps", "oracle_steps"]
    read_kept(RECORDS).episodes.reset_index()[columns].to_csv(out, index=False)


if __name__ == "__main__":
    app()
