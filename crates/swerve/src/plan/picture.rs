//! Picture of one posed problem: obstacles, road, path and vehicle outlines along it.

use swerve_draw::{Axes, Canvas, Picture, Style, Text, color};
use swerve_geom::{FrenetPoint, Obb, Point2, Polyline, Pose2};
use swerve_pylot::posed::{AxisBox, FotConfig, FotProblem, ProblemFile, Solution, obb};
use swerve_vehicle::Shape;

use super::read::Posed;

/// Width of a picture, pixels.
const WIDTH_PX: f64 = 1100.0;
/// Height of the title above the drawing, pixels.
const TOP_PX: f64 = 54.0;
/// Width reserved for the axis labels, pixels.
const LEFT_PX: f64 = 62.0;
/// Approximate number of ticks on the x and y axes.
const TICKS: (f64, f64) = (12.0, 8.0);
/// Maximum height of the drawing, pixels.
const HEIGHT_MAX_PX: f64 = 900.0;
/// Margin around everything of interest, metres.
const MARGIN_M: f64 = 4.0;
/// Spacing of the outlines along the path, metres.
const OUTLINE_STEP_M: f64 = 5.0;
/// Spacing of the points at which road edges are drawn, metres.
const ROAD_STEP_M: f64 = 1.0;

/// Contents of a drawing, map frame, metres.
struct Sketch {
    boxes: Vec<AxisBox>,
    /// Required clearance from the boxes.
    clearance_m: f64,
    line: Vec<Point2>,
    edges: Vec<Vec<Point2>>,
    start: Point2,
    goal: Option<Point2>,
    /// Length, width and offset of the outline's centre ahead of the path point; `None` for a point.
    outline: Option<(f64, f64, f64)>,
}

impl Sketch {
    fn of(file: &ProblemFile, posed: &Posed<'_>, k: usize) -> Self {
        let point = |p: [f64; 2]| Point2::new(p[0], p[1]);
        match posed {
            Posed::Fot(config) => {
                Self::on_road(&file.problems.fot[k], Some(config), config.obstacle_clearance)
            }
            Posed::Named(named) => Self::on_road(&file.problems.fot[k], named.road, 0.0),
            Posed::RrtStar(config) => {
                let problem = &file.problems.rrt_star[k];
                let (start, goal) = (point(problem.start), point(problem.goal));
                Self::free(&problem.obstacles, config.obstacle_clearance, start, goal, None)
            }
            Posed::HybridAstar(config) => {
                let problem = &file.problems.hybrid_astar[k];
                let [start, goal] = [problem.start, problem.goal].map(|p| Point2::new(p[0], p[1]));
                // The reference point lies a quarter of the length from the tail.
                let outline = (config.car_length, config.car_width, 0.25 * config.car_length);
                Self::free(&problem.obstacles, config.obstacle_clearance, start, goal, Some(outline))
            }
        }
    }

    /// Sketch of a problem of a road, with its edges if their distances are known.
    fn on_road(problem: &FotProblem, range: Option<&FotConfig>, clearance_m: f64) -> Self {
        let points: Vec<Point2> = problem.waypoints.iter().map(|p| Point2::new(p[0], p[1])).collect();
        let line = Polyline::smooth(&points, ROAD_STEP_M).ok();
        let along = |d_m: f64| {
            let line = line.as_ref()?;
            let n = (line.length() / ROAD_STEP_M) as usize;
            let at = |k: usize| line.to_map(FrenetPoint { s_m: k as f64 * ROAD_STEP_M, d_m });
            Some((0..=n).map(at).collect())
        };
        let shape = Shape::default();
        let start = problem.frenet_ic.zip(line.as_ref());
        let start = start.map(|(ic, line)| line.to_map(FrenetPoint { s_m: ic[0], d_m: ic[2] }));
        let edges = range.map(|range| [-range.max_road_width_l, range.max_road_width_r]);
        Self {
            boxes: problem.obstacles.clone(),
            clearance_m,
            line: along(0.0).unwrap_or_default(),
            edges: edges.into_iter().flatten().filter_map(along).collect(),
            start: start.or(problem.pos.map(|p| Point2::new(p[0], p[1]))).unwrap_or_default(),
            goal: None,
            outline: Some((shape.length_m, shape.width_m, 0.0)),
        }
    }

    /// Sketch of a problem without a road.
    fn free(
        boxes: &[AxisBox],
        clearance_m: f64,
        start: Point2,
        goal: Point2,
        outline: Option<(f64, f64, f64)>,
    ) -> Self {
        let boxes = boxes.to_vec();
        Self { boxes, clearance_m, line: vec![], edges: vec![], start, goal: Some(goal), outline }
    }

    /// Bounds of the drawing: x_min, y_min, x_max, y_max.
    fn extent(&self, path: &[[f64; 4]]) -> [f64; 4] {
        let mut seen = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let mut see = |x: f64, y: f64| {
            seen = [seen[0].min(x), seen[1].min(y), seen[2].max(x), seen[3].max(y)];
        };
        see(self.start.x_m - 3.0, self.start.y_m - 3.0);
        see(self.start.x_m + 3.0, self.start.y_m + 3.0);
        path.iter().for_each(|p| see(p[0], p[1]));
        self.goal.iter().for_each(|p| see(p.x_m, p.y_m));
        let reach_m = if path.is_empty() { 60.0 } else { 15.0 };
        let near = [seen[0] - reach_m, seen[1] - reach_m, seen[2] + reach_m, seen[3] + reach_m];
        let inside = |x: f64, y: f64| near[0] < x && x < near[2] && near[1] < y && y < near[3];
        for b in &self.boxes {
            if inside(0.5 * (b[0] + b[2]), 0.5 * (b[1] + b[3])) {
                seen = [seen[0].min(b[0]), seen[1].min(b[1]), seen[2].max(b[2]), seen[3].max(b[3])];
            }
        }
        // The road edges within the x range of the rest.
        let (x_min, x_max) = (seen[0], seen[2]);
        for p in self.edges.iter().flatten() {
            if (x_min..=x_max).contains(&p.x_m) && inside(p.x_m, p.y_m) {
                seen = [seen[0], seen[1].min(p.y_m), seen[2], seen[3].max(p.y_m)];
            }
        }
        [seen[0] - MARGIN_M, seen[1] - MARGIN_M, seen[2] + MARGIN_M, seen[3] + MARGIN_M]
    }

    fn outline_at(&self, [x, y, heading, _]: [f64; 4]) -> Option<Obb> {
        let (length_m, width_m, ahead_m) = self.outline?;
        let (sin, cos) = swerve_geom::math::sin_cos(heading);
        Some(Obb::new(Pose2::new(x + ahead_m * cos, y + ahead_m * sin, heading), length_m, width_m))
    }
}

/// Transform from metres to pixels, y upwards.
struct View {
    extent: [f64; 4],
    scale: f64,
}

impl View {
    fn at(&self, p: Point2) -> (f64, f64) {
        (LEFT_PX + (p.x_m - self.extent[0]) * self.scale, TOP_PX + (self.extent[3] - p.y_m) * self.scale)
    }

    fn axes(&self) -> Axes {
        let [x_min, y_min, x_max, y_max] = self.extent;
        Axes { corner: (LEFT_PX, TOP_PX), size: self.size(), x: (x_min, x_max), y: (y_min, y_max) }
    }

    fn size(&self) -> (f64, f64) {
        let e = self.extent;
        ((e[2] - e[0]) * self.scale, (e[3] - e[1]) * self.scale)
    }
}

/// Draws problem `k` and its solution.
pub(super) fn draw(file: &ProblemFile, posed: &Posed<'_>, k: usize, solution: &Solution) -> Picture {
    let sketch = Sketch::of(file, posed, k);
    let extent = sketch.extent(&solution.path);
    let scale = (WIDTH_PX / (extent[2] - extent[0])).min(HEIGHT_MAX_PX / (extent[3] - extent[1]));
    let view = View { extent, scale };
    let mut canvas = Canvas::default();
    titles(&mut canvas, solution);
    let size = view.size();
    canvas.begin_clip((LEFT_PX, TOP_PX), size);
    canvas.rect((LEFT_PX, TOP_PX), size, Style::fill(color::GROUND));
    road(&mut canvas, &view, &sketch);
    view.axes().grid(&mut canvas, TICKS);
    obstacles(&mut canvas, &view, &sketch);
    path(&mut canvas, &view, &sketch, solution);
    canvas.end_clip();
    let axes = view.axes();
    axes.frame(&mut canvas);
    axes.numbers_below(&mut canvas, TICKS.0);
    axes.numbers_left(&mut canvas, TICKS.1);
    axes.name_below(&mut canvas, "x (m)");
    axes.name_left(&mut canvas, "y", "m");
    canvas.finish(LEFT_PX + size.0 + 16.0, TOP_PX + size.1 + 40.0, &solution.id)
}

fn titles(canvas: &mut Canvas, solution: &Solution) {
    let s = solution;
    canvas.text((10.0, 20.0), &s.id, Text { size: 15.0, bold: true, ..Text::default() });
    let words = if s.found {
        format!(
            "{:.3} ms, work {}, length {:.2} m, cost {:.2}, clearance {:.2} m, curvature at most {:.3} 1/m",
            s.time_ms, s.work, s.length_m, s.cost, s.clearance_m, s.curvature_max
        )
    } else {
        format!("not found: {} ({:.3} ms, work {})", s.reason, s.time_ms, s.work)
    };
    let color = if s.found { color::SOFT } else { color::ALARM };
    canvas.text((10.0, 41.0), &words, Text { size: 13.0, color, ..Text::default() });
}

fn road(canvas: &mut Canvas, view: &View, sketch: &Sketch) {
    if let [low, high] = sketch.edges.as_slice() {
        let around = low.iter().chain(high.iter().rev()).map(|p| view.at(*p));
        canvas.path(around, true, Style::fill(color::ROAD));
    }
    for edge in &sketch.edges {
        let style = Style::line(color::ROAD_EDGE, 1.5);
        canvas.path(edge.iter().map(|p| view.at(*p)), false, style);
    }
    let style = Style::line(color::ROAD_EDGE, 1.0).dashed(8.0, 6.0);
    canvas.path(sketch.line.iter().map(|p| view.at(*p)), false, style);
}

fn obstacles(canvas: &mut Canvas, view: &View, sketch: &Sketch) {
    for b in &sketch.boxes {
        let solid = obb(b);
        let keep = solid.grown(sketch.clearance_m);
        let style = Style::line(color::PERSON, 1.0).dashed(3.0, 3.0);
        canvas.path(keep.corners().map(|p| view.at(p)), true, style);
        let style = Style::fill(color::VEHICLE).filled_by(0.85);
        canvas.path(solid.corners().map(|p| view.at(p)), true, style);
    }
}

fn path(canvas: &mut Canvas, view: &View, sketch: &Sketch, solution: &Solution) {
    let style = Style::line(color::EGO, 1.0).lined_by(0.55);
    let mut gone_m = 0.0;
    let mut next_m = 0.0;
    let path = &solution.path;
    for (k, &p) in path.iter().enumerate() {
        if k > 0 {
            gone_m += swerve_geom::math::hypot(p[0] - path[k - 1][0], p[1] - path[k - 1][1]);
        }
        if gone_m >= next_m || k + 1 == path.len() {
            next_m = gone_m + OUTLINE_STEP_M;
            match sketch.outline_at(p) {
                Some(outline) => canvas.path(outline.corners().map(|p| view.at(p)), true, style),
                None => canvas.circle(view.at(Point2::new(p[0], p[1])), 3.0, style),
            }
        }
    }
    let line = Style::line(color::PLAN, 2.5);
    canvas.path(path.iter().map(|p| view.at(Point2::new(p[0], p[1]))), false, line);
    canvas.circle(view.at(sketch.start), 5.0, Style::fill(color::EGO));
    if let Some(goal) = sketch.goal {
        canvas.star(view.at(goal), 9.0, Style::fill(color::SIGHT));
    }
}
