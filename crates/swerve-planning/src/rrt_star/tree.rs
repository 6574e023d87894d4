//! The tree: grown towards random places, rewired to be short.

use swerve_core::Rng;
use swerve_geom::{Pose2, math};

use super::grid::Grid;
use crate::request::{Budget, Progress};

/// The space that the tree grows in: places, ways between them, obstacles.
pub trait Space {
    /// A place drawn at random.
    fn draw(&self, rng: &mut Rng) -> Pose2;
    /// Length of the way from place to place, obstacles or not, metres.
    fn length_m(&self, from: Pose2, to: Pose2) -> f64;
    /// The place `step_m` along the way, or its end where that is nearer.
    fn toward(&self, from: Pose2, to: Pose2, step_m: f64) -> Pose2;
    /// Whether the way is free when it begins after `travelled_m`.
    fn free(&self, from: Pose2, to: Pose2, travelled_m: f64) -> bool;
    /// Whether all stands, so that a way that is not free never will be.
    fn stands(&self) -> bool {
        false
    }
}

/// How the tree grows.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Growth {
    /// Longest extension, metres.
    pub step_m: f64,
    /// Iterations at most.
    pub iterations_max: u64,
    /// Share of iterations that aim at the goal.
    pub goal_share: f64,
    /// Share of iterations that aim at a guide: a place given beforehand where short ways are known to bend.
    pub guide_share: f64,
    /// `gamma` of the rewiring radius `sqrt(gamma / pi * ln n / n)`, m².
    pub gamma_m2: f64,
    /// Longest rewiring radius, metres.
    pub radius_max_m: f64,
    /// When it is over.
    pub until: Until,
}

/// When the growth is over.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Until {
    /// At the first node this near to the goal, metres: the original.
    Arrival(f64),
    /// When the iterations or the budget are used up. Nodes are joined to the goal itself, the way there is
    /// tried at once, and after the first path only places are drawn that can shorten it (J. D. Gammell,
    /// S. S. Srinivasa and T. D. Barfoot, "Informed RRT*", 2014).
    Spent,
}

/// From where to where the tree grows.
#[derive(Clone, Copy, Debug)]
pub struct Aim<'a> {
    /// The root.
    pub start: Pose2,
    /// The pose to reach.
    pub goal: Pose2,
    /// The tree lies within x_min, y_min, x_max, y_max, metres.
    pub bounds: [f64; 4],
    /// Places where short ways are known to bend.
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
    /// Length of the way from the root, metres.
    cost_m: f64,
}

/// A node that could be joined to another.
#[derive(Clone, Copy, Debug)]
struct Neighbour {
    node: u32,
    cost_m: f64,
}

/// A place where short ways are known to bend, not in the tree yet.
#[derive(Clone, Copy, Debug)]
struct Guide {
    pose: Pose2,
    /// Its bit in `blocked`.
    number: usize,
}

/// The tree and its memory, kept between calls.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    nodes: Vec<Node>,
    grid: Grid,
    near: Vec<Neighbour>,
    /// Those of `near` that are still to be tried, the cheapest last, where the first few do not do.
    order: Vec<Neighbour>,
    stack: Vec<u32>,
    /// Nodes with a free way to the goal, with its length.
    arrived: Vec<(u32, f64)>,
    /// Length of the best path, infinite before the first.
    best_m: f64,
    /// Guides that are not in the tree yet.
    guides: Vec<Guide>,
    /// Node x guide, in bits: ways that are known not to be free.
    blocked: Vec<u64>,
    /// Words of one node in `blocked`.
    words: usize,
    /// Guides that are.
    guide_nodes: Vec<u32>,
    /// Iterations of the newest growth.
    pub work: u64,
}

/// Draws of a place that could shorten the path before giving up on one that can.
const DRAWS_MAX: usize = 24;

/// So many of the cheapest ways are looked for one by one before the rest are sorted.
const UNSORTED: usize = 2;

/// Memory is reserved for so many iterations at most, however many there may be.
const RESERVED_MAX: u64 = 100_000;

/// A gain below this is none, metres.
const GAIN_M: f64 = 1e-9;

impl Tree {
    /// Grows a tree anew; whether the goal was reached.
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

    /// One iteration; whether the growth is over.
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

    /// A random place; once there is a path, one through which a shorter path could go.
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

    /// Whether even the straight way through `pose` is no shorter than the best path.
    fn is_useless(&self, pose: Pose2, aim: &Aim<'_>) -> bool {
        let p = pose.point();
        let straight_m = || aim.start.point().distance(p) + p.distance(aim.goal.point());
        !self.arrived.is_empty() && straight_m() >= self.best_m
    }

    /// Joins one of the guides to the tree, over all nodes it could be joined to.
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
            // Those that it is not joined to may still be led over it.
            self.collect(space, pose, before, None);
        }
        self.guides.swap_remove(index);
        self.guide_nodes.push(node);
        self.rewire(space, node);
        self.try_goal(space, node, aim.goal);
    }

    /// Fills `near` with the nodes numbered below `before` but for those that are known to be blocked from the guide, and
    /// prices them.
    fn collect(&mut self, space: &impl Space, pose: Pose2, before: u32, guide: Option<usize>) {
        self.near.clear();
        let (blocked, words) = (&self.blocked, self.words);
        let is_open =
            |node: &u32| guide.is_none_or(|g| blocked[*node as usize * words + g / 64] >> (g % 64) & 1 == 0);
        let open = (0..before).filter(is_open);
        self.near.extend(open.map(|node| Neighbour { node, cost_m: 0.0 }));
        self.price(space, pose);
    }

    /// Fills `near` with the nodes around `pose`, `nearest` among them, and prices them.
    fn collect_near(&mut self, space: &impl Space, pose: Pose2, radius_m: f64, nearest: u32) {
        self.near.clear();
        let near = &mut self.near;
        self.grid.within(pose.point(), radius_m, |node| near.push(Neighbour { node, cost_m: 0.0 }));
        if !self.near.iter().any(|n| n.node == nearest) {
            self.near.push(Neighbour { node: nearest, cost_m: 0.0 });
        }
        self.price(space, pose);
    }

    /// Prices the ways over each of `near` to `pose`, and drops those that cannot be part of a better path.
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

    /// Adds `pose` below the cheapest of `near` from which the way is free. Only as many ways are checked as needed:
    /// as a rule the first few are enough, and the rest need not be sorted. `guide`: its number where all stands.
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

    /// Whether the way from `node` to `pose` is free; that it is not is noted for the guide.
    fn is_free(&mut self, space: &impl Space, node: u32, pose: Pose2, guide: Option<usize>) -> bool {
        let from = &self.nodes[node as usize];
        let Some(guide) = guide else { return space.free(from.pose, pose, from.cost_m) };
        let (word, bit) = (&mut self.blocked[node as usize * self.words + guide / 64], 1 << (guide % 64));
        let is_free = *word & bit == 0 && space.free(from.pose, pose, from.cost_m);
        *word |= if is_free { 0 } else { bit };
        is_free
    }

    /// Leads nodes of `near` over `node` where that is shorter.
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

    /// Takes `by_m` off the cost of `node` and all below it.
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

    /// Notes that `node` reaches the goal, if it does by a shorter path than all before.
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

    /// Takes `node` for one that reaches the goal over another `last_m`.
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

    /// The poses of the best path from the start to its last node (the goal itself is not a node); forgets that
    /// path, so that the next call gives the next best. `None` when there is no other.
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
