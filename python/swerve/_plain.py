"""Messages as plain values of Python and back: dictionaries by field name, as serde has them."""

from __future__ import annotations

import dataclasses
import sys
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeAlias, TypeVar, Union

import numpy as np
from numpy.typing import NDArray

#: The numbers of an image: `(rows, columns, 3)` bytes for `rgb8`, else `(rows, columns)`: 32-bit floats for depth in
#: metres, bytes for classes, 32-bit integers for instances.
Pixels: TypeAlias = NDArray[Any]

_M = TypeVar("_M", bound="Message")
_Converter = Callable[[Any], Any]


@dataclass(slots=True)
class Message:
    """A message, or a part of one."""

    @classmethod
    def from_plain(cls: type[_M], plain: dict[str, Any]) -> _M:
        """The message that a dictionary by field name describes; logs of earlier versions lack lists and flags."""
        fields = {name: decode(plain.get(name)) for name, decode, _ in _converters(cls)}
        if "pixels" in fields:
            fields["pixels"] = _pixels(fields["pixels"], fields["height_px"], fields["width_px"])
        return cls(**fields)

    def to_plain(self) -> dict[str, Any]:
        """The message as a dictionary by field name."""
        return {name: encode(getattr(self, name)) for name, _, encode in _converters(type(self))}


@dataclass(frozen=True, slots=True)
class Tagged:
    """One of several kinds of value."""


@dataclass(slots=True)
class Transform(Message):
    """From one frame to another: turned first, then moved."""

    rotation: tuple[float, float, float, float]
    """Unit quaternion: x, y, z, w."""
    translation: tuple[float, float, float]
    """Metres."""

    def matrix(self) -> NDArray[np.float64]:
        """The same as a matrix of four rows and columns."""
        x, y, z, w = self.rotation
        matrix = np.eye(4)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        matrix[:3, 3] = self.translation
        return matrix


_known: dict[type, list[tuple[str, _Converter, _Converter]]] = {}


def _converters(cls: type) -> list[tuple[str, _Converter, _Converter]]:
    """For each field its name and what makes it of a plain value and the other way round."""
    if cls not in _known:
        hints = typing.get_type_hints(cls, vars(sys.modules[cls.__module__]))
        names = [field.name for field in dataclasses.fields(cls)]
        _known[cls] = [(name, _decoder(hints[name]), _encoder(hints[name])) for name in names]
    return _known[cls]


def _same(value: Any) -> Any:
    return value


def _parts(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    return typing.get_origin(hint), typing.get_args(hint)


def _optional(hint: Any) -> Any | None:
    """The type that is there or `None`, if that is what the hint says."""
    origin, arguments = _parts(hint)
    if origin in (Union, types.UnionType) and len(arguments) == 2 and type(None) in arguments:
        return next(argument for argument in arguments if argument is not type(None))
    return None


def _array(hint: Any) -> Any | None:
    """What an array consists of: a type of number, or `Any` for pixels."""
    origin, arguments = _parts(hint)
    return _parts(arguments[1])[1][0] if origin is np.ndarray else None


def _decoder(hint: Any) -> _Converter:
    inner = _optional(hint)
    if inner is not None:
        decode = _decoder(inner)
        return lambda value: None if value is None else decode(value)
    number = _array(hint)
    if number is Any:
        return _same  # Pixels: their shape is in other fields.
    if number is not None:
        return lambda value: _numbers(value, number)
    origin, arguments = _parts(hint)
    if origin is list:
        decode = _decoder(arguments[0])
        return lambda values: [decode(value) for value in values or ()]
    if origin is tuple:
        return tuple
    if hint is bool:
        return bool
    if isinstance(hint, type):
        if issubclass(hint, Message):
            return hint.from_plain
        if issubclass(hint, Enum):
            return hint
        if issubclass(hint, Tagged):
            return lambda value: _tagged(hint, value)
    return _same


def _encoder(hint: Any) -> _Converter:
    inner = _optional(hint)
    if inner is not None:
        encode = _encoder(inner)
        return lambda value: None if value is None else encode(value)
    number = _array(hint)
    if number is Any:
        return _pixels_to_plain
    if number is not None:
        return lambda value: np.ascontiguousarray(value, number).tobytes()
    origin, arguments = _parts(hint)
    if origin is list:
        encode = _encoder(arguments[0])
        return lambda values: [encode(value) for value in values]
    if origin is tuple:
        return list
    if isinstance(hint, type):
        if issubclass(hint, Message):
            return lambda value: value.to_plain()
        if issubclass(hint, Enum):
            return lambda value: hint(value).value
        if issubclass(hint, Tagged):
            return _tagged_to_plain
        if issubclass(hint, float):
            return float
        if issubclass(hint, int):
            return hint
    return _same


def _tagged(cls: Any, plain: Any) -> Any:
    if isinstance(plain, str):
        return cls(plain)
    ((kind, value),) = plain.items()
    inner = _optional(typing.get_type_hints(cls, vars(sys.modules[cls.__module__]))["value"])
    return cls(kind, _decoder(inner)(value))


def _tagged_to_plain(value: Any) -> Any:
    if value.value is None:
        return value.kind
    inner = value.value.value if isinstance(value.value, Enum) else value.value
    return {value.kind: inner}


def _numbers(value: Any, number: Any) -> NDArray[Any]:
    """Numbers where they lie, or out of bytes."""
    return np.frombuffer(value, number) if isinstance(value, bytes) else np.asarray(value)


_ENCODINGS: dict[str, Any] = {
    "rgb8": np.uint8,
    "depth_f32_m": np.float32,
    "class_u8": np.uint8,
    "instance_u32": np.uint32,
}


def _pixels(plain: Any, rows: int, columns: int) -> Pixels:
    if not isinstance(plain, dict):
        return np.asarray(plain)
    ((encoding, numbers),) = plain.items()
    array = np.frombuffer(numbers, _ENCODINGS[encoding])
    return array.reshape((rows, columns, 3) if encoding == "rgb8" else (rows, columns))


def _pixels_to_plain(pixels: Pixels) -> dict[str, bytes]:
    if pixels.ndim == 3:
        encoding = "rgb8"
    else:
        same = (name for name, number in _ENCODINGS.items() if name != "rgb8" and pixels.dtype == number)
        encoding = next(same, "")
    if not encoding:
        raise TypeError(f"no image has pixels of shape {pixels.shape} and type {pixels.dtype}")
    return {encoding: np.ascontiguousarray(pixels, _ENCODINGS[encoding]).tobytes()}
