//! Spatial index of the lanes of a map.

use swerve_geom::{FrenetPoint, Point2};

use crate::{Lane, LaneId, LanePlace, Map};

/// Smallest edge of a cell, metres: about a lane's width, so that the nearest line is in the cell of a point on a road
/// or beside it.
const CELL_M: f64 = 4.0;

/// Most cells, and most entries of pieces in cells, per piece; above, cells grow. Bounds the memory of maps that are
/// large and sparse.
const PER_PIECE: usize = 16;

/// Pieces are entered into cells this far beside them, too, metres: more than rounding errors of cell borders.
const MARGIN_M: f64 = 1e-6;

/// Static index of the centre lines of a map: the nearest lane to a point, as [`Map::nearest`], in time that does not
/// depend on the size of the map.
///
/// A uniform grid; each cell lists the straight pieces of lines that pass it. A query reads the cell of the point, then
/// the cells that a circle to the nearest piece found so far touches.
#[derive(Clone, PartialEq, Debug)]
pub struct LaneIndex {
    grid: Grid,
    /// First entry of each cell, row by row, and the number of all entries.
    begins: Vec<u32>,
    entries: Vec<Entry>,
    /// Pieces in order of lane and arc length.
    pieces: Vec<Piece>,
}

/// The piece that a query found, with which the next query for a point nearby begins. Every hint gives the same answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct LaneHint(Option<u32>);

/// A straight piece of a centre line.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Entry {
    from: Point2,
    /// To its end.
    along: [f64; 2],
    inverse_squared: f64,
    piece: u32,
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Piece {
    entry: Entry,
    lane: LaneId,
    /// Arc length at its begin, metres.
    s_m: f64,
    length_m: f64,
    is_first: bool,
    is_last: bool,
}

/// Nearest piece found so far.
#[derive(Clone, Copy)]
struct Best {
    squared: f64,
    piece: u32,
}

impl Best {
    const NONE: Self = Self { squared: f64::INFINITY, piece: u32::MAX };

    /// Takes a piece that is nearer, or as near and before it.
    #[inline]
    fn offer(&mut self, entry: &Entry, point: Point2) {
        let (x, y) = (point.x_m - entry.from.x_m, point.y_m - entry.from.y_m);
        let [dx, dy] = entry.along;
        let t = ((x * dx + y * dy) * entry.inverse_squared).clamp(0.0, 1.0);
        let (off_x, off_y) = (x - dx * t, y - dy * t);
        let squared = off_x * off_x + off_y * off_y;
        if squared < self.squared || (squared == self.squared && entry.piece < self.piece) {
            *self = Self { squared, piece: entry.piece };
        }
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Grid {
    low: Point2,
    cell_m: f64,
    /// Cells per metre.
    per_m: f64,
    columns: usize,
    rows: usize,
}

impl Grid {
    fn new(low: Point2, high: Point2, cell_m: f64) -> Self {
        let count = |extent_m: f64| ((extent_m / cell_m).floor() as usize).saturating_add(1);
        Self {
            low,
            cell_m,
            per_m: 1.0 / cell_m,
            columns: count(high.x_m - low.x_m),
            rows: count(high.y_m - low.y_m),
        }
    }

    /// Column of a coordinate, the first or last beyond the grid.
    #[inline]
    fn column(&self, x_m: f64) -> usize {
        (((x_m - self.low.x_m) * self.per_m).max(0.0) as usize).min(self.columns - 1)
    }

    #[inline]
    fn row(&self, y_m: f64) -> usize {
        (((y_m - self.low.y_m) * self.per_m).max(0.0) as usize).min(self.rows - 1)
    }

    /// Calls `visit` with each row that a piece passes, and its columns there.
    fn passed(&self, entry: &Entry, mut visit: impl FnMut(usize, usize, usize)) {
        let (from, [dx, dy]) = (entry.from, entry.along);
        let (low_y, high_y) = (from.y_m.min(from.y_m + dy), from.y_m.max(from.y_m + dy));
        for row in self.row(low_y - MARGIN_M)..=self.row(high_y + MARGIN_M) {
            let begin_y = self.low.y_m + row as f64 * self.cell_m;
            // Share of the piece within the row.
            let share = |y: f64| if dy == 0.0 { None } else { Some(((y - from.y_m) / dy).clamp(0.0, 1.0)) };
            let ends = (share(begin_y - MARGIN_M), share(begin_y + self.cell_m + MARGIN_M));
            let (a, b) = if let (Some(a), Some(b)) = ends { (a, b) } else { (0.0, 1.0) };
            let (a_x, b_x) = (from.x_m + dx * a, from.x_m + dx * b);
            visit(row, self.column(a_x.min(b_x) - MARGIN_M), self.column(a_x.max(b_x) + MARGIN_M));
        }
    }
}

impl LaneIndex {
    /// Creates an index of all lanes.
    pub fn new(map: &Map) -> Self {
        Self::of(map, |_| true)
    }

    /// Creates an index of those lanes for which `keep` is true.
    pub fn of(map: &Map, keep: impl Fn(&Lane) -> bool) -> Self {
        let mut pieces = Vec::new();
        map.lanes().iter().filter(|lane| keep(lane)).for_each(|lane| add_pieces(&mut pieces, lane));
        let mut bounds =
            [Point2::new(f64::INFINITY, f64::INFINITY), Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY)];
        for Entry { from, along: [dx, dy], .. } in pieces.iter().map(|piece: &Piece| piece.entry) {
            for (x, y) in [(from.x_m, from.y_m), (from.x_m + dx, from.y_m + dy)] {
                bounds[0] = Point2::new(bounds[0].x_m.min(x), bounds[0].y_m.min(y));
                bounds[1] = Point2::new(bounds[1].x_m.max(x), bounds[1].y_m.max(y));
            }
        }
        if pieces.is_empty() {
            bounds = [Point2::new(0.0, 0.0); 2];
        }
        let (grid, counts) = sized(&pieces, bounds);
        let mut begins = Vec::with_capacity(counts.len() + 1);
        let mut sum = 0;
        for count in counts {
            begins.push(sum);
            sum += count;
        }
        begins.push(sum);
        let blank = Entry { from: grid.low, along: [0.0; 2], inverse_squared: 0.0, piece: 0 };
        let mut entries = vec![blank; sum as usize];
        let mut next = begins.clone();
        for piece in &pieces {
            grid.passed(&piece.entry, |row, first, last| {
                for cell in row * grid.columns + first..=row * grid.columns + last {
                    entries[next[cell] as usize] = piece.entry;
                    next[cell] += 1;
                }
            });
        }
        Self { grid, begins, entries, pieces }
    }

    /// Lane with the nearest centre line to a point, at any distance; the first of equally near ones. Lines end at
    /// their ends; the place on the nearest one is extended beyond them, as by `Polyline::project`. `None` only for an
    /// index without lanes.
    pub fn nearest(&self, point: Point2) -> Option<LanePlace> {
        self.nearest_from(point, &mut LaneHint::default())
    }

    /// As [`nearest`](Self::nearest), for a point near that of the last query: the same answer, sooner.
    pub fn nearest_from(&self, point: Point2, hint: &mut LaneHint) -> Option<LanePlace> {
        let mut best = Best::NONE;
        let mut read = usize::MAX;
        if let Some(at) = hint.0.map(|at| at as usize).filter(|at| *at < self.pieces.len()) {
            let beside = &self.pieces[at.saturating_sub(1)..(at + 2).min(self.pieces.len())];
            beside.iter().for_each(|piece| best.offer(&piece.entry, point));
        } else {
            read = self.around(point, &mut best);
        }
        self.within(point, read, &mut best);
        let piece = self.pieces.get(best.piece as usize)?;
        *hint = LaneHint(Some(best.piece));
        Some(LanePlace { lane: piece.lane, place: piece.place(point) })
    }

    fn scan(&self, cells: std::ops::Range<usize>, point: Point2, best: &mut Best) {
        let range = self.begins[cells.start] as usize..self.begins[cells.end] as usize;
        self.entries[range].iter().for_each(|entry| best.offer(entry, point));
    }

    /// Some piece near the point: the nearest of the first ring of cells around it that is not empty. Returns the cell
    /// of the point.
    fn around(&self, point: Point2, best: &mut Best) -> usize {
        let Grid { columns, rows, .. } = self.grid;
        let (column, row) = (self.grid.column(point.x_m), self.grid.row(point.y_m));
        let first = row * columns + column;
        self.scan(first..first + 1, point, best);
        let mut ring = 1;
        while best.piece == u32::MAX && ring <= columns.max(rows) {
            let (left, right) = (column.saturating_sub(ring), (column + ring).min(columns - 1));
            for other in row.saturating_sub(ring)..=(row + ring).min(rows - 1) {
                let at = other * columns;
                if other.abs_diff(row) == ring {
                    self.scan(at + left..at + right + 1, point, best);
                    continue;
                }
                for end in [column.checked_sub(ring), Some(column + ring).filter(|end| *end < columns)] {
                    end.into_iter().for_each(|end| self.scan(at + end..at + end + 1, point, best));
                }
            }
            ring += 1;
        }
        first
    }

    /// Nearest piece within the circle to the best one. The cell `read` has been read.
    fn within(&self, point: Point2, read: usize, best: &mut Best) {
        let circle_m = |best: &Best| best.squared.sqrt() + MARGIN_M;
        let reach_m = circle_m(best);
        let rows = self.grid.row(point.y_m - reach_m)..=self.grid.row(point.y_m + reach_m);
        for row in rows {
            let below = self.grid.low.y_m + row as f64 * self.grid.cell_m;
            let off_m = (below - point.y_m).max(point.y_m - below - self.grid.cell_m).max(0.0);
            let reach_m = circle_m(best);
            let half_m = (reach_m * reach_m - off_m * off_m).max(0.0).sqrt();
            if off_m > reach_m {
                continue;
            }
            let first = row * self.grid.columns + self.grid.column(point.x_m - half_m);
            let last = row * self.grid.columns + self.grid.column(point.x_m + half_m);
            if (first..=last).contains(&read) {
                self.scan(first..read, point, best);
                self.scan(read + 1..last + 1, point, best);
            } else {
                self.scan(first..last + 1, point, best);
            }
        }
    }
}

/// Grid of a size that the pieces justify, and the number of entries of each cell.
fn sized(pieces: &[Piece], [low, high]: [Point2; 2]) -> (Grid, Vec<u32>) {
    let most = PER_PIECE * pieces.len() + 4096;
    let mut cell_m = CELL_M;
    loop {
        let grid = Grid::new(low, high, cell_m);
        cell_m *= 1.5;
        if grid.columns.saturating_mul(grid.rows) > most {
            continue;
        }
        let mut counts = vec![0_u32; grid.columns * grid.rows];
        let mut sum = 0;
        for piece in pieces {
            grid.passed(&piece.entry, |row, first, last| {
                sum += last + 1 - first;
                if sum <= most {
                    let cells = row * grid.columns + first..=row * grid.columns + last;
                    counts[cells].iter_mut().for_each(|count| *count += 1);
                }
            });
        }
        if sum <= most {
            return (grid, counts);
        }
    }
}

fn add_pieces(pieces: &mut Vec<Piece>, lane: &Lane) {
    let points = lane.line.points();
    let mut s_m = 0.0;
    for (k, two) in points.windows(2).enumerate() {
        let along = two[1] - two[0];
        let squared = along.norm_squared();
        let entry = Entry {
            from: two[0],
            along: [along.x, along.y],
            inverse_squared: 1.0 / squared,
            piece: pieces.len() as u32,
        };
        let length_m = squared.sqrt();
        let (is_first, is_last) = (k == 0, k + 2 == points.len());
        pieces.push(Piece { entry, lane: lane.id, s_m, length_m, is_first, is_last });
        s_m += length_m;
    }
}

impl Piece {
    /// Position of a point beside the piece; end pieces go on straight, as in `Polyline::project`.
    fn place(&self, point: Point2) -> FrenetPoint {
        let Entry { from, along: [dx, dy], inverse_squared, .. } = self.entry;
        let (x, y) = (point.x_m - from.x_m, point.y_m - from.y_m);
        let low = if self.is_first { f64::NEG_INFINITY } else { 0.0 };
        let high = if self.is_last { f64::INFINITY } else { 1.0 };
        let t = ((x * dx + y * dy) * inverse_squared).clamp(low, high);
        let (off_x, off_y) = (x - dx * t, y - dy * t);
        let side = if dx * y - dy * x < 0.0 { -1.0 } else { 1.0 };
        FrenetPoint { s_m: self.s_m + t * self.length_m, d_m: side * (off_x * off_x + off_y * off_y).sqrt() }
    }
}

#[cfg(test)]
mod tests;
