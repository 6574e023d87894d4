//! Time series to plot, as the custom message `swerve.Figures`.

use foxglove::{Encode, Schema};
use prost::Message;
use prost::bytes::BufMut;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

/// Metrics of a drive over time; NaN if unavailable.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Figures {
    /// Speed of the ego origin along its heading, m/s.
    #[prost(double, tag = "1")]
    pub speed_mps: f64,
    /// Present speed according to the plan, m/s.
    #[prost(double, tag = "2")]
    pub planned_speed_mps: f64,
    /// Acceleration along the heading, m/s².
    #[prost(double, tag = "3")]
    pub accel_mps2: f64,
    /// Lateral acceleration, m/s²; positive to the left.
    #[prost(double, tag = "4")]
    pub lateral_accel_mps2: f64,
    /// Angle of the front road wheels, degrees; positive to the left.
    #[prost(double, tag = "5")]
    pub steering_deg: f64,
    /// Accelerator pedal, 0 to 1.
    #[prost(double, tag = "6")]
    pub throttle: f64,
    /// Brake pedal, 0 to 1.
    #[prost(double, tag = "7")]
    pub brake: f64,
    /// Distance between the outlines of the ego and the nearest other actor, metres.
    #[prost(double, tag = "8")]
    pub distance_m: f64,
    /// Time until the outlines of the ego and another actor meet at constant velocities, seconds.
    #[prost(double, tag = "9")]
    pub time_to_collision_s: f64,
    /// Time from the sensor frame behind the present command to the command's effect, milliseconds.
    #[prost(double, tag = "10")]
    pub response_ms: f64,
    /// Age of the newest plan's stamp, milliseconds.
    #[prost(double, tag = "11")]
    pub plan_age_ms: f64,
}

/// Fields in the order of their tags, from 1; all are doubles.
const FIELDS: [&str; 11] = [
    "speed_mps",
    "planned_speed_mps",
    "accel_mps2",
    "lateral_accel_mps2",
    "steering_deg",
    "throttle",
    "brake",
    "distance_m",
    "time_to_collision_s",
    "response_ms",
    "plan_age_ms",
];

impl Encode for Figures {
    type Error = prost::EncodeError;

    fn get_schema() -> Option<Schema> {
        let field = |(k, name): (usize, &&str)| FieldDescriptorProto {
            name: Some((*name).to_owned()),
            number: Some(k as i32 + 1),
            label: Some(Label::Optional as i32),
            r#type: Some(Type::Double as i32),
            ..FieldDescriptorProto::default()
        };
        let message = DescriptorProto {
            name: Some("Figures".into()),
            field: FIELDS.iter().enumerate().map(field).collect(),
            ..DescriptorProto::default()
        };
        let file = FileDescriptorProto {
            name: Some("swerve/Figures.proto".into()),
            package: Some("swerve".into()),
            message_type: vec![message],
            syntax: Some("proto3".into()),
            ..FileDescriptorProto::default()
        };
        let set = FileDescriptorSet { file: vec![file] };
        Some(Schema::new("swerve.Figures", "protobuf", set.encode_to_vec()))
    }

    fn get_message_encoding() -> String {
        "protobuf".into()
    }

    fn encode(&self, buffer: &mut impl BufMut) -> Result<(), prost::EncodeError> {
        Message::encode(self, buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_schema_matches_the_message() {
        let schema = Figures::get_schema().unwrap();
        let set = FileDescriptorSet::decode(&*schema.data).unwrap();
        let fields = &set.file[0].message_type[0].field;
        // A message with one field set contains only the tag of that field.
        for (field, k) in fields.iter().zip(1_i32..) {
            assert_eq!((field.number(), field.name()), (k, FIELDS[k as usize - 1]));
        }
        let shown = format!("{:?}", Figures::default());
        let mut rest = shown.as_str();
        for name in FIELDS {
            let (_, after) = rest.split_once(&format!("{name}: ")).unwrap();
            rest = after;
        }
        let all = Figures::decode(&*fields.iter().fold(Vec::new(), |mut bytes, field| {
            bytes.push((field.number() << 3 | 1) as u8);
            bytes.extend(f64::from(field.number()).to_le_bytes());
            bytes
        }));
        assert_eq!(all.map(|f| (f.speed_mps, f.plan_age_ms)), Ok((1.0, 11.0)));
    }
}
