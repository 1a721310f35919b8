"""Bodies of one's own: a YAML file says what a rolling body needs, and results store the same values."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Mapping
from typing import Annotated, Any

import pydantic
from annotated_types import Interval

from mazebench.constants import STEP_TIME
from mazebench.errors import InputError, describe_fault, unknown
from mazebench.world.bodies import BODIES, Body, RollingBody

_DIGITS = 9  # of a turn rate, which is stored as the rad of a step


class _Described(pydantic.BaseModel):
    """The keys of a description; all but the name and the places of sensors are needed."""

    model_config = pydantic.ConfigDict(extra="forbid", strict=True)

    name: Annotated[str, pydantic.Field(pattern=r"^[\w][\w .-]{0,39}$")]
    radius: Annotated[float, Interval(ge=0.03, le=2)]  # m
    height: Annotated[float, Interval(ge=0.02, le=3)]  # m
    mass: Annotated[float, Interval(ge=0.05, le=2000)]  # kg
    top_speed: Annotated[float, Interval(ge=0.02, le=5)]  # m/s
    turn_rate: Annotated[float, Interval(ge=0.05, le=12)]  # rad/s
    acceleration: Annotated[float, Interval(ge=0.02, le=50)]  # m/s^2
    turn_acceleration: Annotated[float, Interval(ge=0.05, le=200)]  # rad/s^2
    camera_height: Annotated[float | None, Interval(ge=0.02, le=0.9)] = None  # m, below the top of the walls
    camera_offset: float = 0.0  # m, within the radius
    lidar_offset: float = 0.0  # m, within the radius


def body_of(value: Any) -> str | Body:
    """Returns the name of a body that ships, or a body of one's own.

    Args:
      value: a name, the path of a YAML file, the values that such a file has, or a body.

    Raises:
      InputError: if there is no such body or file, or a value is not allowed.
    """
    if isinstance(value, Body):
        return value.name if BODIES.get(value.name) == value else value
    if isinstance(value, Mapping):
        return _read(value, "body")
    if isinstance(value, str) and value in BODIES:
        return value
    path = pathlib.Path(value) if isinstance(value, str | pathlib.Path) else None
    if path is None or path.suffix not in (".yaml", ".yml"):
        raise InputError(f"{unknown('body', value, BODIES)}; one of your own is the path of a YAML file")
    from mazebench.storage.yaml_files import load_yaml  # which few tasks need

    content = load_yaml(path, "body")
    if not isinstance(content, Mapping):
        raise InputError(f"{path}: expected a body's keys, such as radius: 0.2, found {str(content)[:60]!r}")
    stem = re.sub(r"[^\w.-]", "-", path.stem)[:40]
    return _read({"name": stem, **content}, str(path))


def _read(values: Mapping[Any, Any], where: str) -> RollingBody:
    """Returns the body of a description, which was found `where`."""
    try:
        read = _Described.model_validate({str(key): value for key, value in values.items()})
    except pydantic.ValidationError as error:
        fault = describe_fault(error)
        missing = "" if "required" not in fault else f"; a body has {', '.join(_Described.model_fields)}"
        raise InputError(f"{where}: {fault}{missing}") from error
    if read.name in BODIES:
        raise InputError(f"{where}: expected a name of its own, found {read.name!r}, which ships")
    for name in ("camera_offset", "lidar_offset"):
        if not abs(offset := getattr(read, name)) <= read.radius:
            raise InputError(f"{where}: expected {name} within the radius, {read.radius:g} m, found {offset:g}")
    turn_rate, height = round(read.turn_rate, _DIGITS), read.camera_height
    return RollingBody(
        **read.model_dump(exclude={"turn_rate", "camera_height"}),
        turn_step=turn_rate * STEP_TIME,
        camera_height=min(max(0.8 * read.height, 0.02), 0.9) if height is None else height,
    )


def to_json(body: str | Body) -> Any:
    """Returns what `body_of` makes the body of, in values that JSON has: a name, or the description.

    Raises:
      InputError: if it is a body of one's own that slides, which no description has.
    """
    if isinstance(body, str):
        return body
    if not isinstance(body, RollingBody):
        raise InputError(f"body {body.name!r}: expected a rolling body, or one that is an entry of BODIES")
    values = {name: getattr(body, name) for name in _Described.model_fields}
    return values | {"turn_rate": round(body.turn_rate, _DIGITS)}
