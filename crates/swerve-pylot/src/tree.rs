//! The tree of the original's RRT*: it ends with the first node near the goal.

use core::f64::consts::PI;

use swerve_core::Rng;
use swerve_geom::{Point2, math};
use swerve_planning::rrt_star::grid::Grid;
use swerve_planning::{Budget, Progress};

use crate::boxes::Boxes;
use crate::posed::AxisBox;

/// Side of the cells of the node search, metres.
const CELL_M: f64 = 2.0;

/// Parameters of the growth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Growth {
    /// Length of an extension, metres.
    pub(crate) step_m: f64,
    /// Largest number of iterations.
    pub(crate) iterations_max: u64,
    /// Fraction of the iterations that sample the goal.
    pub(crate) goal_share: f64,
    /// Distance to the goal that counts as arrived, metres.
    pub(crate) arrival_m: f64,
    /// True if nodes are rerouted through newer ones where that is shorter.
    pub(crate) rewiring: bool,
    /// Driving speed, m/s.
    pub(crate) speed_mps: f64,
}

/// Start, goal and bounds of the tree.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Aim {
    pub(crate) start: Point2,
    pub(crate) goal: Point2,
    pub(crate) bounds: AxisBox,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    point: Point2,
    cost_m: f64,
    parent: usize,
}

/// The tree, with storage that is reused between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    /// Spatial index of the nodes.
    grid: Grid,
    /// Nodes near a new one: squared distance, index.
    near: Vec<(f64, usize)>,
}

impl Tree {
    /// Grows a new tree; writes the path to its last node to `path` and returns true if that node is near the goal.
    pub(crate) fn grow(
        &mut self,
        boxes: &Boxes,
        (growth, aim): (&Growth, &Aim),
        rng: &mut Rng,
        budget: &mut dyn Budget,
        path: &mut Vec<Point2>,
    ) -> bool {
        self.nodes.clear();
        self.nodes.reserve(growth.iterations_max as usize + 1);
        self.grid.begin(aim.bounds, CELL_M, growth.iterations_max as usize + 1);
        self.push(Node { point: aim.start, cost_m: 0.0, parent: 0 });
        let [x_min, y_min, x_max, y_max] = aim.bounds;
        let free_m2 = (x_max - x_min) * (y_max - y_min) - boxes.area_m2();
        // Karaman and Frazzoli's gamma in two dimensions, as in the original.
        let gamma_m2 = 1.0 + 6.0 * free_m2;
        for i in 1..=growth.iterations_max {
            let progress = budget.spend(1);
            let wanted = match rng.unit() <= growth.goal_share {
                true => aim.goal,
                false => Point2::new(rng.uniform(x_min, x_max), rng.uniform(y_min, y_max)),
            };
            let n = i as f64;
            let radius_m = (gamma_m2.max(0.0) / PI * math::ln(n) / n).sqrt().min(growth.step_m);
            let added = self.extend(boxes, growth, wanted, radius_m);
            if added && self.nodes[self.nodes.len() - 1].point.distance(aim.goal) < growth.arrival_m {
                self.trace(path);
                return true;
            }
            if progress == Progress::Stop {
                break;
            }
        }
        false
    }

    fn push(&mut self, node: Node) {
        self.nodes.push(node);
        self.grid.push(node.point);
    }

    /// Extends the tree; returns true if a node was added.
    fn extend(&mut self, boxes: &Boxes, growth: &Growth, wanted: Point2, radius_m: f64) -> bool {
        let at_s = |node: &Node| node.cost_m / growth.speed_mps.max(0.1);
        let mut point = wanted;
        let (mut nearest, mut distance_m) = self.nearest(point);
        if distance_m > growth.step_m {
            let from = self.nodes[nearest];
            point = from.point + (wanted - from.point) * (growth.step_m / distance_m);
            if !boxes.way_free(point, from.point, at_s(&from)) {
                return false;
            }
            (nearest, distance_m) = self.nearest(point);
        }
        self.collect_near(point, radius_m);
        let mut best = (nearest, distance_m);
        for &(squared_m2, node) in &self.near {
            let (there, way_m) = (&self.nodes[node], squared_m2.sqrt());
            if there.cost_m + way_m < self.nodes[best.0].cost_m + best.1
                && boxes.way_free(point, there.point, at_s(there))
            {
                best = (node, way_m);
            }
        }
        let parent = &self.nodes[best.0];
        if !boxes.way_free(point, parent.point, at_s(parent)) {
            return false;
        }
        let cost_m = parent.cost_m + best.1;
        self.push(Node { point, cost_m, parent: best.0 });
        if growth.rewiring {
            self.rewire(boxes, cost_m / growth.speed_mps.max(0.1));
        }
        true
    }

    fn nearest(&self, point: Point2) -> (usize, f64) {
        let nearest = self.grid.nearest(point) as usize;
        (nearest, self.nodes[nearest].point.distance(point))
    }

    /// The nodes around `point`, the nearest first.
    fn collect_near(&mut self, point: Point2, radius_m: f64) {
        self.near.clear();
        let Self { nodes, grid, near } = self;
        grid.within(point, radius_m, |k| {
            near.push(((nodes[k as usize].point - point).norm_squared(), k as usize));
        });
        self.near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }

    /// Reroutes nearby nodes through the newest node where that is shorter.
    fn rewire(&mut self, boxes: &Boxes, at_s: f64) {
        let newest = self.nodes.len() - 1;
        let Node { point, cost_m, .. } = self.nodes[newest];
        for &(squared_m2, node) in &self.near {
            let over_m = cost_m + squared_m2.sqrt();
            if over_m < self.nodes[node].cost_m && boxes.way_free(self.nodes[node].point, point, at_s) {
                let there = &mut self.nodes[node];
                (there.cost_m, there.parent) = (over_m, newest);
            }
        }
    }

    fn trace(&self, path: &mut Vec<Point2>) {
        path.clear();
        let mut at = self.nodes.len() - 1;
        while at != 0 {
            path.push(self.nodes[at].point);
            at = self.nodes[at].parent;
        }
        path.push(self.nodes[0].point);
        path.reverse();
    }
}
