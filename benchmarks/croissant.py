"""Describes the frozen mazes and episodes as a Croissant data set: `python -m benchmarks.croissant`.

It brings assets/croissant.json (Croissant 1.1 with the fields of its RAI vocabulary) up to date with the manifests of
the three benchmarks, with CITATION.cff and with `Source` of `[project.urls]` in pyproject.toml. The file itself has the
texts and the records of each file (`recordSet`). It has no address and no date of publication as long as the other
files have none.
"""

from __future__ import annotations

import hashlib
import json
import pathlib
import tomllib
from typing import Any

import yaml

from mazebench.errors import InputError
from mazebench.maps.benchmark import FOLDERS, MANIFEST, TRACKS_BENCHMARK, manifest

ROOT = pathlib.Path(__file__).parent.parent
ASSETS = ROOT / "assets"
OUT = ASSETS / "croissant.json"


def describe() -> dict[str, Any]:
    """Returns the description of the data set, as JSON-LD."""
    description = json.loads(OUT.read_text(encoding="ascii"))
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    authors = [author["name"] for author in citation["authors"]]
    description |= {
        "license": f"https://spdx.org/licenses/{citation['license']}.html",
        "creator": [{"@type": "sc:Organization", "name": name} for name in authors],
        "keywords": citation["keywords"],
        "version": f"{manifest(TRACKS_BENCHMARK)['version']}.0.0",  # of the benchmarks, not of the package
        "citeAs": f"@software{{mazebench, title={{{citation['title']}}}, "
        f"author={{{' and '.join(f'{{{name}}}' for name in authors)}}}, version={{{citation['version']}}}, "
        f"year={{{description['dateCreated'][:4]}}}}}",
        "distribution": [
            _file(benchmark, f"{folder}/{name}")
            for benchmark, folder in FOLDERS.items()
            for name in (MANIFEST, *manifest(benchmark)["files"])
        ],
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


if __name__ == "__main__":
    OUT.write_text(json.dumps(describe(), indent=1) + "\n", encoding="ascii")
