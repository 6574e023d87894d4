//! Clusters: connected components of points above the ground.
//!
//! Connected components of the occupied cells of a grid, O(n) in points and cells. Points a given gap apart may belong
//! to one object or to two, so components are computed at several gaps, from fine to coarse, and the scores of their
//! boxes choose between a whole and its parts.

use super::ground::Bins;
use super::points::Point;

/// Side of a grid cell, metres.
pub(super) const CELL_M: f32 = 0.2;
/// Height above the ground up to which points connect cells, metres: tree crowns and lamp arms overhang cars.
const JOINED_M: f32 = 2.0;
/// Height above the ground above which points are ignored, metres.
const TOP_M: f32 = 4.5;
/// Gaps bridged by components: largest squared distance between two cells, in cells.
const GAPS: [i32; 4] = [1, 2, 5, 13];
/// Largest side of a cluster's bounding box, metres; larger ones are buildings.
const LONGEST_M: f32 = 14.0;

/// Occupied grid cell.
#[derive(Clone, Copy, Debug)]
struct Cell {
    x: i32,
    y: i32,
    /// First of its points in `Clusters::points`.
    first: u32,
    count: u32,
    /// Height of its highest point above the ground, metres.
    top_m: f32,
}

/// Connected component at some gap.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Cluster {
    first: usize,
    count: usize,
    /// Height of its highest point above the ground, metres.
    pub(super) top_m: f32,
}

/// Clusters of one sweep; reuses its buffers.
#[derive(Clone, Debug)]
pub(super) struct Clusters {
    cells_across: i32,
    points_min: usize,
    /// Index into `cells` plus one for each grid cell, or zero.
    grid: Vec<u32>,
    /// Number of ground points of each grid cell.
    floor: Vec<u16>,
    cells: Vec<Cell>,
    /// Points above the ground that connect cells, sorted by cell: position, and height above the ground.
    points: Vec<[f32; 4]>,
    roots: Vec<u32>,
    /// Component number of each root, from one.
    numbers: Vec<u32>,
    bins: Bins,
    /// Points of all clusters.
    members: Vec<[f32; 4]>,
    pub(super) found: Vec<Cluster>,
}

impl Clusters {
    pub(super) fn new(reach_m: f32, points_min: usize) -> Self {
        let cells_across = (2.0 * reach_m / CELL_M).ceil() as i32 + 1;
        let all = (cells_across * cells_across) as usize;
        Self {
            cells_across,
            points_min,
            grid: vec![0; all],
            floor: vec![0; all],
            cells: Vec::new(),
            points: Vec::new(),
            roots: Vec::new(),
            numbers: Vec::new(),
            bins: Bins::default(),
            members: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Points of a cluster: position in the ego frame, and height above the ground, metres.
    pub(super) fn of(&self, cluster: Cluster) -> &[[f32; 4]] {
        &self.members[cluster.first..cluster.first + cluster.count]
    }

    /// Finds the clusters of a sweep, finest gaps first.
    pub(super) fn find(&mut self, places: &[Point], over_m: &[f32]) {
        self.occupy(places, over_m);
        self.roots.clear();
        self.roots.extend(0..self.cells.len() as u32);
        self.members.clear();
        self.found.clear();
        let mut before = 0;
        for gap in GAPS {
            self.join(before, gap);
            self.gather(before == 0);
            before = gap;
        }
    }

    fn index(&self, x: f32, y: f32) -> Option<usize> {
        let half = self.cells_across / 2;
        let [x, y] = [x, y].map(|m| (m / CELL_M).floor() as i32 + half);
        self.slot(x, y)
    }

    fn slot(&self, x: i32, y: i32) -> Option<usize> {
        let within = 0..self.cells_across;
        (within.contains(&x) && within.contains(&y)).then(|| (y * self.cells_across + x) as usize)
    }

    /// Assigns the points to cells.
    fn occupy(&mut self, places: &[Point], over_m: &[f32]) {
        for cell in &self.cells {
            self.grid[(cell.y * self.cells_across + cell.x) as usize] = 0;
        }
        self.floor.fill(0);
        self.cells.clear();
        self.roots.clear();
        for (&[x, y, _], &over) in places.iter().zip(over_m) {
            let Some(slot) = self.index(x, y).filter(|_| over <= TOP_M) else { continue };
            if over == 0.0 {
                self.floor[slot] = self.floor[slot].saturating_add(1);
                continue;
            }
            if self.grid[slot] == 0 && over <= JOINED_M {
                let (x, y) = (slot as i32 % self.cells_across, slot as i32 / self.cells_across);
                self.cells.push(Cell { x, y, first: 0, count: 0, top_m: over });
                self.grid[slot] = self.cells.len() as u32;
            }
        }
        let mut bins = core::mem::take(&mut self.bins);
        let of = |k: usize| {
            let [x, y, _] = places[k];
            let is_one = over_m[k] > 0.0 && over_m[k] <= TOP_M;
            self.index(x, y).filter(|_| is_one).map_or(0, |slot| self.grid[slot] as usize)
        };
        bins.fill(self.cells.len() + 1, places.len(), of);
        self.points.clear();
        for (k, cell) in self.cells.iter_mut().enumerate() {
            cell.first = self.points.len() as u32;
            for &point in bins.of(k + 1) {
                let ([x, y, z], over) = (places[point as usize], over_m[point as usize]);
                cell.top_m = cell.top_m.max(over);
                if over <= JOINED_M {
                    self.points.push([x, y, z, over]);
                }
            }
            cell.count = self.points.len() as u32 - cell.first;
        }
        self.bins = bins;
    }

    /// Joins cells with a squared distance above `beyond` and up to `gap`.
    fn join(&mut self, beyond: i32, gap: i32) {
        let reach = (1..).take_while(|k| k * k <= gap).last().unwrap_or(0);
        for dy in 0..=reach {
            for dx in -reach..=reach {
                let squared = dx * dx + dy * dy;
                if squared <= beyond || squared > gap || (dy == 0 && dx <= 0) {
                    continue;
                }
                for k in 0..self.cells.len() {
                    let Cell { x, y, .. } = self.cells[k];
                    let other = self.slot(x + dx, y + dy).map_or(0, |slot| self.grid[slot]);
                    if other > 0 {
                        let [a, b] = [root(&mut self.roots, k as u32), root(&mut self.roots, other - 1)];
                        self.roots[a.max(b) as usize] = a.min(b);
                    }
                }
            }
        }
    }

    /// Adds the components of this gap to the clusters, except those already found at a finer gap.
    fn gather(&mut self, is_first: bool) {
        let count = self.cells.len();
        self.numbers.resize(count, 0);
        let mut components = 0;
        for k in 0..count as u32 {
            let root = root(&mut self.roots, k) as usize;
            // Roots are the smallest index of their component, so they come first.
            if root == k as usize {
                components += 1;
                self.numbers[root] = components;
            } else {
                self.numbers[k as usize] = self.numbers[root];
            }
        }
        let Self { bins, numbers, .. } = self;
        bins.fill(components as usize, count, |k| numbers[k] as usize - 1);
        let finer = if is_first { 0 } else { self.found.len() };
        for component in 0..components as usize {
            self.keep(component, finer);
        }
    }

    fn keep(&mut self, component: usize, finer: usize) {
        let of = self.bins.of(component);
        let cells = || of.iter().map(|&k| self.cells[k as usize]);
        let count: usize = cells().map(|cell| cell.count as usize).sum();
        let ends = cells().fold([i32::MAX, i32::MAX, i32::MIN, i32::MIN], |[a, b, c, d], cell| {
            [a.min(cell.x), b.min(cell.y), c.max(cell.x), d.max(cell.y)]
        });
        let longest = (ends[2] - ends[0]).max(ends[3] - ends[1]);
        if count < self.points_min || longest as f32 * CELL_M > LONGEST_M {
            return;
        }
        let first = self.members.len();
        let mut top_m = 0.0_f32;
        for &k in of {
            let cell = self.cells[k as usize];
            top_m = top_m.max(cell.top_m);
            let begin = cell.first as usize;
            self.members.extend_from_slice(&self.points[begin..begin + cell.count as usize]);
        }
        // Components with the same points have the same first point.
        let same = |other: &Cluster| other.count == count && self.members[other.first] == self.members[first];
        if self.found[..finer].iter().any(same) {
            self.members.truncate(first);
        } else {
            self.found.push(Cluster { first, count, top_m });
        }
    }

    /// Number of points above and on the ground in a rectangle, given by its centre, the cosine and sine of its
    /// heading, and half its sides.
    pub(super) fn inside(&self, middle: [f32; 2], [cos, sin]: [f32; 2], half: [f32; 2]) -> [f32; 2] {
        let reach = [half[0] * cos.abs() + half[1] * sin.abs(), half[0] * sin.abs() + half[1] * cos.abs()];
        let shift = self.cells_across / 2;
        let cell = |m: f32| (m / CELL_M).floor() as i32 + shift;
        let mut sums = [0.0; 2];
        for y in cell(middle[1] - reach[1])..=cell(middle[1] + reach[1]) {
            for x in cell(middle[0] - reach[0])..=cell(middle[0] + reach[0]) {
                let [dx, dy] =
                    [(x, middle[0]), (y, middle[1])].map(|(k, m)| ((k - shift) as f32 + 0.5) * CELL_M - m);
                let [along, across] = [dx * cos + dy * sin, dy * cos - dx * sin];
                let Some(slot) =
                    self.slot(x, y).filter(|_| along.abs() <= half[0] && across.abs() <= half[1])
                else {
                    continue;
                };
                if let Some(cell) = (self.grid[slot] as usize).checked_sub(1) {
                    sums[0] += self.cells[cell].count as f32;
                }
                sums[1] += f32::from(self.floor[slot]);
            }
        }
        sums
    }
}

/// Root of a component, with path halving.
fn root(roots: &mut [u32], mut k: u32) -> u32 {
    while roots[k as usize] != k {
        roots[k as usize] = roots[roots[k as usize] as usize];
        k = roots[k as usize];
    }
    k
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a rectangle's outline, 0.1 m apart.
    fn outline(x: f32, y: f32, length: f32, width: f32) -> Vec<Point> {
        let (n, m) = ((length * 10.0) as i32, (width * 10.0) as i32);
        let along = (0..n).flat_map(|k| [[x + 0.1 * k as f32, y, 0.5], [x + 0.1 * k as f32, y + width, 0.5]]);
        let across =
            (0..m).flat_map(|k| [[x, y + 0.1 * k as f32, 0.5], [x + length, y + 0.1 * k as f32, 0.5]]);
        along.chain(across).collect()
    }

    fn sizes(places: &[Point]) -> Vec<usize> {
        let mut clusters = Clusters::new(30.0, 5);
        let over = vec![0.5; places.len()];
        clusters.find(places, &over);
        clusters.find(places, &over);
        clusters.found.iter().map(|found| clusters.of(*found).len()).collect()
    }

    #[test]
    fn clusters_include_the_parts_and_the_whole_across_a_gap() {
        let (car, near, far) =
            (outline(5.0, 2.0, 4.0, 1.8), outline(9.55, 2.0, 4.0, 1.8), outline(12.0, -8.0, 4.0, 1.8));
        assert_eq!(sizes(&car), [116]);
        assert_eq!(sizes(&[car.clone(), far].concat()), [116, 116]);
        assert_eq!(sizes(&[car, near].concat()), [116, 116, 232], "0.55 m apart");
    }

    #[test]
    fn clusters_exclude_few_points_and_buildings() {
        assert!(sizes(&outline(5.0, 2.0, 0.2, 0.1)[..4]).is_empty());
        assert!(sizes(&outline(-10.0, 2.0, 20.0, 1.8)).is_empty());
        assert!(sizes(&[]).is_empty());
        assert_eq!(sizes(&vec![[1.0, 1.0, 1.0]; 1000]), [1000]);
    }
}
