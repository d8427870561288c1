"""Frozen dataclasses to plain data and back, strictly.

Comes in: dataclasses, or the dictionaries and lists of a JSON file. An unknown, missing or mistyped
key is an error that names its dotted path. Knows nothing of what the classes mean.
"""

from __future__ import annotations

import dataclasses
import reprlib
import types
import typing
from collections.abc import Mapping
from typing import Any, Literal, TypeVar

T = TypeVar("T")


class SpecError(ValueError):
    """A spec or manifest does not have the form that this version of facecode reads."""


def to_plain(value: Any) -> Any:  # noqa: ANN401
    """Dataclasses and tuples as dictionaries and lists, ready for JSON."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {key: to_plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [to_plain(item) for item in value]
    return value


def from_plain(cls: type[T], data: object, where: str = "") -> T:
    """Build dataclass `cls` from plain data; an unknown, missing or mistyped key is an error.

    Raises:
        SpecError: with the dotted path of the offending key.
    """
    where = where or cls.__name__
    if not isinstance(data, Mapping):
        raise SpecError(f"{where}: expected an object, got {type(data).__name__}")
    hints = typing.get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    if unknown := sorted(map(str, set(data) - set(fields))):
        raise SpecError(
            f"{where}: unknown key {reprlib.repr(', '.join(unknown))}; known: {', '.join(fields)}"
        )
    required = {n for n, f in fields.items() if _has_no_default(f)}
    if missing := sorted(required - set(data)):
        raise SpecError(f"{where}: missing key {', '.join(missing)}")
    values = {name: _convert(hints[name], item, f"{where}.{name}") for name, item in data.items()}
    return cls(**values)


def _convert_union(options: list[Any], value: Any, where: str) -> Any:  # noqa: ANN401
    """The one of several plain types that `value` has, or the one type beside None."""
    if value is None:
        return None
    if len(options) == 1:
        return _convert(options[0], value, where)
    if isinstance(value, bool) or not isinstance(value, tuple(options)):
        names = " or ".join(option.__name__ for option in options)
        raise SpecError(f"{where}: expected {names}, got {reprlib.repr(value)}")
    return value


def _has_no_default(f: dataclasses.Field[Any]) -> bool:
    return f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING


def _convert(hint: Any, value: Any, where: str) -> Any:  # noqa: ANN401
    """`value` as the type that the annotation `hint` names."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin is types.UnionType or origin is typing.Union:
        return _convert_union([a for a in args if a is not type(None)], value, where)
    if origin is Literal:
        if value not in args:
            raise SpecError(
                f"{where}: got {reprlib.repr(value)}, expected one of {', '.join(map(repr, args))}"
            )
        return value
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return from_plain(hint, value, where)
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise SpecError(f"{where}: expected a list, got {type(value).__name__}")
        return tuple(_convert(args[0], item, f"{where}[{i}]") for i, item in enumerate(value))
    if origin is not None and issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            raise SpecError(f"{where}: expected an object, got {type(value).__name__}")
        return {
            str(k): _convert(args[1], item, f"{where}.{str(k)[:60]}") for k, item in value.items()
        }
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, hint) or (isinstance(value, bool) and hint is not bool):
        raise SpecError(f"{where}: expected {hint.__name__}, got {reprlib.repr(value)}")
    return value
