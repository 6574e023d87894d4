//! Upright 3D boxes and their overlap.

use swerve_geom::{Map, Obb, hull_area_m2, math, shared_area_m2};

/// Upright box in the map frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Solid {
    pub(super) footprint: Obb<Map>,
    pub(super) bottom_m: f64,
    pub(super) height_m: f64,
}

impl Solid {
    fn volume_m3(&self) -> f64 {
        4.0 * self.footprint.half_length_m * self.footprint.half_width_m * self.height_m
    }

    fn top_m(&self) -> f64 {
        self.bottom_m + self.height_m
    }

    /// Horizontal distance of the centres, metres.
    fn apart_m(&self, other: &Self) -> f64 {
        self.footprint.center.point().distance(other.footprint.center.point())
    }

    /// Distance of the centres, metres.
    pub(super) fn distance_m(&self, other: &Self) -> f64 {
        let middle = |x: &Self| x.bottom_m + 0.5 * x.height_m;
        math::hypot(self.apart_m(other), middle(self) - middle(other))
    }

    /// Volumes of the union and of the intersection, m³.
    fn volumes_m3(&self, other: &Self) -> (f64, f64) {
        let height_m = (self.top_m().min(other.top_m()) - self.bottom_m.max(other.bottom_m)).max(0.0);
        let shared = shared_area_m2(&self.footprint, &other.footprint) * height_m;
        (self.volume_m3() + other.volume_m3() - shared, shared)
    }

    /// Intersection over union of the volumes, 0 to 1.
    pub(super) fn iou(&self, other: &Self) -> f64 {
        let (union, shared) = self.volumes_m3(other);
        shared / union
    }

    /// Generalised intersection over union, -1 to 1: the IoU minus the share of the smallest upright convex hull of
    /// both that neither fills (Rezatofighi et al. 2019).
    pub(super) fn giou(&self, other: &Self) -> f64 {
        let (union, shared) = self.volumes_m3(other);
        let height_m = self.top_m().max(other.top_m()) - self.bottom_m.min(other.bottom_m);
        let around = hull_area_m2(&self.footprint, &other.footprint) * height_m;
        shared / union - (around - union) / around
    }

    /// Returns true if the generalised IoU is certainly below `least`, from a lower bound of the hull: the strip
    /// between the centres.
    pub(super) fn is_far(&self, other: &Self, least: f64) -> bool {
        let apart_m = self.apart_m(other);
        let narrow = |x: &Self| x.footprint.half_length_m.min(x.footprint.half_width_m);
        let around = apart_m * (narrow(self) + narrow(other)) * self.height_m.max(other.height_m);
        apart_m > self.footprint.radius() + other.footprint.radius()
            && self.volume_m3() + other.volume_m3() < around * (1.0 + least)
    }
}
