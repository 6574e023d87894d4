//! Facts of a message in CBOR that hold for every type: its stamp, and a number that is not finite.

use swerve_core::Time;

/// Facts of a message.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Facts {
    /// Field `stamp` of the message.
    pub(super) stamp: Option<Time>,
    /// First field with a number that is not finite, such as `obstacles[2].pose.x_m`, and the number.
    pub(super) not_finite: Option<(String, f64)>,
}

/// Nesting of a message at most; a deeper one has no known type.
const DEPTH_MAX: usize = 64;

/// Reads the facts of a message. The numbers of images and point clouds are bytes, which are not examined. `None` if
/// the bytes are not one CBOR value of the kind that messages are.
pub(super) fn facts(message: &[u8]) -> Option<Facts> {
    let mut scan = Scan { rest: message, path: Vec::new(), found: Facts::default() };
    scan.value()?;
    scan.rest.is_empty().then_some(scan.found)
}

/// Step from a value to one inside of it.
enum Step<'a> {
    Key(&'a str),
    Index(u64),
    /// A key that is not text.
    Other,
}

struct Scan<'a> {
    rest: &'a [u8],
    path: Vec<Step<'a>>,
    found: Facts,
}

/// Major types of RFC 8949.
mod major {
    pub(super) const POSITIVE: u8 = 0;
    pub(super) const NEGATIVE: u8 = 1;
    pub(super) const BYTES: u8 = 2;
    pub(super) const TEXT: u8 = 3;
    pub(super) const ARRAY: u8 = 4;
    pub(super) const MAP: u8 = 5;
    pub(super) const TAG: u8 = 6;
}

impl<'a> Scan<'a> {
    fn take(&mut self, count: u64) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(usize::try_from(count).ok()?)?;
        self.rest = rest;
        Some(taken)
    }

    /// Major type, additional information and argument of the next item; items of unknown length are not written.
    fn head(&mut self) -> Option<(u8, u8, u64)> {
        let [first] = *self.take(1)? else { return None };
        let (major, info) = (first >> 5, first & 31);
        let argument = match info {
            0..=23 => u64::from(info),
            24..=27 => self.take(1 << (info - 24))?.iter().fold(0, |sum, byte| (sum << 8) | u64::from(*byte)),
            _ => return None,
        };
        Some((major, info, argument))
    }

    fn value(&mut self) -> Option<()> {
        if self.path.len() > DEPTH_MAX {
            return None;
        }
        let (major, info, argument) = self.head()?;
        match major {
            major::POSITIVE | major::NEGATIVE => self.integer(major, argument),
            major::BYTES | major::TEXT => self.take(argument).map(drop),
            major::ARRAY => (0..argument).try_for_each(|index| self.inside(Step::Index(index))),
            major::MAP => (0..argument).try_for_each(|_| {
                let key = self.key()?;
                self.inside(key)
            }),
            major::TAG => self.inside(Step::Other),
            _ => {
                self.simple(info, argument);
                Some(())
            }
        }
    }

    fn inside(&mut self, step: Step<'a>) -> Option<()> {
        self.path.push(step);
        self.value()?;
        self.path.pop();
        Some(())
    }

    fn key(&mut self) -> Option<Step<'a>> {
        let (major, _, argument) = self.head()?;
        match major {
            major::TEXT => core::str::from_utf8(self.take(argument)?).ok().map(Step::Key),
            major::BYTES => self.take(argument).map(|_| Step::Other),
            major::POSITIVE | major::NEGATIVE => Some(Step::Other),
            _ => None,
        }
    }

    fn integer(&mut self, major: u8, argument: u64) -> Option<()> {
        if let [Step::Key("stamp")] = self.path[..] {
            let ns = i64::try_from(argument).ok()?;
            self.found.stamp = Some(Time::from_ns(if major == major::NEGATIVE { -1 - ns } else { ns }));
        }
        Some(())
    }

    fn simple(&mut self, info: u8, argument: u64) {
        let number = match info {
            25 => half(argument),
            26 => u32::try_from(argument).map_or(0.0, |bits| f64::from(f32::from_bits(bits))),
            27 => f64::from_bits(argument),
            _ => return,
        };
        if !number.is_finite() && self.found.not_finite.is_none() {
            self.found.not_finite = Some((self.name(), number));
        }
    }

    fn name(&self) -> String {
        let mut name = String::new();
        for step in &self.path {
            match step {
                Step::Key(key) if name.is_empty() => name += key,
                Step::Key(key) => name += &format!(".{key}"),
                Step::Index(index) => name += &format!("[{index}]"),
                Step::Other => name += "[..]",
            }
        }
        name
    }
}

/// A number of 16 bits: zero if it is finite, which is all that is of interest.
fn half(bits: u64) -> f64 {
    match bits & 0x7fff {
        0x7c00 if bits & 0x8000 == 0 => f64::INFINITY,
        0x7c00 => f64::NEG_INFINITY,
        0x7c01.. => f64::NAN,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use swerve_geom::Pose2;
    use swerve_msg::{ActorId, ActorKind, EgoState, Extent, Obstacle, ObstacleList};

    use super::*;

    fn of<T: serde::Serialize>(message: &T) -> Facts {
        let mut bytes = Vec::new();
        swerve_flow::cbor::write(message, &mut bytes);
        facts(&bytes).unwrap()
    }

    fn obstacle(x_m: f64) -> Obstacle {
        let (id, kind, extent) = (ActorId(1), ActorKind::Car, Extent::default());
        let (pose, velocity_mps) = (Pose2::new(x_m, 0.0, 0.0), swerve_geom::Vector2::new(0.0, 0.0));
        Obstacle { id, kind, pose, extent, velocity_mps, visible_share: 1.0 }
    }

    #[test]
    fn facts_have_the_stamp_and_the_first_number_that_is_not_finite() {
        let stamp = Time::from_ns(-7);
        let ego = EgoState { stamp, speed_mps: 3.25, ..EgoState::default() };
        assert_eq!(of(&ego), Facts { stamp: Some(stamp), not_finite: None });
        for (number, name) in [(f64::INFINITY, "inf"), (f64::NEG_INFINITY, "-inf")] {
            let (key, found) = of(&EgoState { accel_mps2: number, ..ego }).not_finite.unwrap();
            assert_eq!((key.as_str(), found.to_string().as_str()), ("accel_mps2", name));
        }
        let list = ObstacleList { stamp, obstacles: vec![obstacle(1.0), obstacle(f64::NAN)] };
        let (key, found) = of(&list).not_finite.unwrap();
        assert_eq!(key, "obstacles[1].pose.x_m");
        assert!(found.is_nan());
    }

    #[test]
    fn bytes_that_are_no_message_have_no_facts() {
        for bytes in [&[][..], &[0x81], &[0xbf, 0xff], &[0x01, 0x01], &[0x1c], &[0x5a, 255, 255, 255, 255]] {
            assert_eq!(facts(bytes), None, "{bytes:?}");
        }
        assert_eq!(facts(&[0x81; 1000]), None, "nested too deep");
        assert_eq!(facts(&[0x9b, 255, 255, 255, 255, 255, 255, 255, 255]), None, "a length without items");
    }
}
