//! Points, vectors and poses in the ground plane of a frame.

use core::fmt;
use core::marker::PhantomData;
use core::ops::{Add, Mul, Neg, Sub};

use serde::{Deserialize, Serialize};

use crate::{Map, math, wrap_angle};

/// A place in the ground plane of frame `F`, in metres.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Point2<F = Map> {
    /// Along the frame's x axis, metres.
    pub x_m: f64,
    /// Along the frame's y axis, metres.
    pub y_m: f64,
    #[serde(skip)]
    frame: PhantomData<F>,
}

/// A displacement or velocity in the ground plane of frame `F`.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Vector2<F = Map> {
    /// Component along the frame's x axis.
    pub x: f64,
    /// Component along the frame's y axis.
    pub y: f64,
    #[serde(skip)]
    frame: PhantomData<F>,
}

/// A position and heading in the ground plane of frame `F`.
#[derive(Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Pose2<F = Map> {
    /// Position along the frame's x axis, metres.
    pub x_m: f64,
    /// Position along the frame's y axis, metres.
    pub y_m: f64,
    /// Heading from the frame's x axis towards its y axis, radians, in `(-pi, pi]`.
    pub heading_rad: f64,
    #[serde(skip)]
    frame: PhantomData<F>,
}

macro_rules! copies {
    ($name:ident, $($field:ident),+) => {
        impl<F> Clone for $name<F> {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<F> Copy for $name<F> {}
        impl<F> PartialEq for $name<F> {
            fn eq(&self, other: &Self) -> bool {
                true $(&& self.$field == other.$field)+
            }
        }
        impl<F> Default for $name<F> {
            fn default() -> Self {
                Self { $($field: 0.0,)+ frame: PhantomData }
            }
        }
        impl<F> fmt::Debug for $name<F> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.debug_tuple(stringify!($name))$(.field(&self.$field))+.finish()
            }
        }
    };
}
copies!(Point2, x_m, y_m);
copies!(Vector2, x, y);
copies!(Pose2, x_m, y_m, heading_rad);

impl<F> Point2<F> {
    /// Creates a point from coordinates in metres.
    pub const fn new(x_m: f64, y_m: f64) -> Self {
        Self { x_m, y_m, frame: PhantomData }
    }

    /// Distance to `other`, metres.
    pub fn distance(self, other: Self) -> f64 {
        (self - other).norm()
    }

    /// Returns true if both coordinates are finite.
    pub fn is_finite(self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite()
    }
}

impl<F> Vector2<F> {
    /// Creates a vector from its components.
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y, frame: PhantomData }
    }

    /// Unit vector at `heading_rad`.
    pub fn from_heading(heading_rad: f64) -> Self {
        let (sin, cos) = math::sin_cos(heading_rad);
        Self::new(cos, sin)
    }

    /// Euclidean length.
    pub fn norm(self) -> f64 {
        self.norm_squared().sqrt()
    }

    /// Squared length.
    pub fn norm_squared(self) -> f64 {
        self.x * self.x + self.y * self.y
    }

    /// Scalar product.
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// z component of the cross product: positive if `other` is to the left.
    pub fn cross(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// The vector rotated a quarter turn to the left.
    #[must_use]
    pub fn left(self) -> Self {
        Self::new(-self.y, self.x)
    }

    /// Direction in `(-pi, pi]`; zero for the zero vector.
    pub fn heading(self) -> f64 {
        math::atan2(self.y, self.x)
    }
}

impl<F> Pose2<F> {
    /// Creates a pose from a position in metres and a heading in radians, which is wrapped.
    pub fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Self {
        Self { x_m, y_m, heading_rad: wrap_angle(heading_rad), frame: PhantomData }
    }

    /// Position.
    pub const fn point(self) -> Point2<F> {
        Point2::new(self.x_m, self.y_m)
    }

    /// Unit vector of the heading.
    pub fn direction(self) -> Vector2<F> {
        Vector2::from_heading(self.heading_rad)
    }

    /// Transforms a point from the local frame at this pose (x ahead, y left) to `F`.
    pub fn from_local<L>(self, local: Point2<L>) -> Point2<F> {
        let (sin, cos) = math::sin_cos(self.heading_rad);
        Point2::new(
            self.x_m + cos * local.x_m - sin * local.y_m,
            self.y_m + sin * local.x_m + cos * local.y_m,
        )
    }

    /// Transforms a point of `F` to the local frame at this pose (x ahead, y left).
    pub fn to_local<L>(self, point: Point2<F>) -> Point2<L> {
        let (sin, cos) = math::sin_cos(self.heading_rad);
        let (dx, dy) = (point.x_m - self.x_m, point.y_m - self.y_m);
        Point2::new(cos * dx + sin * dy, -sin * dx + cos * dy)
    }

    /// The pose `ahead_m` further along the heading.
    #[must_use]
    pub fn ahead(self, ahead_m: f64) -> Self {
        let point = self.point() + self.direction() * ahead_m;
        Self { x_m: point.x_m, y_m: point.y_m, ..self }
    }

    /// Returns true if all three numbers are finite.
    pub fn is_finite(self) -> bool {
        self.point().is_finite() && self.heading_rad.is_finite()
    }
}

impl<F> Sub for Point2<F> {
    type Output = Vector2<F>;
    fn sub(self, other: Self) -> Vector2<F> {
        Vector2::new(self.x_m - other.x_m, self.y_m - other.y_m)
    }
}

impl<F> Add<Vector2<F>> for Point2<F> {
    type Output = Self;
    fn add(self, by: Vector2<F>) -> Self {
        Self::new(self.x_m + by.x, self.y_m + by.y)
    }
}

impl<F> Sub<Vector2<F>> for Point2<F> {
    type Output = Self;
    fn sub(self, by: Vector2<F>) -> Self {
        self + -by
    }
}

impl<F> Add for Vector2<F> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y)
    }
}

impl<F> Sub for Vector2<F> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y)
    }
}

impl<F> Neg for Vector2<F> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y)
    }
}

impl<F> Mul<f64> for Vector2<F> {
    type Output = Self;
    fn mul(self, by: f64) -> Self {
        Self::new(self.x * by, self.y * by)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ego;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn local_coordinates_round_trip(x in -99.0..99.0, y in -99.0..99.0, h in -9.0..9.0, px in -99.0..99.0, py in -99.0..99.0) {
            let pose = Pose2::<Map>::new(x, y, h);
            let p = Point2::<Map>::new(px, py);
            let local: Point2<Ego> = pose.to_local(p);
            prop_assert!(pose.from_local(local).distance(p) < 1e-9);
        }
    }

    #[test]
    fn left_is_positive_in_local_frames_and_cross_products() {
        let pose = Pose2::<Map>::new(1.0, 1.0, 0.0);
        let local: Point2<Ego> = pose.to_local(Point2::new(3.0, 2.5));
        assert_eq!((local.x_m, local.y_m), (2.0, 1.5));
        assert!(Vector2::<Map>::new(1.0, 0.0).cross(Vector2::new(0.0, 1.0)) > 0.0);
    }
}
