//! False positives.

use swerve_geom::{Ego, Map, Point2, Pose2, Vector2};
use swerve_msg::truth::Surroundings;
use swerve_msg::{ActorKind, DetectedBox, Extent};

use super::{Detector, Of, logistic, uniform};

/// Side of a map cell, metres; each cell holds at most one false positive.
const CELL_M: f64 = 4.0;

/// Corridor ahead for false positives: from, to, and to either side, metres in the ego frame.
const NEAR_M: f64 = 5.0;
const FAR_M: f64 = 60.0;
const ASIDE_M: f64 = 12.0;

/// Types of false positives: kind, cumulative probability and typical size.
const LOOKS: [(ActorKind, f64, Extent); 3] = [
    (ActorKind::Pedestrian, 0.5, Extent { length_m: 0.5, width_m: 0.5, height_m: 1.7 }),
    (ActorKind::Car, 0.6, Extent { length_m: 4.4, width_m: 1.8, height_m: 1.5 }),
    (ActorKind::Static, 1.0, Extent { length_m: 0.6, width_m: 0.6, height_m: 1.2 }),
];

impl Detector {
    pub(super) fn false_positives(&self, seen: &Surroundings) -> Vec<DetectedBox> {
        let cells = (FAR_M - NEAR_M) * 2.0 * ASIDE_M / (CELL_M * CELL_M);
        let share = self.params.false_positives_per_frame / cells;
        let corners = [(NEAR_M, -ASIDE_M), (NEAR_M, ASIDE_M), (FAR_M, -ASIDE_M), (FAR_M, ASIDE_M)]
            .map(|(x_m, y_m)| seen.ego.from_local(Point2::<Ego>::new(x_m, y_m)));
        let cells = |pick: fn(&Point2<Map>) -> f64| {
            let low = corners.iter().map(pick).fold(f64::INFINITY, f64::min);
            let high = corners.iter().map(pick).fold(f64::NEG_INFINITY, f64::max);
            (low / CELL_M).floor() as i64..=(high / CELL_M).floor() as i64
        };
        if share <= 0.0 || !seen.ego.is_finite() {
            return Vec::new();
        }
        let columns = cells(|p| p.x_m);
        let all = cells(|p| p.y_m).flat_map(|row| columns.clone().map(move |column| [column, row]));
        all.filter_map(|cell| self.false_positive(cell, share, seen)).collect()
    }

    /// False positive in a map cell at this instant, if any.
    fn false_positive(
        &self,
        [column, row]: [i64; 2],
        share: f64,
        seen: &Surroundings,
    ) -> Option<DetectedBox> {
        let drift = self.params.false_positives;
        // Negative ids: unique per cell and distinct from actors, whose ids are not negative.
        let id = -1 - (column.rem_euclid(1 << 30) << 31 | row.rem_euclid(1 << 30));
        let of = |what| Of { what, id, at: seen.stamp };
        if uniform(self.draw(of("ghost"), drift)) >= share {
            return None;
        }
        let mut rng = self.rng("look", &[id, drift.block(seen.stamp).0]);
        let corner = Point2::<Map>::new(column as f64 * CELL_M, row as f64 * CELL_M);
        let point = corner + Vector2::new(rng.uniform(0.0, CELL_M), rng.uniform(0.0, CELL_M));
        let (look, heading_rad) = (rng.unit(), rng.uniform(0.0, core::f64::consts::TAU));
        let (kind, _, extent) = LOOKS.into_iter().find(|(_, below, _)| look < *below).unwrap_or(LOOKS[0]);
        let size = (1.0 + self.params.size_noise_share * rng.normal()).max(super::SHRINKS_TO);
        let at: Point2<Ego> = seen.ego.to_local(point);
        let is_inside = (NEAR_M..FAR_M).contains(&at.x_m) && at.y_m.abs() < ASIDE_M;
        is_inside.then(|| DetectedBox {
            kind,
            score: logistic(-0.5 * self.params.score_separation + self.draw(of("score"), drift)),
            pose: Pose2::new(at.x_m, at.y_m, heading_rad - seen.ego.heading_rad),
            bottom_m: 0.0,
            extent: Extent {
                length_m: extent.length_m * size,
                width_m: extent.width_m * size,
                height_m: extent.height_m * size,
            },
            image_px: None,
            covariance_m2: None,
            radial_speed_mps: None,
        })
    }
}
