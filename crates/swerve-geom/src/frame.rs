//! Frames of reference as types, in three dimensions.

use core::fmt;
use core::marker::PhantomData;
use core::ops::{Add, Mul, Neg, Sub};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Map frame: x east, y north, z up, fixed to the ground.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Map;

/// Odometry frame (`odom` in ROS REP 105): the ego moves through it without jumps, and it drifts relative to the map.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Odom;

/// Ego frame: x forward, y left, z up, origin at the centre of the rear axle on the ground.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Ego;

/// Lidar frame: x forward, y left, z up, origin at the optical centre.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Lidar;

/// Camera frame: x right, y down, z forward along the optical axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Camera;

/// A position in frame `F`, metres.
#[derive(Serialize, Deserialize)]
#[serde(bound = "", transparent)]
pub struct Point<F> {
    /// Coordinates in metres.
    pub coords: Vector3<f64>,
    #[serde(skip)]
    frame: PhantomData<F>,
}

/// A displacement, velocity or other free vector expressed in frame `F`.
#[derive(Serialize, Deserialize)]
#[serde(bound = "", transparent)]
pub struct Vector<F> {
    /// Components in frame `F`.
    pub coords: Vector3<f64>,
    #[serde(skip)]
    frame: PhantomData<F>,
}

macro_rules! plain_value {
    ($name:ident) => {
        impl<F> $name<F> {
            /// Creates one from its components.
            pub fn new(x: f64, y: f64, z: f64) -> Self {
                Self { coords: Vector3::new(x, y, z), frame: PhantomData }
            }

            fn from_coords(coords: Vector3<f64>) -> Self {
                Self { coords, frame: PhantomData }
            }
        }
        impl<F> Clone for $name<F> {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<F> Copy for $name<F> {}
        impl<F> PartialEq for $name<F> {
            fn eq(&self, other: &Self) -> bool {
                self.coords == other.coords
            }
        }
        impl<F> fmt::Debug for $name<F> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "({}, {}, {})", self.coords.x, self.coords.y, self.coords.z)
            }
        }
        impl<F> Default for $name<F> {
            fn default() -> Self {
                Self::from_coords(Vector3::zeros())
            }
        }
    };
}
plain_value!(Point);
plain_value!(Vector);

impl<F> Sub for Point<F> {
    type Output = Vector<F>;
    fn sub(self, other: Self) -> Vector<F> {
        Vector::from_coords(self.coords - other.coords)
    }
}

impl<F> Add<Vector<F>> for Point<F> {
    type Output = Self;
    fn add(self, by: Vector<F>) -> Self {
        Self::from_coords(self.coords + by.coords)
    }
}

impl<F> Add for Vector<F> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::from_coords(self.coords + other.coords)
    }
}

impl<F> Sub for Vector<F> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::from_coords(self.coords - other.coords)
    }
}

impl<F> Neg for Vector<F> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::from_coords(-self.coords)
    }
}

impl<F> Mul<f64> for Vector<F> {
    type Output = Self;
    fn mul(self, by: f64) -> Self {
        Self::from_coords(self.coords * by)
    }
}

impl<F> Vector<F> {
    /// Euclidean length.
    pub fn norm(self) -> f64 {
        self.coords.norm()
    }

    /// Scalar product.
    pub fn dot(self, other: Self) -> f64 {
        self.coords.dot(&other.coords)
    }
}

/// Transforms coordinates in `From` to coordinates in `To`; read `to_from`.
///
/// ```compile_fail
/// use swerve_geom::{Ego, Lidar, Map, Transform};
/// fn wrong(map_from_ego: Transform<Map, Ego>, map_from_lidar: Transform<Map, Lidar>) {
///     let _ = map_from_ego * map_from_lidar; // expected `Transform<Ego, _>`, found `Transform<Map, Lidar>`
/// }
/// ```
#[derive(Serialize, Deserialize)]
#[serde(bound = "", transparent)]
pub struct Transform<To, From> {
    isometry: Isometry3<f64>,
    #[serde(skip)]
    frames: PhantomData<(To, From)>,
}

impl<To, From> Clone for Transform<To, From> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<To, From> Copy for Transform<To, From> {}
impl<To, From> PartialEq for Transform<To, From> {
    fn eq(&self, other: &Self) -> bool {
        self.isometry == other.isometry
    }
}
impl<To, From> fmt::Debug for Transform<To, From> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.isometry.fmt(f)
    }
}

impl<To, From> Transform<To, From> {
    /// Creates a transform from the origin of `From` in `To` and its orientation.
    pub fn new(origin: Point<To>, rotation: UnitQuaternion<f64>) -> Self {
        let isometry = Isometry3::from_parts(Translation3::from(origin.coords), rotation);
        Self { isometry, frames: PhantomData }
    }

    /// Creates a transform from the origin of `From` in `To` and roll, pitch, yaw (z-y-x order, radians).
    pub fn from_roll_pitch_yaw(origin: Point<To>, roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> Self {
        let half = |angle: f64| crate::math::sin_cos(0.5 * angle);
        let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll_rad), half(pitch_rad), half(yaw_rad));
        let quaternion = nalgebra::Quaternion::new(
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        );
        Self::new(origin, UnitQuaternion::new_normalize(quaternion))
    }

    /// Origin of `From` in `To`.
    pub fn origin(&self) -> Point<To> {
        Point::from_coords(self.isometry.translation.vector)
    }

    /// Orientation of `From` in `To`.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        self.isometry.rotation
    }

    /// The isometry without its frames.
    pub fn isometry(&self) -> Isometry3<f64> {
        self.isometry
    }

    /// The inverse transform.
    pub fn inverse(&self) -> Transform<From, To> {
        Transform { isometry: self.isometry.inverse(), frames: PhantomData }
    }

    /// Roll, pitch and yaw of `From` in `To` (z-y-x order, radians).
    pub fn roll_pitch_yaw(&self) -> (f64, f64, f64) {
        let q = self.isometry.rotation.quaternion();
        let (w, x, y, z) = (q.w, q.i, q.j, q.k);
        let roll = crate::math::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
        let pitch = crate::math::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0));
        let yaw = crate::math::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
        (roll, pitch, yaw)
    }
}

impl<A, B, C> Mul<Transform<B, C>> for Transform<A, B> {
    type Output = Transform<A, C>;
    fn mul(self, b_from_c: Transform<B, C>) -> Transform<A, C> {
        Transform { isometry: self.isometry * b_from_c.isometry, frames: PhantomData }
    }
}

impl<To, From> Mul<Point<From>> for Transform<To, From> {
    type Output = Point<To>;
    fn mul(self, point: Point<From>) -> Point<To> {
        Point::from_coords((self.isometry * nalgebra::Point3::from(point.coords)).coords)
    }
}

impl<To, From> Mul<Vector<From>> for Transform<To, From> {
    type Output = Vector<To>;
    fn mul(self, vector: Vector<From>) -> Vector<To> {
        Vector::from_coords(self.isometry.rotation * vector.coords)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn inverse_transform_and_euler_angles_round_trip(x in -50.0..50.0, y in -50.0..50.0, roll in -1.0..1.0, pitch in -1.0..1.0, yaw in -3.0..3.0) {
            let map_from_ego: Transform<Map, Ego> =
                Transform::from_roll_pitch_yaw(Point::new(x, y, 0.3), roll, pitch, yaw);
            let p = Point::<Ego>::new(1.0, -2.0, 0.5);
            let back = map_from_ego.inverse() * (map_from_ego * p);
            prop_assert!((back - p).norm() < 1e-9);
            let (r, p, w) = map_from_ego.roll_pitch_yaw();
            prop_assert!((r - roll).abs() < 1e-9 && (p - pitch).abs() < 1e-9 && (w - yaw).abs() < 1e-9);
        }
    }

    #[test]
    fn transform_chain_applies_from_right_to_left() {
        let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(
            Point::new(10.0, 0.0, 0.0),
            0.0,
            0.0,
            core::f64::consts::FRAC_PI_2,
        );
        let ego_from_lidar: Transform<Ego, Lidar> =
            Transform::from_roll_pitch_yaw(Point::new(1.5, 0.0, 1.9), 0.0, 0.0, 0.0);
        let p = map_from_ego * ego_from_lidar * Point::<Lidar>::new(1.0, 0.0, 0.0);
        assert!((p - Point::new(10.0, 2.5, 1.9)).norm() < 1e-12);
    }
}
