//! Messages that faults can affect, and their numbers.

use swerve_core::{Rng, Time};
use swerve_flow::Payload;
use swerve_geom::{Pose2, Vector2};
use swerve_msg::{
    Command, Detections, EgoState, Gnss, Image, Imu, MotionCommand, ObstacleList, Packed, Pixels, Plan,
    PointCloud, PredictionList, RadarScan, TrackList, VehicleReport, WheelOdometry,
};

use crate::config::injection::{Carries, Corruption};

/// A message that a fault can affect.
pub trait Corruptible: Payload + Clone {
    /// Changes the stamp to `stamp`.
    fn restamp(&mut self, stamp: Time);
    /// Changes its numbers.
    fn corrupt(&mut self, how: Corruption, rng: &mut Rng);
    /// Contents of a stream published on this output.
    fn carries(_output: &str) -> Carries {
        Carries::Numbers
    }
}

/// A number of a message, and its unit of noise: a metre, a metre per second, a degree, a hundredth.
type Number<'a> = (&'a mut f64, f64);

const DEGREE: f64 = core::f64::consts::PI / 180.0;
const HUNDREDTH: f64 = 0.01;

fn corrupt(mut numbers: Vec<Number<'_>>, how: Corruption, rng: &mut Rng) {
    match how {
        Corruption::Noise(sigma) => {
            numbers.iter_mut().for_each(|(x, unit)| **x += sigma * *unit * rng.normal());
        }
        Corruption::Nan if !numbers.is_empty() => {
            let which = rng.below(numbers.len());
            *numbers[which].0 = f64::NAN;
        }
        // Flipped bits are configurable for images and point clouds only.
        Corruption::Nan | Corruption::FlipBits(_) => {}
    }
}

fn pose<F>(pose: &mut Pose2<F>) -> [Number<'_>; 3] {
    [(&mut pose.x_m, 1.0), (&mut pose.y_m, 1.0), (&mut pose.heading_rad, DEGREE)]
}

fn vector(v: &mut Vector2) -> [Number<'_>; 2] {
    [(&mut v.x, 1.0), (&mut v.y, 1.0)]
}

macro_rules! corruptible {
    ($($type:ty: $restamp:expr, $numbers:expr;)*) => {$(
        impl Corruptible for $type {
            fn restamp(&mut self, stamp: Time) {
                let restamp: fn(&mut $type, Time) = $restamp;
                restamp(self, stamp);
            }

            fn corrupt(&mut self, how: Corruption, rng: &mut Rng) {
                let numbers: fn(&mut $type) -> Vec<Number<'_>> = $numbers;
                corrupt(numbers(self), how, rng);
            }
        }
    )*};
}

corruptible! {
    ObstacleList: |m, stamp| m.stamp = stamp, |m| {
        m.obstacles.iter_mut().flat_map(|o| pose(&mut o.pose).into_iter().chain(vector(&mut o.velocity_mps))).collect()
    };
    Detections: |m, stamp| m.stamp = stamp, |m| {
        m.boxes.iter_mut().flat_map(|b| pose(&mut b.pose)).collect()
    };
    TrackList: |m, stamp| m.stamp = stamp, |m| {
        m.tracks.iter_mut().flat_map(|t| pose(&mut t.pose).into_iter().chain(vector(&mut t.velocity_mps))).collect()
    };
    PredictionList: |m, stamp| m.stamp = stamp, |m| {
        m.predictions.iter_mut().flat_map(|p| p.path.iter_mut()).flat_map(|at| pose(&mut at.pose)).collect()
    };
    Plan: |m, stamp| m.stamp = stamp, |m| {
        let points = m.points.iter_mut();
        points
            .flat_map(|p| {
                pose(&mut p.pose).into_iter().chain([(&mut p.speed_mps, 1.0), (&mut p.accel_mps2, 1.0)])
            })
            .collect()
    };
    EgoState: |m, stamp| m.stamp = stamp, |m| {
        let own = [
            (&mut m.speed_mps, 1.0),
            (&mut m.accel_mps2, 1.0),
            (&mut m.yaw_rate_radps, DEGREE),
            (&mut m.steering_rad, DEGREE),
        ];
        pose(&mut m.pose).into_iter().chain(own).collect()
    };
    Imu: |m, stamp| m.stamp = stamp, |m| {
        let accel = m.accel_mps2.iter_mut().map(|x| (x, 1.0));
        accel.chain(m.gyro_radps.iter_mut().map(|x| (x, DEGREE))).collect()
    };
    // A metre on the ground in degrees of latitude.
    Gnss: |m, stamp| m.stamp = stamp, |m| {
        const METRE_DEG: f64 = 1.0 / 111_320.0;
        vec![(&mut m.latitude_deg, METRE_DEG), (&mut m.longitude_deg, METRE_DEG), (&mut m.altitude_m, 1.0)]
    };
    WheelOdometry: |m, stamp| m.stamp = stamp, |m| {
        vec![(&mut m.speed_mps, 1.0), (&mut m.yaw_rate_radps, DEGREE), (&mut m.steering_rad, DEGREE)]
    };
    RadarScan: |m, stamp| m.stamp = stamp, |m| {
        let echoes = m.detections.iter_mut();
        echoes
            .flat_map(|d| {
                [(&mut d.range_m, 1.0), (&mut d.range_rate_mps, 1.0), (&mut d.azimuth_rad, DEGREE)]
            })
            .collect()
    };
    MotionCommand: |m, stamp| m.stamp = stamp, |m| {
        vec![(&mut m.steering_rad, DEGREE), (&mut m.speed_mps, 1.0), (&mut m.accel_mps2, 1.0)]
    };
    VehicleReport: |m, stamp| m.stamp = stamp, |m| {
        vec![(&mut m.speed_mps, 1.0), (&mut m.steering_rad, DEGREE)]
    };
    Command: |_, _| {}, |m| {
        vec![(&mut m.steering_rad, DEGREE), (&mut m.throttle, HUNDREDTH), (&mut m.brake, HUNDREDTH)]
    };
}

impl Corruptible for Image {
    fn carries(output: &str) -> Carries {
        if output == "depth" { Carries::Floats } else { Carries::Levels }
    }

    fn restamp(&mut self, stamp: Time) {
        self.stamp = stamp;
    }

    fn corrupt(&mut self, how: Corruption, rng: &mut Rng) {
        match &mut self.pixels {
            Pixels::Rgb8(levels) => corrupt_levels(levels, how, rng),
            // No noise on classes and identities: a neighbouring value means something else.
            Pixels::ClassU8(ids) => {
                flip_ids(how, |bits| flip(ids, bits, rng, |id, bit| *id ^= 1 << (bit & 7)))
            }
            Pixels::InstanceU32(ids) => flip_ids(how, |bits| flip(ids, bits, rng, |id, bit| *id ^= 1 << bit)),
            Pixels::DepthF32M(metres) => corrupt_floats(metres, how, rng),
        }
    }
}

impl Corruptible for PointCloud {
    fn carries(_output: &str) -> Carries {
        Carries::Floats
    }

    fn restamp(&mut self, stamp: Time) {
        self.stamp = stamp;
    }

    fn corrupt(&mut self, how: Corruption, rng: &mut Rng) {
        let axes = [&mut self.x_m, &mut self.y_m, &mut self.z_m];
        match how {
            Corruption::Noise(_) => axes.into_iter().for_each(|axis| corrupt_floats(axis, how, rng)),
            Corruption::Nan | Corruption::FlipBits(_) => {
                let axis: &mut Packed<f32> = axes.into_iter().nth(rng.below(3)).expect("there are three");
                corrupt_floats(axis, how, rng);
            }
        }
    }
}

fn flip_ids(how: Corruption, flip: impl FnOnce(u32)) {
    if let Corruption::FlipBits(bits) = how {
        flip(bits);
    }
}

fn corrupt_levels(levels: &mut [u8], how: Corruption, rng: &mut Rng) {
    match how {
        Corruption::Noise(sigma) => {
            for level in levels {
                *level = (f64::from(*level) + sigma * rng.normal()).round() as u8;
            }
        }
        Corruption::Nan => {}
        Corruption::FlipBits(bits) => flip(levels, bits, rng, |level, bit| *level ^= 1 << (bit & 7)),
    }
}

fn corrupt_floats(numbers: &mut [f32], how: Corruption, rng: &mut Rng) {
    match how {
        Corruption::Noise(sigma) => numbers.iter_mut().for_each(|x| *x += (sigma * rng.normal()) as f32),
        Corruption::Nan if !numbers.is_empty() => {
            let which = rng.below(numbers.len());
            numbers[which] = f32::NAN;
        }
        Corruption::Nan => {}
        Corruption::FlipBits(bits) => {
            flip(numbers, bits, rng, |x, bit| *x = f32::from_bits(x.to_bits() ^ 1 << bit));
        }
    }
}

/// Flips `bits` random bits: `change` flips one of up to 32 bits of a number.
fn flip<T>(numbers: &mut [T], bits: u32, rng: &mut Rng, change: impl Fn(&mut T, usize)) {
    if numbers.is_empty() {
        return;
    }
    for _ in 0..bits {
        let (which, bit) = (rng.below(numbers.len()), rng.below(32));
        change(&mut numbers[which], bit);
    }
}
