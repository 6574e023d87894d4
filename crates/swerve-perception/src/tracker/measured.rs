//! Boxes as measurements of the tracker.

use core::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix2, Vector2 as Column2};
use swerve_geom::{Ego, Map, Pose2, math};
use swerve_msg::{DetectedBox, Extent};

use super::{Group, Params};

/// Standard deviation of the velocity of a vehicle across the axis of its first box, m/s: it changes lanes, or the box
/// is askew.
const ACROSS_MPS: f64 = 3.0;
/// Sum of the variances of the position of a sure box, m². A camera alone is not sure, and supposes the heading.
const SURE_M2: f64 = 0.5;
/// Standard deviation of a velocity component of people, m/s.
const WALKS_MPS: f64 = 2.0;
/// Square of the standard deviations by which a radial speed may contradict the axis of a box.
const AXIS_DOUBT: f64 = 4.0;

/// Box in the map frame with its covariance.
#[derive(Clone, Copy)]
pub(super) struct Measured<'a> {
    pub(super) found: &'a DetectedBox,
    pub(super) at: Column2<f64>,
    pub(super) covariance: Matrix2<f64>,
    pub(super) heading_rad: f64,
    pub(super) extent: Extent,
    /// True if its length and width are exchanged.
    pub(super) is_turned: bool,
    /// Unit vector from the ego to it.
    pub(super) sight: Column2<f64>,
    pub(super) ego: Column2<f64>,
}

/// Covariance with these standard deviations along a unit vector and across it.
fn spread(along: Column2<f64>, deviations: [f64; 2]) -> Matrix2<f64> {
    let turn = Matrix2::new(along.x, -along.y, along.y, along.x);
    turn * Matrix2::from_diagonal(&Column2::from(deviations.map(|d| d * d))) * turn.transpose()
}

impl<'a> Measured<'a> {
    pub(super) fn of(found: &'a DetectedBox, ego: Pose2<Map>, params: &Params) -> Self {
        let (x, y) = (found.pose.x_m, found.pose.y_m);
        let range_m = math::hypot(x, y);
        let along_m = params.range_noise_m + params.range_noise_share * range_m;
        let across_m = params.bearing_noise_rad * range_m;
        let (sin, cos) = math::sin_cos(math::atan2(y, x) + ego.heading_rad);
        let floor = Matrix2::identity() * (params.floor_noise_m * params.floor_noise_m);
        let modelled = spread(Column2::new(cos, sin), [along_m, across_m]) + floor;
        // A box covariance, if given, replaces the model; it excludes the errors of the ego pose.
        let own = found.covariance_m2.map(|[xx, xy, yy]| {
            let (sin, cos) = math::sin_cos(ego.heading_rad);
            let turn = Matrix2::new(cos, -sin, sin, cos);
            turn * Matrix2::new(xx, xy, xy, yy) * turn.transpose() + floor
        });
        let at = ego.from_local::<Ego>(found.pose.point());
        Self {
            found,
            at: Column2::new(at.x_m, at.y_m),
            covariance: own.unwrap_or(modelled),
            heading_rad: found.pose.heading_rad + ego.heading_rad,
            extent: found.extent,
            is_turned: false,
            sight: Column2::new(cos, sin),
            ego: Column2::new(ego.x_m, ego.y_m),
        }
    }

    /// Shift of the centre of a vehicle when its size changes while its faces towards the ego stay: detectors measure
    /// these, and suppose the rest by class. Zero for other objects, for boxes without a covariance, whose centre has the
    /// error, and for unsure boxes that were turned, whose faces are supposed too.
    pub(super) fn shift(&self, from: Extent, to: Extent) -> Column2<f64> {
        let has_faces = self.found.covariance_m2.is_some() && (self.is_sure() || !self.is_turned);
        if Group::of(self.found.kind) != Group::Vehicle || !has_faces {
            return Column2::zeros();
        }
        let (sin, cos) = math::sin_cos(self.heading_rad);
        let ego = self.ego - self.at;
        let side = |axis: Column2<f64>, from_m: f64, to_m: f64| {
            let along_m = ego.dot(&axis);
            let is_in_view = along_m.abs() > 0.5 * from_m.max(to_m);
            axis * if is_in_view { along_m.signum() * 0.5 * (from_m - to_m) } else { 0.0 }
        };
        side(Column2::new(cos, sin), from.length_m, to.length_m)
            + side(Column2::new(-sin, cos), from.width_m, to.width_m)
    }

    /// True if its position, hence its near faces, are measured and not supposed.
    fn is_sure(&self) -> bool {
        self.found.covariance_m2.map_or(self.covariance.trace(), |[xx, _, yy]| xx + yy) < SURE_M2
    }

    /// Covariance of the velocity of an object seen for the first time. Vehicles have this standard deviation along their
    /// axis, and move little across it, unless a radial speed shows that the axis is wrong. People have it in all
    /// directions; along the sight they walk if their distance is not sure: two distances that differ by their errors
    /// make no sprint.
    pub(super) fn velocity_m2ps2(&self, speed_mps: f64) -> Matrix2<f64> {
        let round = Matrix2::identity() * (speed_mps * speed_mps);
        let (sin, cos) = math::sin_cos(self.heading_rad);
        match Group::of(self.found.kind) {
            Group::Vehicle => {
                let along = spread(Column2::new(cos, sin), [speed_mps, speed_mps.min(ACROSS_MPS)]);
                let variance = (self.sight.transpose() * along * self.sight)[0];
                let doubt = |radial_mps: f64| radial_mps * radial_mps * (1.0 / variance - 1.0 / round.m11);
                let is_wrong = self.found.radial_speed_mps.is_some_and(|mps| doubt(mps) > AXIS_DOUBT);
                if is_wrong { round } else { along }
            }
            Group::Person if !self.is_sure() => spread(self.sight, [speed_mps.min(WALKS_MPS), speed_mps]),
            Group::Person | Group::Fixed => round,
        }
    }

    /// The same ground with length and width exchanged. The detector added a part of the length to the seen side, so the
    /// centre is uncertain by half the difference of the sides; the error of an unsure box includes this.
    pub(super) fn turned(self) -> Self {
        let Extent { length_m, width_m, .. } = self.extent;
        let off_m = if self.is_sure() { 0.5 * (length_m - width_m) } else { 0.0 };
        Self {
            heading_rad: self.heading_rad + FRAC_PI_2,
            extent: Extent { length_m: width_m, width_m: length_m, ..self.extent },
            covariance: self.covariance + Matrix2::identity() * (off_m * off_m),
            is_turned: true,
            ..self
        }
    }
}
