"""Writes the tables and figures of results into README.md and docs, from the records that are kept: `make results`.

    python -m benchmarks.results                  writes all tables and figures
    python -m benchmarks.results keep FOLDER...   keeps folders of results in records/
    python -m benchmarks.results episodes CSV     writes every episode as a line, for rliable and other tools
    python -m benchmarks.results recall FOLDER    evaluates the agents of the table of recall, or goes on with that;
                                                  FOLDER is to be kept

`records/` holds finished evaluations, an archive for each folder of results: `tar xf records/tracks.tar.xz` gives a
folder that `mazebench report` and `mazebench compare` read.
"""

from __future__ import annotations

import itertools
import pathlib
import sys

from benchmarks.results.kept import RECALL, RECALL_AGENTS, RECALL_SETTINGS, keep, read_kept
from benchmarks.results.results_figures import figures
from benchmarks.results.results_tables import PAGES, RECORDS, ROOT, with_tables
from mazebench.evaluation.evaluate import evaluate
from mazebench.report.figures import stack, to_svg

match sys.argv[1:]:
    case []:
        kept = read_kept(RECORDS)
        for page in PAGES:
            (ROOT / page).write_bytes(with_tables(page, (ROOT / page).read_text("utf-8"), kept).encode())
        for name, figure in figures(kept).items():
            (ROOT / f"docs/images/{name}.svg").write_bytes(to_svg(figure))
            if not name.startswith("paths"):  # whose panels are a grid
                (ROOT / f"docs/images/{name}-narrow.svg").write_bytes(to_svg(stack(figure)))
    case ["keep", *folders]:
        for folder in folders:
            path = keep(pathlib.Path(folder), RECORDS)
            print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")
    case ["episodes", out]:
        columns = ["agent", "run", "setting", "episode", "leg", "maze", "success", "steps", "oracle_steps"]
        read_kept(RECORDS).episodes.reset_index()[columns].to_csv(out, index=False)
    case ["recall", out]:
        for agent, (track, level) in itertools.product(RECALL_AGENTS, RECALL_SETTINGS):
            folder = pathlib.Path(out, RECALL, agent, f"{track}-{level}")
            evaluate(agent, track, folder, level=level, split="eval", resume=True)
    case _:
        sys.exit(__doc__)
