"""ROS 2 messages as classes of Eclipse Cyclone DDS's Python package, from messages.idl.

The grammar of that file is small (modules in one line, structs, members of named types, sequences and arrays), so it
is read here instead of by a generator that would have to be installed.
"""

import pathlib
import re
from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct, types
from cyclonedds.idl.annotations import final

IDL = pathlib.Path(__file__).with_name("messages.idl")

PRIMITIVES = {
    "float": (types.float32, 0.0),
    "double": (types.float64, 0.0),
    "boolean": (bool, False),
    "uint8": (types.uint8, 0),
    "int8": (types.int8, 0),
    "uint16": (types.uint16, 0),
    "int16": (types.int16, 0),
    "uint32": (types.uint32, 0),
    "int32": (types.int32, 0),
    "string": (str, ""),
}


def _member(text, classes):
    """Type and default of the member `text`, such as `sequence<uint8> data`."""
    kind, name = text.rsplit(" ", 1)
    array = re.fullmatch(r"(\w+)\[(\d+)\]", name)
    sequence = re.fullmatch(r"sequence<(.+)>", kind)
    if sequence:
        inner = PRIMITIVES[sequence[1]][0] if sequence[1] in PRIMITIVES else classes[sequence[1]]
        return name, types.sequence[inner], field(default_factory=list)
    if array:
        inner, default = PRIMITIVES[kind]
        length = int(array[2])
        return array[1], types.array[inner, length], field(default_factory=lambda: [default] * length)
    if kind in PRIMITIVES:
        inner, default = PRIMITIVES[kind]
        return name, inner, field(default=default)
    inner = classes[kind]
    return name, inner, field(default_factory=inner)


def load():
    """All structs by their name on the wire, `sensor_msgs::msg::dds_::Image_`."""
    classes = {}
    struct = r"module (\w+) \{ module msg \{ module dds_ \{\s*@final struct (\w+) \{(.*?)\};"
    for package, name, body in re.findall(struct, IDL.read_text(), re.S):
        members = [_member(text.strip(), classes) for text in body.split(";") if text.strip()]
        namespace = type(IdlStruct).__prepare__(name, (IdlStruct,), typename=f"{package}.msg.dds_.{name}")
        namespace["__annotations__"] = {member: kind for member, kind, _ in members}
        namespace["__module__"] = __name__
        namespace.update({member: default for member, _, default in members})
        cls = type(IdlStruct)(name, (IdlStruct,), namespace)
        classes[f"{package}::msg::dds_::{name}"] = final(dataclass(cls))
    return classes


TYPES = load()


def ros(name):
    """The class of `package/Name`."""
    package, short = name.split("/")
    return TYPES[f"{package}::msg::dds_::{short}_"]
