//! Exact evaluation of roads and lanes in the projected frame.

use swerve_geom::{math, wrap_angle};

use super::lane::LaneGeometry;
use super::{Lane, LaneSection, Network, Road};
use crate::cubic::Cubics;
use crate::curve::Pose;

/// A place of a lane's centre line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Sample {
    /// Position in the projected frame, metres: x east, y north, z up.
    pub position_m: [f64; 3],
    /// Heading of the road's reference line, in the direction of s, radians in `(-pi, pi]`.
    pub reference_heading_rad: f64,
    /// Heading of the lane's centre line in the ground plane, in the direction of s, radians in `(-pi, pi]`.
    pub heading_rad: f64,
    /// Width of the lane along t, metres.
    pub width_m: f64,
}

/// A place in the ground plane beside a road.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SurfacePoint {
    /// Position in the projected frame, metres: x east, y north, z up.
    pub position_m: [f64; 3],
    /// Heading of the road's reference line, radians; not wrapped.
    pub reference_heading_rad: f64,
}

/// Error of a query by identities.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum SampleError {
    /// The network has no such road.
    #[error("expected the identity of a road, found {0:?}{1}")]
    Road(String, String),
    /// The road has no such lane section.
    #[error("expected a lane section from 0 to {last} of road {road:?}, found {section}")]
    Section {
        /// The road.
        road: String,
        /// The lane section.
        section: usize,
        /// The last lane section of the road.
        last: usize,
    },
    /// The lane section has no such lane.
    #[error("expected a lane of section {section} of road {road:?}, one of {lanes}; found {lane}")]
    Lane {
        /// The road.
        road: String,
        /// The lane section.
        section: usize,
        /// The lane.
        lane: i32,
        /// Lanes of the section.
        lanes: String,
    },
    /// The position is not within the lane section.
    #[error("expected s from {from_m} to {to_m} m in section {section} of road {road:?}, found {s_m}")]
    Position {
        /// The road.
        road: String,
        /// The lane section.
        section: usize,
        /// The position.
        s_m: f64,
        /// Begin of the section.
        from_m: f64,
        /// End of the section.
        to_m: f64,
    },
}

/// Position of a border to the left of the reference line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Edge {
    /// Position, metres.
    pub t_m: f64,
    /// Its change along the road.
    pub slope: f64,
    /// Change of the slope along the road, 1/m.
    pub bend_1pm: f64,
}

/// Both borders of a lane at a position of its road.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LaneEdges {
    /// Border towards the centre lane.
    pub inner: Edge,
    /// Border away from the centre lane.
    pub outer: Edge,
}

impl LaneEdges {
    /// The middle between the borders.
    pub fn center(&self) -> Edge {
        let Self { inner, outer } = self;
        Edge {
            t_m: 0.5 * (inner.t_m + outer.t_m),
            slope: 0.5 * (inner.slope + outer.slope),
            bend_1pm: 0.5 * (inner.bend_1pm + outer.bend_1pm),
        }
    }

    /// Distance between the borders, metres.
    pub fn width_m(&self) -> f64 {
        (self.outer.t_m - self.inner.t_m).abs()
    }
}

impl Edge {
    fn of([t_m, slope, bend_1pm]: [f64; 3]) -> Self {
        Self { t_m, slope, bend_1pm }
    }

    /// The border beyond a lane on a side: 1 for the left, -1 for the right.
    fn beyond(self, lane: &Lane, side: f64, s_m: f64) -> Self {
        match &lane.geometry {
            LaneGeometry::Border(records) => Self::of(records.at(s_m)),
            LaneGeometry::Width(records) => {
                let [width_m, slope, bend_1pm] = records.at(s_m);
                if width_m <= 0.0 {
                    return self;
                }
                Self {
                    t_m: self.t_m + side * width_m,
                    slope: self.slope + side * slope,
                    bend_1pm: self.bend_1pm + side * bend_1pm,
                }
            }
        }
    }
}

impl Road {
    /// Pose of the reference line in the file's own frame.
    pub(crate) fn pose(&self, s_m: f64) -> Pose {
        const NOWHERE: Pose = Pose { x_m: 0.0, y_m: 0.0, heading_rad: 0.0, curvature_1pm: 0.0 };
        self.line.at(s_m).unwrap_or(NOWHERE)
    }

    /// Lanes of one side with their borders at `s_m`, from inside to outside.
    pub fn edges<'r>(
        &self,
        section: &'r LaneSection,
        is_left: bool,
        s_m: f64,
    ) -> impl Iterator<Item = (&'r Lane, LaneEdges)> + use<'r> {
        let (lanes, side) = if is_left { (&section.left, 1.0) } else { (&section.right, -1.0) };
        let mut inner = Edge::of(self.lane_offset.at(s_m));
        lanes.iter().map(move |lane| {
            let outer = inner.beyond(lane, side, s_m);
            let edges = LaneEdges { inner, outer };
            inner = outer;
            (lane, edges)
        })
    }

    /// Roll of the cross-section, and its change along the road.
    fn roll(&self, s_m: f64) -> (f64, f64) {
        let [roll_rad, change, _] = self.superelevation.at(s_m);
        (roll_rad, change)
    }

    /// Height over the plane of the superelevation at `t_m`, metres.
    fn height_m(&self, s_m: f64, t_m: f64) -> f64 {
        let shapes = &self.lateral.shapes;
        let over = |records: &Cubics| {
            // Constant below the first record.
            let first = records.0.first().map_or(0.0, |record| record.s_m);
            records.value(t_m.max(first))
        };
        let next = shapes.partition_point(|(at_m, _)| *at_m <= s_m);
        let shape_m = match (next.checked_sub(1).map(|k| &shapes[k]), shapes.get(next)) {
            (Some((a_m, a)), Some((b_m, b))) => {
                let share = (s_m - a_m) / (b_m - a_m);
                over(a) + (over(b) - over(a)) * share
            }
            (Some((_, a)), None) => over(a),
            (None, _) => 0.0,
        };
        let [left, right] = &self.lateral.crossfall;
        let fall = if t_m > 0.0 { left } else { right };
        if fall.0.is_empty() { shape_m } else { shape_m - t_m.abs() * math::tan(fall.value(s_m)) }
    }

    /// Distance of `t_m` from the reference line in the ground plane, and height over the reference line, metres.
    fn cross(&self, s_m: f64, t_m: f64) -> [f64; 2] {
        let (roll_rad, _) = self.roll(s_m);
        let is_flat =
            self.lateral.shapes.is_empty() && self.lateral.crossfall.iter().all(|side| side.0.is_empty());
        if is_flat && roll_rad == 0.0 {
            return [t_m, 0.0];
        }
        let height_m = if is_flat { 0.0 } else { self.height_m(s_m, t_m) };
        let (sin, cos) = math::sin_cos(roll_rad);
        [t_m * cos - height_m * sin, t_m * sin + height_m * cos]
    }

    /// Lateral distance in the ground plane of a line that runs along `edge`, and its change along the road.
    pub(crate) fn lateral(&self, s_m: f64, edge: Edge) -> (f64, f64) {
        const STEP_M: f64 = 1e-4;
        let (roll_rad, change) = self.roll(s_m);
        let [q, _] = self.cross(s_m, edge.t_m);
        if self.lateral.shapes.is_empty() && self.lateral.crossfall.iter().all(|side| side.0.is_empty()) {
            if roll_rad == 0.0 && change == 0.0 {
                return (q, edge.slope);
            }
            let (sin, cos) = math::sin_cos(roll_rad);
            return (q, edge.slope * cos - edge.t_m * sin * change);
        }
        let at = |ds: f64| self.cross(s_m + ds, edge.t_m + edge.slope * ds)[0];
        (q, (at(STEP_M) - at(-STEP_M)) / (2.0 * STEP_M))
    }
}

impl Network {
    /// Point at `t_m` metres to the left of a road's reference line at `s_m`, with elevation, superelevation and shape,
    /// and the offset of the header.
    pub fn place(&self, road: &Road, s_m: f64, t_m: f64) -> SurfacePoint {
        let pose = road.pose(s_m);
        let [lateral_m, height_m] = road.cross(s_m, t_m);
        let (sin, cos) = math::sin_cos(pose.heading_rad);
        let (x, y) = (pose.x_m - lateral_m * sin, pose.y_m + lateral_m * cos);
        let z = road.elevation.value(s_m) + height_m;
        let reference_heading_rad = pose.heading_rad + self.header.offset[3];
        SurfacePoint { position_m: self.projected([x, y, z]), reference_heading_rad }
    }

    /// Position in the projected frame (clause 8.5).
    pub(crate) fn projected(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [x0, y0, z0, turn_rad] = self.header.offset;
        if turn_rad == 0.0 {
            return [x + x0, y + y0, z + z0];
        }
        let (sin, cos) = math::sin_cos(turn_rad);
        [x * cos - y * sin + x0, x * sin + y * cos + y0, z + z0]
    }

    /// Centre line of a lane at a position along its road. `section` counts from 0.
    ///
    /// # Errors
    /// If there is no such road, section or lane, or `s_m` is outside the section by more than a micrometre.
    pub fn sample(&self, road: &str, section: usize, lane: i32, s_m: f64) -> Result<Sample, SampleError> {
        let Some(found) = self.road(road) else {
            let names = self.road_of.keys().map(String::as_str);
            return Err(SampleError::Road(road.to_owned(), swerve_text::did_you_mean(road, names)));
        };
        let last = found.sections.len().saturating_sub(1);
        let (Some(within), Some([from_m, to_m])) =
            (found.sections.get(section), found.section_span_m(section))
        else {
            return Err(SampleError::Section { road: road.to_owned(), section, last });
        };
        if within.lane(lane).is_none() {
            let ids: Vec<String> = within.lanes().map(|lane| lane.id.to_string()).collect();
            return Err(SampleError::Lane { road: road.to_owned(), section, lane, lanes: ids.join(", ") });
        }
        if !(from_m - 1e-6..=to_m + 1e-6).contains(&s_m) {
            return Err(SampleError::Position { road: road.to_owned(), section, s_m, from_m, to_m });
        }
        let edges = found.edges(within, lane > 0, s_m).find(|(one, _)| one.id == lane);
        Ok(self.sample_at(found, s_m, edges.map_or_else(LaneEdges::none, |(_, edges)| edges)))
    }

    /// Centre line of a lane with these borders.
    pub(crate) fn sample_at(&self, road: &Road, s_m: f64, edges: LaneEdges) -> Sample {
        let center = edges.center();
        let SurfacePoint { position_m, reference_heading_rad } = self.place(road, s_m, center.t_m);
        let (lateral_m, slope) = road.lateral(s_m, center);
        let along = 1.0 - road.pose(s_m).curvature_1pm * lateral_m;
        let turned_rad = if slope == 0.0 && along > 0.0 { 0.0 } else { math::atan2(slope, along) };
        Sample {
            position_m,
            reference_heading_rad: wrap_angle(reference_heading_rad),
            heading_rad: wrap_angle(reference_heading_rad + turned_rad),
            width_m: edges.width_m(),
        }
    }
}

impl LaneEdges {
    fn none() -> Self {
        let none = Edge::of([0.0; 3]);
        Self { inner: none, outer: none }
    }
}
