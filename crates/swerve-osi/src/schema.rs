//! Descriptor of the written messages, for readers that have no OSI.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
    FileDescriptorProto, FileDescriptorSet,
};

/// Names of the written messages and enumerations, with the numbers that OSI gives to their fields and values.
///
/// A line per message or enumeration: its name below `osi3`, then `NUMBER NAME TYPE` for each field, `*` after the type
/// of a repeated one, or `NUMBER NAME` for each value. A type with a dot in front is a message or enumeration.
const LINES: &str = "\
message InterfaceVersion: 1 version_major uint32, 2 version_minor uint32, 3 version_patch uint32
message Timestamp: 1 seconds int64, 2 nanos uint32
message Identifier: 1 value uint64
message Vector3d: 1 x double, 2 y double, 3 z double
message Dimension3d: 1 length double, 2 width double, 3 height double
message Orientation3d: 1 roll double, 2 pitch double, 3 yaw double
message BaseMoving: 1 dimension .Dimension3d, 2 position .Vector3d, 3 orientation .Orientation3d, \
4 velocity .Vector3d, 5 acceleration .Vector3d, 6 orientation_rate .Orientation3d
message BaseStationary: 1 dimension .Dimension3d, 2 position .Vector3d, 3 orientation .Orientation3d
message GroundTruth: 1 version .InterfaceVersion, 2 timestamp .Timestamp, 3 host_vehicle_id .Identifier, \
4 stationary_object .StationaryObject*, 5 moving_object .MovingObject*, 7 traffic_light .TrafficLight*, \
9 lane_boundary .LaneBoundary*, 10 lane .Lane*
message MovingObject: 1 id .Identifier, 2 base .BaseMoving, 3 type .MovingObject.Type, \
5 vehicle_attributes .MovingObject.VehicleAttributes, 6 vehicle_classification .MovingObject.VehicleClassification
enum MovingObject.Type: 0 TYPE_UNKNOWN, 1 TYPE_OTHER, 2 TYPE_VEHICLE, 3 TYPE_PEDESTRIAN, 4 TYPE_ANIMAL
message MovingObject.VehicleAttributes: 2 radius_wheel double, 3 number_wheels uint32, \
4 bbcenter_to_rear .Vector3d, 5 bbcenter_to_front .Vector3d
message MovingObject.VehicleClassification: 1 type .MovingObject.VehicleClassification.Type
enum MovingObject.VehicleClassification.Type: 0 TYPE_UNKNOWN, 1 TYPE_OTHER, 4 TYPE_CAR, 7 TYPE_HEAVY_TRUCK, \
10 TYPE_MOTORCYCLE, 11 TYPE_BICYCLE
message StationaryObject: 1 id .Identifier, 2 base .BaseStationary, 3 classification .StationaryObject.Classification
message StationaryObject.Classification: 1 type .StationaryObject.Classification.Type
enum StationaryObject.Classification.Type: 0 TYPE_UNKNOWN, 1 TYPE_OTHER
message TrafficLight: 1 id .Identifier, 2 base .BaseStationary, 3 classification .TrafficLight.Classification
message TrafficLight.Classification: 1 color .TrafficLight.Classification.Color, \
2 icon .TrafficLight.Classification.Icon, 3 mode .TrafficLight.Classification.Mode, 5 assigned_lane_id .Identifier*
enum TrafficLight.Classification.Color: 0 COLOR_UNKNOWN, 1 COLOR_OTHER, 2 COLOR_RED, 3 COLOR_YELLOW, 4 COLOR_GREEN
enum TrafficLight.Classification.Icon: 0 ICON_UNKNOWN, 1 ICON_OTHER, 2 ICON_NONE
enum TrafficLight.Classification.Mode: 0 MODE_UNKNOWN, 1 MODE_OTHER, 2 MODE_OFF, 3 MODE_CONSTANT
message LaneBoundary: 1 id .Identifier, 2 boundary_line .LaneBoundary.BoundaryPoint*, \
3 classification .LaneBoundary.Classification
message LaneBoundary.BoundaryPoint: 1 position .Vector3d, 2 width double
message LaneBoundary.Classification: 1 type .LaneBoundary.Classification.Type, \
2 color .LaneBoundary.Classification.Color
enum LaneBoundary.Classification.Type: 0 TYPE_UNKNOWN, 1 TYPE_OTHER, 2 TYPE_NO_LINE, 3 TYPE_SOLID_LINE, \
4 TYPE_DASHED_LINE, 5 TYPE_BOTTS_DOTS, 6 TYPE_ROAD_EDGE, 12 TYPE_CURB, 14 TYPE_BARRIER
enum LaneBoundary.Classification.Color: 0 COLOR_UNKNOWN, 1 COLOR_OTHER, 2 COLOR_NONE, 3 COLOR_WHITE, \
4 COLOR_YELLOW, 5 COLOR_RED, 6 COLOR_BLUE
message Lane: 1 id .Identifier, 2 classification .Lane.Classification
message Lane.Classification: 1 type .Lane.Classification.Type, 3 centerline .Vector3d*, \
4 centerline_is_driving_direction bool, 5 left_adjacent_lane_id .Identifier*, 6 right_adjacent_lane_id .Identifier*, \
7 lane_pairing .Lane.Classification.LanePairing*, 8 right_lane_boundary_id .Identifier*, \
9 left_lane_boundary_id .Identifier*, 12 subtype .Lane.Classification.Subtype
message Lane.Classification.LanePairing: 1 antecessor_lane_id .Identifier, 2 successor_lane_id .Identifier
enum Lane.Classification.Type: 0 TYPE_UNKNOWN, 1 TYPE_OTHER, 2 TYPE_DRIVING, 3 TYPE_NONDRIVING, 4 TYPE_INTERSECTION
enum Lane.Classification.Subtype: 0 SUBTYPE_UNKNOWN, 1 SUBTYPE_OTHER, 2 SUBTYPE_NORMAL, 3 SUBTYPE_BIKING, \
4 SUBTYPE_SIDEWALK, 5 SUBTYPE_PARKING, 9 SUBTYPE_SHOULDER";

/// Name of the package of all messages.
const PACKAGE: &str = "osi3";

/// Descriptor of `osi3.GroundTruth`, as MCAP stores it: a `FileDescriptorSet`.
pub(crate) fn descriptor() -> Vec<u8> {
    FileDescriptorSet { file: vec![file()] }.encode_to_vec()
}

fn file() -> FileDescriptorProto {
    let mut root = DescriptorProto::default();
    for line in LINES.lines() {
        let (head, items) = line.split_once(": ").expect("a line has a head");
        let (what, path) = head.split_once(' ').expect("a head has a kind and a name");
        let (parent, name) = path.rsplit_once('.').unwrap_or(("", path));
        let parent = parent.split('.').filter(|part| !part.is_empty()).fold(&mut root, |at, part| {
            let nested = at.nested_type.iter_mut().find(|nested| nested.name() == part);
            nested.expect("a message precedes those inside it")
        });
        let words = items.split(", ").map(|item| item.split(' ').collect::<Vec<_>>());
        match what {
            "enum" => parent.enum_type.push(enumeration(name, words)),
            _ => parent.nested_type.push(message(name, words)),
        }
    }
    FileDescriptorProto {
        name: Some("swerve/osi_groundtruth.proto".into()),
        package: Some(PACKAGE.into()),
        message_type: root.nested_type,
        syntax: Some("proto2".into()),
        ..FileDescriptorProto::default()
    }
}

fn number(word: &str) -> i32 {
    word.parse().expect("the first word is a number")
}

fn enumeration<'a>(name: &str, values: impl Iterator<Item = Vec<&'a str>>) -> EnumDescriptorProto {
    let value = |words: Vec<&str>| EnumValueDescriptorProto {
        name: Some(words[1].into()),
        number: Some(number(words[0])),
        ..EnumValueDescriptorProto::default()
    };
    EnumDescriptorProto {
        name: Some(name.into()),
        value: values.map(value).collect(),
        ..EnumDescriptorProto::default()
    }
}

fn message<'a>(name: &str, fields: impl Iterator<Item = Vec<&'a str>>) -> DescriptorProto {
    let field = |words: Vec<&str>| {
        let of = words[2].trim_end_matches('*');
        let label = if of.len() < words[2].len() { Label::Repeated } else { Label::Optional };
        let is_enum = LINES.lines().any(|line| {
            line.strip_prefix("enum ").is_some_and(|line| line.starts_with(&format!("{}:", &of[1..])))
        });
        let of_type = match of {
            "double" => Type::Double,
            "int64" => Type::Int64,
            "uint32" => Type::Uint32,
            "uint64" => Type::Uint64,
            "bool" => Type::Bool,
            _ if is_enum => Type::Enum,
            _ => Type::Message,
        };
        FieldDescriptorProto {
            name: Some(words[1].into()),
            number: Some(number(words[0])),
            label: Some(label as i32),
            r#type: Some(of_type as i32),
            type_name: of.starts_with('.').then(|| format!(".{PACKAGE}{of}")),
            ..FieldDescriptorProto::default()
        }
    };
    DescriptorProto {
        name: Some(name.into()),
        field: fields.map(field).collect(),
        ..DescriptorProto::default()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Messages of the descriptor by their full names.
    fn messages<'a>(of: &'a [DescriptorProto], at: &str, into: &mut BTreeMap<String, &'a DescriptorProto>) {
        for message in of {
            let name = format!("{at}.{}", message.name());
            messages(&message.nested_type, &name, into);
            into.insert(name, message);
        }
    }

    /// Enumerations of the descriptor by their full names.
    fn enums<'a>(of: &'a [DescriptorProto], at: &str, into: &mut BTreeMap<String, &'a EnumDescriptorProto>) {
        for message in of {
            let name = format!("{at}.{}", message.name());
            enums(&message.nested_type, &name, into);
            into.extend(message.enum_type.iter().map(|one| (format!("{name}.{}", one.name()), one)));
        }
    }

    fn varint(bytes: &mut &[u8]) -> u64 {
        prost::encoding::decode_varint(bytes).unwrap()
    }

    /// Checks every field of an encoded message against the descriptor; returns the names of the fields found.
    fn walk(mut bytes: &[u8], name: &str, file: &FileDescriptorProto, seen: &mut Vec<String>) {
        let (mut known, mut values) = (BTreeMap::new(), BTreeMap::new());
        messages(&file.message_type, ".osi3", &mut known);
        enums(&file.message_type, ".osi3", &mut values);
        while !bytes.is_empty() {
            let key = varint(&mut bytes);
            let (tag, wire) = ((key >> 3) as i32, key & 7);
            let field = known[name].field.iter().find(|field| field.number() == tag);
            let field = field.unwrap_or_else(|| panic!("{name} has no field {tag}"));
            seen.push(format!("{name}.{}", field.name()));
            match (field.r#type(), wire) {
                (Type::Double, 1) => bytes = &bytes[8..],
                (Type::Enum, 0) => {
                    let value = varint(&mut bytes) as i32;
                    let of = values[field.type_name()];
                    assert!(of.value.iter().any(|v| v.number() == value), "{name}.{}: {value}", field.name());
                }
                (Type::Int64 | Type::Uint32 | Type::Uint64 | Type::Bool, 0) => _ = varint(&mut bytes),
                (Type::Message, 2) => {
                    let length = varint(&mut bytes) as usize;
                    let (inner, rest) = bytes.split_at(length);
                    walk(inner, field.type_name(), file, seen);
                    bytes = rest;
                }
                (of_type, wire) => panic!("{name}.{}: {of_type:?} as {wire}", field.name()),
            }
        }
    }

    #[test]
    fn messages_have_exactly_the_fields_of_the_descriptor() {
        let file = file();
        let mut seen = Vec::new();
        for truth in crate::truth::tests::truths() {
            walk(&truth.encode_to_vec(), ".osi3.GroundTruth", &file, &mut seen);
        }
        let mut known = BTreeMap::new();
        messages(&file.message_type, ".osi3", &mut known);
        let fields =
            known.iter().flat_map(|(name, of)| of.field.iter().map(move |f| format!("{name}.{}", f.name())));
        for field in fields {
            assert!(seen.contains(&field), "{field} is never written");
        }
    }
}
