"""Describes the frozen mazes and episodes as a Croissant data set: `python -m benchmarks.croissant`.

It brings assets/croissant.json (Croissant 1.1 with the fields of its RAI vocabulary) up to date with the manifests of
the two benchmarks, with CITATION.cff and with `Source` of `[project.urls]` in pyproject.toml. The texts of the data set
are in the file itself. It has no address and no date of publication as long as the other files have none.
"""

from __future__ import annotations

import hashlib
import json
import pathlib
import tomllib
from typing import Any

import yaml

from mazebench.errors import InputError
from mazebench.maps.benchmark import MANIFEST, PAPER_BENCHMARK, TRACKS_BENCHMARK, manifest

ROOT = pathlib.Path(__file__).parent.parent
ASSETS = ROOT / "assets"
OUT = ASSETS / "croissant.json"
FOLDERS = {PAPER_BENCHMARK: "paper_mazes", TRACKS_BENCHMARK: "tracks"}

# Of a file of episodes: what each column means, and its type.
_COLUMNS = {
    "maze": ("index of the maze in its split, from 0; in tracks, kind by kind as the manifest lists them", "Integer"),
    "start_row": ("row of the start cell, from 0 at the top", "Integer"),
    "start_column": ("column of the start cell, from 0 at the left", "Integer"),
    "goal_row": ("row of the goal cell", "Integer"),
    "goal_column": ("column of the goal cell", "Integer"),
    "distance": ("cells from start to goal along a shortest path on the grid", "Integer"),
    "yaw": ("heading at the start, in radians", "Float"),
    "seed": ("seed of all else that the episode draws, such as errors of the map and noise", "Integer"),
    "shortest_path": ("metres that a disc of 0.15 m radius drives at least to the goal cell", "Float"),
    "oracle_steps": ("steps to the goal that the agent oracle takes, empty where it misses the goal", "Integer"),
}


def describe() -> dict[str, Any]:
    """Returns the description of the data set, as JSON-LD."""
    description = json.loads(OUT.read_text(encoding="ascii"))
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    authors = [author["name"] for author in citation["authors"]]
    bibtex = {
        "title": citation["title"],
        "author": " and ".join(f"{{{name}}}" for name in authors),
        "version": citation["version"],
    }
    fields = ", ".join(f"{name}={{{value}}}" for name, value in bibtex.items())
    paths = [
        (benchmark, f"{folder}/{name}")
        for benchmark, folder in FOLDERS.items()
        for name in (MANIFEST, *manifest(benchmark)["files"])
    ]
    description |= {
        "license": f"https://spdx.org/licenses/{citation['license']}.html",
        "creator": [{"@type": "sc:Organization", "name": name} for name in authors],
        "keywords": citation["keywords"],
        "version": f"{manifest(TRACKS_BENCHMARK)['version']}.0.0",  # of the benchmarks, not of the package
        "citeAs": f"@software{{mazebench, {fields}, year={{{description['dateCreated'][:4]}}}}}",
        "distribution": [_file(*each) for each in paths],
        "recordSet": [_record_set(path) for _, path in paths if "/episodes-" in path or "/mazes-" in path],
    }
    if "Source" in project["urls"]:
        description["url"] = project["urls"]["Source"]
    if "date-released" in citation:
        description["datePublished"] = str(citation["date-released"])
    return description


def _file(benchmark: str, path: str) -> dict[str, Any]:
    """Returns a file of the distribution, which must have the manifest's hash; its address is relative to `OUT`."""
    content, name = (ASSETS / path).read_bytes(), path.rpartition("/")[2]
    found = hashlib.sha256(content).hexdigest()
    if found != manifest(benchmark)["files"].get(name, found):
        raise InputError(f"{path}: expected the SHA-256 of the manifest, found {found}")
    return {
        "@type": "cr:FileObject",
        "@id": path,
        "name": name,
        "contentUrl": path,
        "contentSize": f"{len(content)} B",
        "encodingFormat": {"csv": "text/csv", "json": "application/json", "txt": "text/plain"}[name.rpartition(".")[2]],
        "sha256": found,
    }


def _record_set(path: str) -> dict[str, Any]:
    """Returns the records of a file: frozen episodes, or the rows of mazes."""
    name, _, suffix = path.replace("/", "-").rpartition(".")
    if suffix == "csv":
        text = "The frozen episodes of a task, size and split, one a record."
        fields = [(column, meaning, kind, {"column": column}) for column, (meaning, kind) in _COLUMNS.items()]
    else:
        text = "The mazes of a split, row by row from the top. A maze has as many rows as a row has characters."
        meaning = "A row of cells, from left to right: # is a wall, . is free."
        fields = [("row", meaning, "Text", {"fileProperty": "lines"})]
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": text,
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"{name}/{field}",
                "name": field,
                "description": meaning,
                "dataType": f"sc:{kind}",
                "source": {"fileObject": {"@id": path}, "extract": extract},
            }
            for field, meaning, kind, extract in fields
        ],
    }


if __name__ == "__main__":
    OUT.write_text(json.dumps(describe(), indent=1) + "\n", encoding="ascii")
