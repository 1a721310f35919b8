"""Usage: check_contents.py SOURCES DIST. Compares wheel and sdist in DIST with the sources they were built from."""

import email
import pathlib
import sys
import tarfile
import tomllib
import zipfile

from packaging.metadata import Metadata
from readme_renderer import markdown

REQUIRED = (
    *("name", "version", "summary", "description", "description_content_type", "keywords", "classifiers"),
    *("license_expression", "license_files", "requires_python", "requires_dist", "provides_extra"),
)
BUILT = {"PKG-INFO", "setup.cfg"}  # what the sdist has beside the sources, with the egg-info

sources, dist = map(pathlib.Path, sys.argv[1:])
setuptools = tomllib.loads((sources / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
wheel_path, sdist_path = next(dist.glob("*.whl")), next(dist.glob("*.tar.gz"))


def compare(what: str, found: set[str], expected: set[str]) -> None:
    """Ends with what is missing and what is too much."""
    missing, surplus = sorted(expected - found), sorted(found - expected)
    if missing or surplus:
        sys.exit(f"{what}: missing {missing}, not expected {surplus}")
    print(f"{what}: {len(found)} files")


def source_files(folder: pathlib.Path) -> set[str]:
    """Relative to `folder`."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


# The packages' folders as they are installed, and the wheel's own records; no tests, no documents.
folders = {"mazebench": "mazebench", **setuptools["package-dir"]}
expected = {f"{package}/{name}" for package, folder in folders.items() for name in source_files(sources / folder)}
with zipfile.ZipFile(wheel_path) as wheel:
    names = set(wheel.namelist())
    info = next(name for name in names if name.endswith(".dist-info/METADATA")).removesuffix("METADATA")
    records = ("METADATA", "WHEEL", "RECORD", "entry_points.txt", "top_level.txt", "licenses/LICENSE")
    compare("wheel", names, expected | {info + name for name in records})
    metadata = wheel.read(info + "METADATA")
for name in ("mazebench/py.typed", "mazebench_agents/py.typed"):
    assert name in names, name

with tarfile.open(sdist_path) as sdist:
    found = {member.name.partition("/")[2] for member in sdist.getmembers() if member.isfile()}
found = {name for name in found if not name.startswith("mazebench_mujoco.egg-info/")}
compare("sdist", found, source_files(sources) | BUILT)

said = Metadata.from_email(metadata, validate=True)  # raises on what the specification does not allow
empty = [name for name in REQUIRED if not getattr(said, name)]
if empty:
    sys.exit(f"metadata: nothing in {empty}")
if markdown.render(email.message_from_bytes(metadata).get_payload(decode=True).decode("utf-8")) is None:
    sys.exit("README.md can't be rendered")
print(f"metadata: {said.name} {said.version}, Python {said.requires_python}, {len(said.classifiers)} classifiers")
