//! Object detection in lidar point clouds, without neural networks.
//!
//! [`points`] transforms a sweep to the ego frame at its stamp, [`ground`] removes ground points, `clusters` finds
//! connected components, `boxes` fits rectangles and completes them to the size of a class, and [`score`] rates them
//! with trees that [`train`] has boosted on simulated sweeps. Of overlapping boxes the one with the highest score is
//! kept. What belongs to no class is a static object if it is on the road.

mod boxes;
mod clusters;
pub mod ground;
pub mod points;
mod scan;
pub mod score;
mod skyline;
#[cfg(test)]
mod tests;
pub mod train;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_geom::{Ego, Obb, Point2, Pose2, math};
use swerve_msg::{ActorKind, DetectedBox, Detections, Extent};

use crate::road::Road;
use boxes::{CLASSES, Class, Fit, Rectangle, complete, fit, middle, quarter};
use clusters::{Cluster, Clusters};
use ground::{Ground, Method};
use points::{Point, in_ego_frame};
pub use scan::Scan;
use score::{FEATURES, Model};
use skyline::Skyline;

/// Parameters of the lidar object detector.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Ground segmentation method.
    pub ground: Method,
    /// Detection range ahead, behind and to each side of the ego's origin, metres.
    #[schemars(range(min = 5.0, max = 200.0))]
    pub reach_m: f64,
    /// Fewest points of a cluster.
    #[schemars(range(min = 2, max = 1000))]
    pub points_min: usize,
    /// Score below which boxes are not reported, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub score_min: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self { ground: Method::Rays, reach_m: 50.0, points_min: 5, score_min: 0.1 }
    }
}

impl Params {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()
    }
}

/// Candidate box with the features of its score.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Candidate {
    /// Box without a score.
    pub found: DetectedBox,
    /// Centre of its visible part.
    seen: Point2<Ego>,
    /// Features of the score.
    pub features: [f32; FEATURES],
    /// Index of its class.
    class: usize,
}

/// A detector of objects in the sweeps of one lidar.
pub trait LidarDetector: Send {
    /// Detects the objects of a sweep, by falling score, and replaces the content of `out`: boxes on the ground, in the
    /// ego frame at the sweep's stamp.
    fn detect(&mut self, scan: &Scan<'_>, out: &mut Detections);
}

impl LidarDetector for LidarObjects {
    fn detect(&mut self, scan: &Scan<'_>, out: &mut Detections) {
        self.detect(scan, out);
    }
}

/// Detects objects in sweeps. Stateless except for reused buffers.
#[derive(Clone, Debug)]
pub struct LidarObjects {
    params: Params,
    model: Model,
    ground: Ground,
    clusters: Clusters,
    places: Vec<Point>,
    over_m: Vec<f32>,
    skyline: Skyline,
    /// Rectangle of each cluster, and true where a nearer object hides its left and its right end.
    fits: Vec<(Fit, [bool; 2])>,
    candidates: Vec<Candidate>,
    footprints: Vec<Obb<Ego>>,
}

/// Overlap on each side up to which boxes may be different objects, metres.
const OVERLAP_M: f64 = 0.15;

impl LidarObjects {
    /// Detector with the built-in weights.
    ///
    /// # Errors
    /// If a parameter is outside its range.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        Self::with_model(params, Model::shipped())
    }

    /// Detector with custom weights.
    ///
    /// # Errors
    /// If a parameter is outside its range.
    pub fn with_model(params: Params, model: Model) -> Result<Self, ParamError> {
        params.validate()?;
        let reach_m = params.reach_m as f32;
        Ok(Self {
            params,
            model,
            ground: Ground::new(params.ground, reach_m),
            clusters: Clusters::new(reach_m, params.points_min),
            places: Vec::new(),
            over_m: Vec::new(),
            skyline: Skyline::default(),
            fits: Vec::new(),
            candidates: Vec::new(),
            footprints: Vec::new(),
        })
    }

    /// Detects the objects of a sweep, by falling score, and replaces the content of `out`.
    pub fn detect(&mut self, scan: &Scan<'_>, out: &mut Detections) {
        self.propose(scan);
        let Self { candidates, model, params, footprints, .. } = self;
        for candidate in candidates.iter_mut() {
            candidate.found.score = model.of(candidate.class).score(&candidate.features);
        }
        candidates.retain(|candidate| candidate.found.score >= params.score_min);
        candidates.sort_unstable_by(surest_first);
        out.stamp = scan.cloud.stamp;
        out.boxes.clear();
        footprints.clear();
        keep_disjoint(candidates, footprints, &mut out.boxes);
        self.add_unknown(scan, out);
    }

    /// Adds clusters of no class on the drivable ground: anything there is an obstacle. Without a route there are none.
    fn add_unknown(&mut self, scan: &Scan<'_>, out: &mut Detections) {
        let road = Road::new(scan.route, scan.ego.pose);
        let known = out.boxes.len();
        // Coarsest gaps first: wholes before their parts.
        for (&cluster, (fit, hidden)) in self.clusters.found.iter().zip(&self.fits).rev() {
            let points = self.clusters.of(cluster);
            let lowest_m = points.iter().map(|point| point[3]).fold(f32::INFINITY, f32::min);
            if lowest_m > UNKNOWN_LOWEST_M {
                continue;
            }
            let [x, y] = middle(fit.turn, fit.ends).map(f64::from);
            let Some((lane_rad, beyond_m)) = road.at(Point2::new(x, y)) else { continue };
            if beyond_m >= -UNKNOWN_WITHIN_M {
                continue;
            }
            let rectangle = whole(fit, lane_rad as f32, (self.skyline.sensor(), *hidden));
            let found = unknown(&rectangle, cluster, points.len());
            let Extent { length_m, width_m, .. } = found.extent;
            let footprint = Obb::new(found.pose, length_m, width_m);
            // Within the errors of a box of a class, a cluster is a part of its object.
            let margin_m = |k: usize| {
                let known = out.boxes[..known].get(k)?;
                let [xx, _, yy] = known.covariance_m2?;
                Some(UNKNOWN_APART_M + xx.max(yy).max(0.0).sqrt())
            };
            let is_near =
                |k: usize, other: &Obb<Ego>| other.grown(margin_m(k).unwrap_or(0.0)).overlaps(&footprint);
            if found.score >= self.params.score_min
                && !self.footprints.iter().enumerate().any(|(k, other)| is_near(k, other))
            {
                self.footprints.push(footprint);
                out.boxes.push(found);
            }
        }
        let place = |b: &DetectedBox| [b.pose.x_m, b.pose.y_m];
        out.boxes.sort_unstable_by(|a, b| {
            let [[ax, ay], [bx, by]] = [place(a), place(b)];
            b.score.total_cmp(&a.score).then(ax.total_cmp(&bx)).then(ay.total_cmp(&by))
        });
    }

    /// All candidate boxes, before scoring.
    pub fn propose(&mut self, scan: &Scan<'_>) -> &[Candidate] {
        self.cluster(scan);
        let road = Road::new(scan.route, scan.ego.pose);
        let sensor = scan.ego_from_lidar.origin().coords;
        let sensor = [sensor.x as f32, sensor.y as f32];
        self.skyline.take(sensor, &self.places, &self.over_m);
        self.candidates.clear();
        self.fits.clear();
        for &cluster in &self.clusters.found {
            let points = self.clusters.of(cluster);
            let [x, y, ..] = points[0].map(f64::from);
            let lane = road.at(Point2::new(x, y)).map(|(heading, beyond)| (heading as f32, beyond as f32));
            let fit = fit(points, lane.map(|(heading, _)| heading));
            let hidden = self.skyline.hides(points);
            self.fits.push((fit, hidden));
            for (k, class) in CLASSES.iter().enumerate() {
                if cluster.top_m < class.top_m[0] || cluster.top_m > class.top_m[1] {
                    continue;
                }
                for is_across in [false, true] {
                    let Some(rectangle) = complete(&fit, class, is_across, (sensor, hidden)) else {
                        continue;
                    };
                    // People may be anywhere and face any direction, so the route is not used for them.
                    let lane = lane.filter(|_| !class.kind.is_person());
                    let seen = FittedCluster { clusters: &self.clusters, cluster, fit, sensor, lane };
                    let features = seen.features(&rectangle);
                    let found = boxed(&rectangle, class, cluster, lane);
                    let [x, y] = middle(fit.turn, fit.ends).map(f64::from);
                    self.candidates.push(Candidate { found, seen: Point2::new(x, y), features, class: k });
                }
            }
        }
        &self.candidates
    }

    /// Removes the ground and finds the connected components at every gap; returns the number of clusters.
    pub fn cluster(&mut self, scan: &Scan<'_>) -> usize {
        in_ego_frame(scan, self.params.reach_m as f32, &mut self.places);
        self.ground.heights(&self.places, &mut self.over_m);
        self.clusters.find(&self.places, &self.over_m);
        self.clusters.found.len()
    }
}

/// Adds the boxes, the surest first, that share no ground with a surer one and are no part of it: the rear of a truck is
/// no vehicle of its own, to whichever side it was completed.
fn keep_disjoint(candidates: &[Candidate], footprints: &mut Vec<Obb<Ego>>, boxes: &mut Vec<DetectedBox>) {
    for Candidate { found, seen, .. } in candidates {
        let Extent { length_m, width_m, .. } = found.extent;
        let footprint = Obb::new(found.pose, length_m, width_m).grown(-OVERLAP_M);
        let is_part =
            |other: &Obb<Ego>| !found.kind.is_person() && other.grown(2.0 * OVERLAP_M).contains(*seen);
        if !footprints.iter().any(|other| other.overlaps(&footprint) || is_part(other)) {
            footprints.push(footprint);
            boxes.push(*found);
        }
    }
}

/// Orders by falling score; ties are broken by position, length and class.
fn surest_first(a: &Candidate, b: &Candidate) -> core::cmp::Ordering {
    let place = |c: &Candidate| [c.found.pose.x_m, c.found.pose.y_m, c.found.extent.length_m, c.class as f64];
    b.found.score.total_cmp(&a.found.score).then_with(|| {
        let pairs = place(a).into_iter().zip(place(b));
        pairs.map(|(a, b)| a.total_cmp(&b)).find(|order| order.is_ne()).unwrap_or(core::cmp::Ordering::Equal)
    })
}

/// Objects of no class: height above the ground of their lowest point, up to which they are not overhanging; distance
/// of their centre from the border of the drivable ground; distance from boxes of a class, whose parts they may be,
/// metres.
const UNKNOWN_LOWEST_M: f32 = 0.5;
const UNKNOWN_WITHIN_M: f64 = 0.2;
const UNKNOWN_APART_M: f64 = 0.5;
/// Points from which on an object of no class is likely no noise: with as many its score is 0.63.
const UNKNOWN_POINTS: f64 = 12.0;
/// Smallest side of an object of no class, metres.
const UNKNOWN_SIDE_M: f64 = 0.3;

/// Visible length from which on a partly hidden cluster of no class may be a part of a car, metres.
const PART_M: f32 = 0.8;

/// Rectangle of a cluster of no class: its visible part; or a car along the lane, if a nearer object hides one end.
fn whole(fit: &Fit, lane_rad: f32, (sensor, hidden): ([f32; 2], [bool; 2])) -> Rectangle {
    let size_m = fit.ends.map(|[low, high]| high - low);
    let off_rad = fit.heading_rad - lane_rad;
    let is_across = libm::sinf(off_rad).abs() > libm::cosf(off_rad).abs();
    let is_part = hidden[0] != hidden[1] && size_m[0].max(size_m[1]) > PART_M;
    let car = is_part.then(|| complete(fit, &CLASSES[0], is_across, (sensor, hidden))).flatten();
    car.unwrap_or(Rectangle {
        middle: middle(fit.turn, fit.ends),
        turn: fit.turn,
        heading_rad: fit.heading_rad,
        size_m,
        seen_m: size_m,
    })
}

/// Box of a cluster of no class.
fn unknown(rectangle: &Rectangle, cluster: Cluster, points: usize) -> DetectedBox {
    let [length_m, width_m] = rectangle.size_m.map(|m| f64::from(m).max(UNKNOWN_SIDE_M));
    let [x, y] = rectangle.middle.map(f64::from);
    DetectedBox {
        score: 1.0 - math::exp(-(points as f64) / UNKNOWN_POINTS),
        covariance_m2: Some(rectangle.covariance_m2(&CLASSES[0])),
        ..DetectedBox::on_ground(
            ActorKind::Static,
            0.0,
            Pose2::new(x, y, f64::from(rectangle.heading_rad)),
            Extent { length_m, width_m, height_m: f64::from(cluster.top_m) },
        )
    }
}

/// Distance beyond the drivable ground used if it is unknown, metres: further inside than any known value.
const NO_ROAD_M: f32 = -20.0;

/// Cluster with the context of its features.
struct FittedCluster<'a> {
    clusters: &'a Clusters,
    cluster: Cluster,
    fit: Fit,
    sensor: [f32; 2],
    lane: Option<(f32, f32)>,
}

impl FittedCluster<'_> {
    /// Features of a rectangle, in the order of [`score::FEATURE_NAMES`].
    fn features(&self, rectangle: &Rectangle) -> [f32; FEATURES] {
        let points = self.clusters.of(self.cluster);
        let count = points.len() as f32;
        let [dx, dy] = [0, 1].map(|k| rectangle.middle[k] - self.sensor[k]);
        let range = libm::sqrtf(dx * dx + dy * dy);
        let (mut lowest, mut mean) = (f32::INFINITY, 0.0);
        for point in points {
            lowest = lowest.min(point[3]);
            mean += point[3];
        }
        mean /= count;
        let spread = points.iter().map(|point| (point[3] - mean) * (point[3] - mean)).sum::<f32>() / count;
        let half = rectangle.size_m.map(|m| 0.5 * m);
        let [inside, _] = self.clusters.inside(rectangle.middle, rectangle.turn, half.map(|m| m + 0.2));
        let [around, _] = self.clusters.inside(rectangle.middle, rectangle.turn, half.map(|m| m + 0.8));
        let [_, floor] =
            self.clusters.inside(rectangle.middle, rectangle.turn, half.map(|m| (m - 0.3).max(0.1)));
        let ln = libm::logf;
        let off = |angle: f32, other: f32| quarter(angle - other).abs();
        let (road, beyond) = self.lane.unwrap_or((rectangle.heading_rad, NO_ROAD_M));
        let across = libm::sinf(rectangle.heading_rad - road).abs();
        [
            range,
            ln(count),
            rectangle.seen_m[0],
            rectangle.seen_m[1],
            self.cluster.top_m,
            lowest,
            self.fit.closeness,
            ln(count * range * range),
            (inside / count).min(2.0),
            ((around - inside) / count).min(2.0),
            ln(1.0 + floor * range * range * 0.01),
            off(rectangle.heading_rad, road),
            across,
            rectangle.size_m[0] - rectangle.seen_m[0],
            libm::sqrtf(spread),
            beyond.clamp(NO_ROAD_M, 4.0),
        ]
    }
}

/// Box of a rectangle. Of the two possible headings it has the one along the lane, or against it to the left of the
/// route.
fn boxed(rectangle: &Rectangle, class: &Class, cluster: Cluster, lane: Option<(f32, f32)>) -> DetectedBox {
    let road_rad = lane.map_or(0.0, |(heading, _)| heading);
    let along = libm::cosf(rectangle.heading_rad - road_rad) >= 0.0;
    let turn = if along { 0.0 } else { core::f64::consts::PI };
    let [x, y] = rectangle.middle.map(f64::from);
    let [length_m, width_m] = rectangle.size_m.map(f64::from);
    let heading_rad = f64::from(rectangle.heading_rad);
    // The highest point of a cyclist or of a car's roof may lie between two beams.
    let least_m = if class.kind == ActorKind::Truck { 2.0 } else { 1.4 };
    DetectedBox {
        kind: class.kind,
        score: 0.0,
        pose: Pose2::new(x, y, heading_rad + turn),
        bottom_m: 0.0,
        extent: Extent { length_m, width_m, height_m: f64::from(cluster.top_m).max(least_m) },
        image_px: None,
        covariance_m2: Some(rectangle.covariance_m2(class)),
        radial_speed_mps: None,
    }
}
