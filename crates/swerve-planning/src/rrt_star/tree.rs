//! The tree: grown towards random places and rewired to short paths.

use swerve_core::Rng;
use swerve_geom::{Pose2, math};

use super::grid::Grid;
use crate::request::{Budget, Progress};

/// Sampling space of a tree: places, paths between them, obstacles.
pub trait Space {
    /// Samples a random place.
    fn draw(&self, rng: &mut Rng) -> Pose2;
    /// Length of the path between two places, regardless of obstacles, metres.
    fn length_m(&self, from: Pose2, to: Pose2) -> f64;
    /// The place `step_m` along the path, or its end if that is nearer.
    fn toward(&self, from: Pose2, to: Pose2, step_m: f64) -> Pose2;
    /// Returns true if the path is free when it begins after `travelled_m`.
    fn free(&self, from: Pose2, to: Pose2, travelled_m: f64) -> bool;
    /// Returns true if all obstacles are static, so that a blocked path stays blocked.
    fn stands(&self) -> bool {
        false
    }
}

/// Parameters of the growth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Growth {
    /// Longest extension, metres.
    pub step_m: f64,
    /// Largest number of iterations.
    pub iterations_max: u64,
    /// Fraction of iterations that sample the goal.
    pub goal_share: f64,
    /// Fraction of iterations that sample a guide: a given place where short paths are known to bend.
    pub guide_share: f64,
    /// `gamma` of the rewiring radius `sqrt(gamma / pi * ln n / n)`, m².
    pub gamma_m2: f64,
    /// Largest rewiring radius, metres.
    pub radius_max_m: f64,
    /// Termination.
    pub until: Until,
}

/// Termination of the growth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Until {
    /// At the first node within this distance of the goal, metres, as in the original algorithm.
    Arrival(f64),
    /// When the iterations or the budget are used up. Nodes are connected to the goal itself if possible, and after the
    /// first path only places that can shorten it are sampled (J. D. Gammell, S. S. Srinivasa and T. D. Barfoot,
    /// "Informed RRT*", 2014).
    Spent,
}

/// Start, goal and bounds of a tree.
#[derive(Clone, Copy, Debug)]
pub struct Aim<'a> {
    /// Root pose.
    pub start: Pose2,
    /// Goal pose.
    pub goal: Pose2,
    /// Bounds of the tree: x_min, y_min, x_max, y_max, metres.
    pub bounds: [f64; 4],
    /// Places where short paths are known to bend.
    pub guides: &'a [Pose2],
}

/// `gamma` of the rewiring radius in two dimensions for a free area: `4 (1 + 1/2) area` (Karaman and Frazzoli,
/// theorem 38).
pub fn gamma_m2([x_min, y_min, x_max, y_max]: [f64; 4]) -> f64 {
    6.0 * (x_max - x_min) * (y_max - y_min)
}

const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Node {
    pose: Pose2,
    parent: u32,
    first_child: u32,
    next_sibling: u32,
    /// Length of the path from the root, metres.
    cost_m: f64,
}

/// A candidate parent or child of a node.
#[derive(Clone, Copy, Debug)]
struct Neighbour {
    node: u32,
    cost_m: f64,
}

/// A place where short paths are known to bend, not yet in the tree.
#[derive(Clone, Copy, Debug)]
struct Guide {
    pose: Pose2,
    /// Index of its bit in `blocked`.
    number: usize,
}

/// The tree and its storage, reused between calls.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    nodes: Vec<Node>,
    grid: Grid,
    near: Vec<Neighbour>,
    /// Entries of `near` still to be tried, the cheapest last, if the first few are not enough.
    order: Vec<Neighbour>,
    stack: Vec<u32>,
    /// Nodes with a free path to the goal, with its length.
    arrived: Vec<(u32, f64)>,
    /// Length of the best path, infinite before the first, metres.
    best_m: f64,
    /// Guides that are not yet in the tree.
    guides: Vec<Guide>,
    /// Bit matrix of nodes and guides: paths known to be blocked.
    blocked: Vec<u64>,
    /// Number of words per node in `blocked`.
    words: usize,
    /// Nodes of guides that are in the tree.
    guide_nodes: Vec<u32>,
    /// Iterations of the latest growth.
    pub work: u64,
}

/// Largest number of samples until one can shorten the path.
const DRAWS_MAX: usize = 24;

/// Number of cheapest candidates that are searched one by one before the rest are sorted.
const UNSORTED: usize = 2;

/// Largest number of iterations for which memory is reserved.
const RESERVED_MAX: u64 = 100_000;

/// Improvements below this are ignored, metres.
const GAIN_M: f64 = 1e-9;

impl Tree {
    /// Grows a new tree; returns true if the goal was reached.
    pub fn grow(
        &mut self,
        space: &impl Space,
        growth: &Growth,
        aim: &Aim<'_>,
        rng: &mut Rng,
        budget: &mut dyn Budget,
    ) -> bool {
        let Aim { start, goal, .. } = *aim;
        self.begin(growth, aim);
        if growth.until == Until::Spent {
            self.try_goal(space, 0, goal);
            if self.best_m <= space.length_m(start, goal) + GAIN_M {
                return true;
            }
        }
        for _ in 0..growth.iterations_max {
            let progress = budget.spend(1);
            self.work += 1;
            if self.iterate(space, growth, aim, rng) || progress == Progress::Stop {
                break;
            }
        }
        !self.arrived.is_empty()
    }

    fn begin(&mut self, growth: &Growth, aim: &Aim<'_>) {
        let Aim { start, bounds, guides, .. } = *aim;
        self.work = 0;
        let nodes_max = growth.iterations_max.min(RESERVED_MAX) as usize + 1;
        self.nodes.clear();
        self.nodes.reserve(nodes_max);
        self.near.clear();
        self.near.reserve(nodes_max);
        self.order.clear();
        self.order.reserve(nodes_max);
        self.stack.clear();
        self.stack.reserve(nodes_max);
        self.arrived.clear();
        self.arrived.reserve(nodes_max);
        self.best_m = f64::INFINITY;
        self.guides.clear();
        self.guides.extend(guides.iter().enumerate().map(|(number, &pose)| Guide { pose, number }));
        self.words = guides.len().div_ceil(64);
        self.blocked.clear();
        self.blocked.reserve(nodes_max * self.words);
        self.guide_nodes.clear();
        self.guide_nodes.reserve(guides.len());
        self.grid.begin(bounds, growth.radius_max_m, nodes_max);
        self.push(start, NONE, 0.0);
    }

    fn push(&mut self, pose: Pose2, parent: u32, cost_m: f64) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node { pose, parent: NONE, first_child: NONE, next_sibling: NONE, cost_m });
        self.grid.push(pose.point());
        self.blocked.resize(self.nodes.len() * self.words, 0);
        if parent != NONE {
            self.adopt(parent, node);
        }
        node
    }

    /// Runs one iteration; returns true if the growth is complete.
    fn iterate(&mut self, space: &impl Space, growth: &Growth, aim: &Aim<'_>, rng: &mut Rng) -> bool {
        let goal = aim.goal;
        let drawn = rng.unit();
        if drawn < growth.guide_share && !self.guides.is_empty() {
            self.add_guide(space, aim, rng);
            return false;
        }
        let wanted = if drawn >= 1.0 - growth.goal_share { goal } else { self.draw(space, aim, rng) };
        let nearest = self.grid.nearest(wanted.point());
        let from = self.nodes[nearest as usize].pose;
        let pose = space.toward(from, wanted, growth.step_m);
        if pose.point().distance(from.point()) < 1e-6 || self.is_useless(pose, aim) {
            return false;
        }
        let n = self.nodes.len() as f64;
        let radius_m = (growth.gamma_m2 / core::f64::consts::PI * math::ln(n.max(2.0)) / n).sqrt();
        self.collect_near(space, pose, radius_m.min(growth.radius_max_m), nearest);
        let Some(node) = self.connect(space, pose, None) else { return false };
        self.rewire(space, node);
        match growth.until {
            Until::Arrival(near_m) => {
                let arrives = pose.point().distance(goal.point()) < near_m;
                if arrives {
                    self.arrive(node, 0.0);
                }
                arrives
            }
            Until::Spent => {
                self.try_goal(space, node, goal);
                false
            }
        }
    }

    /// Samples a random place; once there is a path, one that can shorten it.
    fn draw(&self, space: &impl Space, aim: &Aim<'_>, rng: &mut Rng) -> Pose2 {
        let mut pose = space.draw(rng);
        for _ in 0..DRAWS_MAX {
            if !self.is_useless(pose, aim) {
                break;
            }
            pose = space.draw(rng);
        }
        pose
    }

    /// Returns true if even the straight path through `pose` is no shorter than the best path.
    fn is_useless(&self, pose: Pose2, aim: &Aim<'_>) -> bool {
        let p = pose.point();
        let straight_m = || aim.start.point().distance(p) + p.distance(aim.goal.point());
        !self.arrived.is_empty() && straight_m() >= self.best_m
    }

    /// Connects one of the guides to the tree, over all candidate parents.
    fn add_guide(&mut self, space: &impl Space, aim: &Aim<'_>, rng: &mut Rng) {
        let index = rng.below(self.guides.len());
        let Guide { pose, number } = self.guides[index];
        if self.is_useless(pose, aim) {
            self.guides.swap_remove(index);
            return;
        }
        let guide = space.stands().then_some(number);
        let before = self.nodes.len() as u32;
        self.collect(space, pose, before, guide);
        let Some(node) = self.connect(space, pose, guide) else { return };
        if guide.is_some() {
            // Nodes other than its parent may still be rerouted through it.
            self.collect(space, pose, before, None);
        }
        self.guides.swap_remove(index);
        self.guide_nodes.push(node);
        self.rewire(space, node);
        self.try_goal(space, node, aim.goal);
    }

    /// Fills `near` with the nodes numbered below `before`, except those known to be blocked from the guide, and
    /// computes their costs.
    fn collect(&mut self, space: &impl Space, pose: Pose2, before: u32, guide: Option<usize>) {
        self.near.clear();
        let (blocked, words) = (&self.blocked, self.words);
        let is_open =
            |node: &u32| guide.is_none_or(|g| blocked[*node as usize * words + g / 64] >> (g % 64) & 1 == 0);
        let open = (0..before).filter(is_open);
        self.near.extend(open.map(|node| Neighbour { node, cost_m: 0.0 }));
        self.price(space, pose);
    }

    /// Fills `near` with the nodes around `pose`, including `nearest`, and computes their costs.
    fn collect_near(&mut self, space: &impl Space, pose: Pose2, radius_m: f64, nearest: u32) {
        self.near.clear();
        let near = &mut self.near;
        self.grid.within(pose.point(), radius_m, |node| near.push(Neighbour { node, cost_m: 0.0 }));
        if !self.near.iter().any(|n| n.node == nearest) {
            self.near.push(Neighbour { node: nearest, cost_m: 0.0 });
        }
        self.price(space, pose);
    }

    /// Computes the costs to `pose` over each node of `near`, and drops nodes that cannot be part of a better path.
    fn price(&mut self, space: &impl Space, pose: Pose2) {
        let (nodes, best_m) = (&self.nodes, self.best_m);
        self.near.retain_mut(|n| {
            let node = &nodes[n.node as usize];
            if node.cost_m + node.pose.point().distance(pose.point()) >= best_m {
                return false;
            }
            n.cost_m = node.cost_m + space.length_m(node.pose, pose);
            n.cost_m < best_m
        });
    }

    /// Adds `pose` as a child of the cheapest node of `near` with a free path to it. Checks only as many paths as
    /// needed: usually the first few suffice, and the rest need not be sorted. `guide`: its index if all obstacles are
    /// static.
    fn connect(&mut self, space: &impl Space, pose: Pose2, guide: Option<usize>) -> Option<u32> {
        let by_cost = |a: &Neighbour, b: &Neighbour| a.cost_m.total_cmp(&b.cost_m).then(a.node.cmp(&b.node));
        for _ in 0..UNSORTED {
            let open = self.near.iter_mut().filter(|n| n.cost_m < f64::INFINITY);
            let cheapest = open.min_by(|a, b| by_cost(a, b))?;
            let Neighbour { node, cost_m } = *cheapest;
            cheapest.cost_m = f64::INFINITY;
            if self.is_free(space, node, pose, guide) {
                return Some(self.push(pose, node, cost_m));
            }
        }
        self.order.clear();
        self.order.extend(self.near.iter().filter(|n| n.cost_m < f64::INFINITY));
        self.order.sort_unstable_by(|a, b| by_cost(b, a));
        while let Some(Neighbour { node, cost_m }) = self.order.pop() {
            if self.is_free(space, node, pose, guide) {
                return Some(self.push(pose, node, cost_m));
            }
        }
        None
    }

    /// Returns true if the path from `node` to `pose` is free; a blocked path is recorded for the guide.
    fn is_free(&mut self, space: &impl Space, node: u32, pose: Pose2, guide: Option<usize>) -> bool {
        let from = &self.nodes[node as usize];
        let Some(guide) = guide else { return space.free(from.pose, pose, from.cost_m) };
        let (word, bit) = (&mut self.blocked[node as usize * self.words + guide / 64], 1 << (guide % 64));
        let is_free = *word & bit == 0 && space.free(from.pose, pose, from.cost_m);
        *word |= if is_free { 0 } else { bit };
        is_free
    }

    /// Reroutes nodes of `near` through `node` if that is shorter.
    fn rewire(&mut self, space: &impl Space, node: u32) {
        let Node { pose, cost_m, parent, .. } = self.nodes[node as usize];
        let mut lowered = false;
        for i in 0..self.near.len() {
            let other = self.near[i].node;
            let at = self.nodes[other as usize];
            let straight_m = pose.point().distance(at.pose.point());
            if other == parent || cost_m + straight_m >= at.cost_m - GAIN_M {
                continue;
            }
            let new_m = cost_m + space.length_m(pose, at.pose);
            if new_m < at.cost_m - GAIN_M && space.free(pose, at.pose, cost_m) {
                self.disown(other);
                self.adopt(node, other);
                self.lower(other, at.cost_m - new_m);
                lowered = true;
            }
        }
        if lowered {
            self.best_m = self.least_m();
        }
    }

    fn adopt(&mut self, parent: u32, child: u32) {
        let first = core::mem::replace(&mut self.nodes[parent as usize].first_child, child);
        let node = &mut self.nodes[child as usize];
        (node.parent, node.next_sibling) = (parent, first);
    }

    fn disown(&mut self, child: u32) {
        let Node { parent, next_sibling, .. } = self.nodes[child as usize];
        let mut at = self.nodes[parent as usize].first_child;
        if at == child {
            self.nodes[parent as usize].first_child = next_sibling;
            return;
        }
        while self.nodes[at as usize].next_sibling != child {
            at = self.nodes[at as usize].next_sibling;
        }
        self.nodes[at as usize].next_sibling = next_sibling;
    }

    /// Reduces the cost of `node` and its descendants by `by_m`.
    fn lower(&mut self, node: u32, by_m: f64) {
        self.stack.push(node);
        while let Some(at) = self.stack.pop() {
            self.nodes[at as usize].cost_m -= by_m;
            let mut child = self.nodes[at as usize].first_child;
            while child != NONE {
                self.stack.push(child);
                child = self.nodes[child as usize].next_sibling;
            }
        }
    }

    /// Records that `node` reaches the goal, if its path is shorter than all before.
    fn try_goal(&mut self, space: &impl Space, node: u32, goal: Pose2) {
        let Node { pose, cost_m, .. } = self.nodes[node as usize];
        let best_m = self.best_m;
        if cost_m + pose.point().distance(goal.point()) >= best_m - GAIN_M {
            return;
        }
        let last_m = space.length_m(pose, goal);
        if cost_m + last_m < best_m - GAIN_M && space.free(pose, goal, cost_m) {
            self.arrive(node, last_m);
        }
    }

    /// Records that `node` reaches the goal with a last piece of `last_m`.
    fn arrive(&mut self, node: u32, last_m: f64) {
        self.arrived.push((node, last_m));
        self.best_m = self.best_m.min(self.nodes[node as usize].cost_m + last_m);
    }

    /// Length of the best path, infinite before the first.
    pub fn best_m(&self) -> f64 {
        self.best_m
    }

    fn least_m(&self) -> f64 {
        self.arrived
            .iter()
            .fold(f64::INFINITY, |best, &(n, last)| best.min(self.nodes[n as usize].cost_m + last))
    }

    /// Poses of the best path from the start to its last node (the goal itself is not a node); removes that path, so
    /// that the next call returns the next best. `None` if there is no other.
    pub fn take_best(&mut self, poses: &mut Vec<Pose2>) -> Option<f64> {
        let nodes = &self.nodes;
        let cost = |&(node, last_m): &(u32, f64)| nodes[node as usize].cost_m + last_m;
        let best = (0..self.arrived.len())
            .min_by(|&a, &b| cost(&self.arrived[a]).total_cmp(&cost(&self.arrived[b])))?;
        let cost_m = cost(&self.arrived[best]);
        let (node, _) = self.arrived.swap_remove(best);
        poses.clear();
        let mut at = node;
        while at != NONE {
            poses.push(nodes[at as usize].pose);
            at = nodes[at as usize].parent;
        }
        poses.reverse();
        self.best_m = self.least_m();
        Some(cost_m)
    }
}
