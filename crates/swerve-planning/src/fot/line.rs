//! The reference line as a table over arc length: positions, directions and curvatures without trigonometry.

use swerve_geom::{Point2, Polyline, PolylineError, Pose2, angle_between, math};

/// Spacing of the entries, metres.
const STEP_M: f64 = 0.25;

/// Longest supported line, metres: bounds the table.
const LENGTH_MAX_M: f64 = 20_000.0;

/// Straight pieces longer than this are divided before smoothing, metres: a spline over one long piece would overshoot
/// as soon as the next one bends.
const PIECE_MAX_M: f64 = 5.0;

/// Smooth line through `points`.
pub fn smoothed(points: &[Point2]) -> Result<Polyline, PolylineError> {
    let mut dense: Vec<Point2> = Vec::with_capacity(points.len());
    for (i, &p) in points.iter().enumerate() {
        if let Some(&before) = i.checked_sub(1).and_then(|k| points.get(k)) {
            let pieces = (before.distance(p) / PIECE_MAX_M).ceil().clamp(1.0, LENGTH_MAX_M) as usize;
            dense.extend((1..pieces).map(|k| before + (p - before) * (k as f64 / pieces as f64)));
        }
        dense.push(p);
    }
    Polyline::smooth(&dense, STEP_M)
}

/// Moving average of the line over `half_m` before and after each place: curvature steps become ramps, and a bend of
/// radius `R` is cut by `half_m² / 6 R`.
fn eased(line: &Polyline, half_m: f64) -> Result<Polyline, PolylineError> {
    let reach = (half_m / STEP_M).round() as i32;
    let steps = (line.length() / STEP_M).ceil() as i32;
    let mean = |k: i32| {
        let around = (k - reach..=k + reach).map(|j| line.at(f64::from(j) * STEP_M).pose);
        let (x, y) = around.fold((0.0, 0.0), |(x, y), pose| (x + pose.x_m, y + pose.y_m));
        let count = f64::from(2 * reach + 1);
        Point2::new(x / count, y / count)
    };
    Polyline::new(&(0..=steps).map(mean).collect::<Vec<_>>())
}

/// The line at one arc length.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Node {
    /// X coordinate, metres.
    pub x_m: f64,
    /// Y coordinate, metres.
    pub y_m: f64,
    /// Cosine of its direction.
    pub cos: f64,
    /// Sine of its direction.
    pub sin: f64,
    /// Curvature, 1/m; positive turns left.
    pub curvature_1pm: f64,
    /// Derivative of the curvature by arc length, 1/m².
    pub bend_1pm2: f64,
}

/// A reference line, extended straight beyond its ends.
#[derive(Clone, Debug, Default)]
pub struct Line {
    nodes: Vec<Node>,
    /// Direction between each entry and the next if it is the same at both (cosine, sine).
    straight: Vec<Option<(f64, f64)>>,
    length_m: f64,
    step_m: f64,
}

impl Line {
    /// Sets the line from a polyline whose points are dense in bends.
    pub fn set(&mut self, polyline: &Polyline) {
        self.length_m = polyline.length().min(LENGTH_MAX_M);
        let n = (self.length_m / STEP_M).ceil().max(1.0) as usize;
        self.step_m = self.length_m / n as f64;
        self.nodes.clear();
        self.nodes.reserve(n + 1);
        let step_m = self.step_m;
        for p in polyline.at_each((0..=n).map(|k| k as f64 * step_m)) {
            let (sin, cos) = math::sin_cos(p.pose.heading_rad);
            self.nodes.push(Node {
                x_m: p.pose.x_m,
                y_m: p.pose.y_m,
                cos,
                sin,
                curvature_1pm: p.curvature_1pm,
                bend_1pm2: 0.0,
            });
        }
        for k in 0..n {
            self.nodes[k].bend_1pm2 =
                (self.nodes[k + 1].curvature_1pm - self.nodes[k].curvature_1pm) / self.step_m;
        }
        self.straight.clear();
        self.straight.extend(self.nodes.windows(2).map(|two| {
            let (a, b) = (&two[0], &two[1]);
            (a.cos == b.cos && a.sin == b.sin).then(|| between(a, b, 0.0))
        }));
    }

    /// Length, metres.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// The line at `s_m`: between entries, positions are interpolated along the chord (error below `κ step² / 8`, under
    /// a millimetre), directions linearly.
    pub fn at(&self, s_m: f64) -> Node {
        let last = self.nodes.len() - 1;
        if s_m < 0.0 || s_m >= self.length_m {
            let (end, beyond_m) =
                if s_m < 0.0 { (self.nodes[0], s_m) } else { (self.nodes[last], s_m - self.length_m) };
            return Node {
                x_m: end.x_m + end.cos * beyond_m,
                y_m: end.y_m + end.sin * beyond_m,
                curvature_1pm: 0.0,
                bend_1pm2: 0.0,
                ..end
            };
        }
        let index = ((s_m / self.step_m) as usize).min(last - 1);
        let (a, b) = (&self.nodes[index], &self.nodes[index + 1]);
        let u = s_m / self.step_m - index as f64;
        let mix = |p: f64, q: f64| p + (q - p) * u;
        let (cos, sin) = self.straight[index].unwrap_or_else(|| between(a, b, u));
        Node {
            x_m: mix(a.x_m, b.x_m),
            y_m: mix(a.y_m, b.y_m),
            cos,
            sin,
            curvature_1pm: mix(a.curvature_1pm, b.curvature_1pm),
            bend_1pm2: a.bend_1pm2,
        }
    }

    /// Arc length and offset of `point`: refined from a first guess with the directions of the table, so that the
    /// inverse returns the point.
    pub fn project(&self, point: Point2, guess_s_m: f64) -> (f64, f64) {
        let mut s_m = guess_s_m;
        let mut d_m = 0.0;
        for _ in 0..4 {
            let node = self.at(s_m);
            let (dx, dy) = (point.x_m - node.x_m, point.y_m - node.y_m);
            d_m = node.cos * dy - node.sin * dx;
            let stretch = (1.0 - node.curvature_1pm * d_m).max(0.2);
            s_m += (node.cos * dx + node.sin * dy) / stretch;
        }
        (s_m, d_m)
    }
}

/// Direction (cosine, sine) at fraction `u` of the way from `a` to `b`.
#[inline]
fn between(a: &Node, b: &Node, u: f64) -> (f64, f64) {
    let (cos, sin) = (a.cos + (b.cos - a.cos) * u, a.sin + (b.sin - a.sin) * u);
    let scale = 1.0 / math::hypot(cos, sin);
    (cos * scale, sin * scale)
}

/// A pose relative to a line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OnLine {
    /// Arc length, metres.
    pub s_m: f64,
    /// Offset to the left, metres.
    pub d_m: f64,
    /// Node of the line at `s_m`.
    pub node: Node,
    /// Heading relative to the line, radians.
    pub turn_rad: f64,
}

/// The smooth line of a route, recomputed when the route changes.
#[derive(Clone, Debug, Default)]
pub struct RouteLine {
    line: Line,
    route: Option<Polyline>,
    ease_m: f64,
}

impl RouteLine {
    /// Creates an empty line whose corners will be smoothed over `ease_m` before and after each place.
    pub(crate) fn eased(ease_m: f64) -> Self {
        Self { ease_m, ..Self::default() }
    }

    /// Sets the route.
    pub fn follow(&mut self, route: &Polyline) {
        if self.route.as_ref() != Some(route) {
            let smooth = smoothed(route.points());
            match smooth.and_then(|line| if self.ease_m > 0.0 { eased(&line, self.ease_m) } else { Ok(line) })
            {
                Ok(smooth) => self.line.set(&smooth),
                Err(_) => self.line.set(route),
            }
            self.route = Some(route.clone());
        }
    }

    /// The line of the last route.
    pub fn line(&self) -> &Line {
        &self.line
    }

    /// The nearest place of `pose` along the line.
    pub fn locate(&self, pose: Pose2) -> OnLine {
        self.locate_from(pose, self.route.as_ref().map_or(0.0, |route| route.project(pose.point()).s_m))
    }

    /// Place of `pose` along the line, near arc length `guess_m` of the route.
    pub fn locate_from(&self, pose: Pose2, guess_m: f64) -> OnLine {
        let (s_m, d_m) = self.line.project(pose.point(), guess_m);
        let node = self.line.at(s_m);
        let turn_rad = angle_between(math::atan2(node.sin, node.cos), pose.heading_rad);
        OnLine { s_m, d_m, node, turn_rad }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_is_followed_to_the_millimetre() {
        let points: Vec<Point2> = (0..60)
            .map(|k| {
                let (sin, cos) = math::sin_cos(f64::from(k) * 0.05);
                Point2::new(20.0 * sin, 20.0 - 20.0 * cos)
            })
            .collect();
        let mut line = Line::default();
        line.set(&Polyline::smooth(&points, 0.25).unwrap());
        for k in 4..50 {
            let node = line.at(f64::from(k));
            let radius = math::hypot(node.x_m, node.y_m - 20.0);
            assert!((radius - 20.0).abs() < 1e-3, "{k}: {radius}");
            assert!((node.curvature_1pm - 0.05).abs() < 2e-3, "{k}: {node:?}");
            let point = Point2::new(node.x_m - 2.0 * node.sin, node.y_m + 2.0 * node.cos);
            let (s_m, d_m) = line.project(point, f64::from(k) + 0.7);
            assert!((s_m - f64::from(k)).abs() < 1e-3 && (d_m - 2.0).abs() < 1e-3, "{k}: {s_m} {d_m}");
        }
    }

    #[test]
    fn stored_directions_of_straights_match_the_computed_ones() {
        let points: Vec<Point2> =
            (0..40).map(|k| Point2::new(0.7 * f64::from(k), 1.9 * f64::from(k))).collect();
        let mut line = Line::default();
        line.set(&Polyline::new(&points).unwrap());
        assert!(line.straight.iter().any(Option::is_some));
        for k in 0..200 {
            let s_m = 0.37 * f64::from(k);
            let index = ((s_m / line.step_m) as usize).min(line.straight.len() - 1);
            let u = s_m / line.step_m - index as f64;
            let node = line.at(s_m);
            if s_m < line.length_m() {
                assert_eq!(
                    (node.cos, node.sin),
                    between(&line.nodes[index], &line.nodes[index + 1], u),
                    "{s_m}"
                );
            }
        }
    }

    #[test]
    fn a_long_straight_before_a_bend_stays_straight() {
        let mut points = vec![Point2::new(-200.0, 0.0)];
        points.extend((0..40).map(|k| {
            let (sin, cos) = math::sin_cos(f64::from(k) * 0.05);
            Point2::new(20.0 * sin, 20.0 - 20.0 * cos)
        }));
        let mut line = Line::default();
        line.set(&smoothed(&points).unwrap());
        for s in 0..195 {
            assert!(line.at(f64::from(s)).y_m.abs() < 0.1, "{s}: {:?}", line.at(f64::from(s)));
        }
    }

    #[test]
    fn line_is_extended_straight_beyond_its_ends() {
        let mut line = Line::default();
        line.set(&Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(0.0, 0.5)]).unwrap());
        let (before, beyond) = (line.at(-3.0), line.at(4.0));
        assert!((before.y_m + 3.0).abs() < 1e-12 && (beyond.y_m - 4.0).abs() < 1e-12);
    }
}
