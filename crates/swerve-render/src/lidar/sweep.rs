//! A lidar that turns: fires the columns of one step of the world at a time.

use core::ops::Range;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require};
use swerve_geom::{Lidar, Map, Transform, math};
use wide::f32x8;

use super::bvh::LANES;
use super::cloud::{Cloud, CloudMut, CloudSizeError, Point};
use super::compute::{Compute, Under};
use super::returns::Receiver;
use super::scene_tree::flat::Moment;
use super::scene_tree::{RayMemory, SceneTree};
use super::spec::LidarSpec;
use crate::gpu::Gpu;
use crate::gpu::lidar::Flight;

/// One piece of a turn: a step of the world, and where the sensor is at its begin and end.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Firing {
    /// Begin of the step, nanoseconds since the turn's first column; negative if the turn begins within the step.
    pub begin_ns: i64,
    /// The sensor's pose then.
    pub begin: Transform<Map, Lidar>,
    /// End of the step, nanoseconds since the turn's first column: its columns are fired before.
    pub end_ns: i64,
    /// The sensor's pose then.
    pub end: Transform<Map, Lidar>,
    /// The instance id that this lidar does not see: the vehicle that carries it.
    pub hidden_instance: Option<u32>,
}

impl Firing {
    /// A whole turn of a sensor at rest.
    pub fn turn_at_rest(sweeper: &Sweeper, map_from_lidar: Transform<Map, Lidar>) -> Self {
        let (begin, end) = (map_from_lidar, map_from_lidar);
        Self { begin_ns: 0, begin, end_ns: sweeper.period_ns(), end, hidden_instance: None }
    }
}

/// What a piece of a turn did.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Fired {
    /// Columns that were fired.
    pub columns: Range<u32>,
    /// Whether the last column of the turn was among them.
    pub is_complete: bool,
}

/// A piece of a turn could not be fired.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FireError {
    /// The points have no room in the caller's memory.
    #[error(transparent)]
    CloudSize(#[from] CloudSizeError),
    /// A pose is not finite or beyond all maps.
    #[error("the lidar's pose at the {when} of the step is not finite or beyond 10000 km")]
    Pose {
        /// `begin` or `end`.
        when: &'static str,
    },
    /// A step ends before it begins.
    #[error("the step ends {by_ns} ns before it begins")]
    Backwards {
        /// By how much.
        by_ns: u64,
    },
}

/// What casts the rays of a lidar.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LidarEngine {
    /// The trees in this crate: always there; the same bytes on every x86-64 machine and thread count.
    #[default]
    Cpu,
    /// A compute shader over the same trees: the same points up to rounding, see [`Sweeper`].
    Gpu,
}

impl LidarEngine {
    /// Name in configurations and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        }
    }

    /// Whether the same scene gives the same bytes on any machine.
    pub fn is_portable(self) -> bool {
        self == Self::Cpu
    }
}

/// A lidar that turns.
///
/// **Engines.** [`Sweeper::new`] casts the rays on the CPU, which is the reference: the same bytes everywhere.
/// [`Sweeper::on_gpu`] sends them to a GPU, whole turns at a time: the same trees, the same noise for the same shot, each column in
/// the world of its own step; points differ by rounding alone, and now and then a ray goes by the other side of
/// an edge. When it pays: a turn costs the GPU some tenths of a millisecond, most of them for the way there and
/// back, whatever its size; one core casts millions of rays per second. So a small lidar at 10 Hz is best left
/// where the bytes are portable; with 64 beams and more, with several lidars on a car, or where data sets are made
/// as fast as can be, the GPU takes the rays off the cores: fastest with [`Sweeper::submit`] and
/// [`Sweeper::collect`], where the way there and back is hidden. On an adapter that is software (llvmpipe) it never
/// pays: it is for tests.
///
/// When the GPU fails, the turn that is under way is fired by the CPU, nothing of it is missing, and the CPU goes
/// on: [`Sweeper::engine`] and [`Sweeper::fallback`] tell.
pub struct Sweeper {
    spec: LidarSpec,
    period_ns: i64,
    /// Directions of the beams in a column at azimuth 0.
    beams: Vec<[f32; 3]>,
    columns: Vec<Column>,
    pool: Option<rayon::ThreadPool>,
    shots: Vec<Shot>,
    turn: u64,
    compute: Option<Box<Compute>>,
    fallback: Option<String>,
    submitted: VecDeque<Submitted>,
    spare: Vec<Cloud>,
}

/// Columns on their way.
struct Submitted {
    columns: Range<u32>,
    way: Way,
}

/// Where they are.
enum Way {
    /// On a GPU, with what the CPU needs should it be lost.
    There { flight: Box<Flight>, firing: Box<Firing>, moment: Box<Moment>, receiver: Receiver },
    /// Their points are here.
    Here(Cloud),
}

/// A column of a turn.
#[derive(Clone, Copy, Debug)]
struct Column {
    /// Sine and cosine of its azimuth.
    azimuth: [f64; 2],
    /// When it is fired, since the first.
    at_ns: i64,
    offset_s: f32,
}

/// What came back of one shot.
#[derive(Clone, Copy, Debug, Default)]
struct Shot {
    at_m: [f32; 3],
    intensity: f32,
    instance: u32,
    class: u8,
    is_seen: bool,
}

/// Nanoseconds of a second.
const SECOND_NS: f64 = 1e9;
/// Most threads of a lidar.
const THREADS_MAX: usize = 256;
/// No sensor is farther from the origin of the map, metres.
const REACH_MAX_M: f64 = 1e7;

impl Sweeper {
    /// Checks a description; its columns are shared out to `threads` threads, of which the caller's is one.
    ///
    /// # Errors
    /// The first field that no lidar can have, and threads that cannot be started.
    pub fn new(spec: LidarSpec, threads: usize) -> Result<Self, ParamError> {
        spec.check()?;
        let period_ns = (SECOND_NS / spec.rate_hz).round() as i64;
        let beams = spec.beams.iter().map(|beam| {
            let (sin_elevation, cos_elevation) = math::sin_cos(beam.elevation_rad);
            let (sin_azimuth, cos_azimuth) = math::sin_cos(beam.azimuth_rad);
            [cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation].map(|x| x as f32)
        });
        let turn_rad = if spec.is_clockwise { -1.0 } else { 1.0 } * 2.0 * core::f64::consts::PI;
        let columns = (0..spec.columns).map(|k| {
            let share = f64::from(k) / f64::from(spec.columns);
            let (sin, cos) = math::sin_cos(spec.first_azimuth_rad + turn_rad * share);
            let at_ns = column_ns(k, period_ns, spec.columns);
            Column { azimuth: [sin, cos], at_ns, offset_s: (at_ns as f64 / SECOND_NS) as f32 }
        });
        let (beams, columns) = (beams.collect(), columns.collect());
        let pool = if threads > 1 { Some(start(threads - 1)?) } else { None };
        Ok(Self {
            spec,
            period_ns,
            beams,
            columns,
            pool,
            shots: Vec::new(),
            turn: 0,
            compute: None,
            fallback: None,
            submitted: VecDeque::new(),
            spare: Vec::new(),
        })
    }

    /// As [`Self::new`], with the rays on a GPU. `threads` are for the CPU, should the GPU be lost.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn on_gpu(spec: LidarSpec, threads: usize, gpu: &Arc<Gpu>) -> Result<Self, ParamError> {
        let mut sweeper = Self::new(spec, threads)?;
        sweeper.compute = Some(Box::new(Compute::new(gpu, &sweeper.beams)));
        Ok(sweeper)
    }

    /// What casts its rays now.
    pub fn engine(&self) -> LidarEngine {
        if self.compute.is_some() { LidarEngine::Gpu } else { LidarEngine::Cpu }
    }

    /// Why the CPU casts the rays of a lidar that was to be on a GPU; `None` while nothing happened.
    pub fn fallback(&self) -> Option<&str> {
        self.fallback.as_deref()
    }

    /// What it was made from.
    pub fn spec(&self) -> &LidarSpec {
        &self.spec
    }

    /// Most points of a turn.
    pub fn points_max(&self) -> usize {
        self.beams.len() * self.columns.len()
    }

    /// Time of a turn, nanoseconds.
    pub fn period_ns(&self) -> i64 {
        self.period_ns
    }

    /// When a column of a turn is fired, nanoseconds since the first.
    pub fn column_ns(&self, column: u32) -> i64 {
        column_ns(column, self.period_ns, self.spec.columns)
    }

    /// The columns of a turn whose instants are in `[begin_ns, end_ns)`: pieces that follow each other miss none.
    pub fn columns_between(&self, begin_ns: i64, end_ns: i64) -> Range<u32> {
        let (period, columns) = (i128::from(self.period_ns), i128::from(self.spec.columns));
        // The first column that is fired no earlier than an instant t is that with k period / columns >= t.
        let from = |at_ns: i64| {
            let at = i128::from(at_ns.clamp(0, self.period_ns));
            let k = ((at * columns) / period).clamp(0, columns);
            let late = |k: i128| k >= columns || k * period / columns >= i128::from(at_ns);
            if late(k) { k } else { k + 1 }
        };
        let first = from(begin_ns) as u32;
        first..(from(end_ns) as u32).max(first)
    }

    /// Begins a turn: empties the cloud and keys the noise by the turn's number.
    pub fn begin_turn(&mut self, turn: u64, out: &mut CloudMut<'_>) {
        self.turn = turn;
        *out.len = 0;
        if let Some(compute) = &mut self.compute {
            compute.drop_pieces();
        }
    }

    /// Fires the columns of one step and adds their points, by column and then by beam.
    ///
    /// On a GPU the columns of a turn go together: their points are added by the call that completes the turn, or
    /// that comes with another weather, hidden instance or static part than those before it. All calls of a turn
    /// take the same memory.
    ///
    /// # Errors
    /// Arrays without room, poses that are not finite, a step that ends before it begins; nothing is added then.
    pub fn fire(
        &mut self,
        tree: &SceneTree,
        firing: &Firing,
        out: &mut CloudMut<'_>,
    ) -> Result<Fired, FireError> {
        check(firing)?;
        let columns = self.columns_between(firing.begin_ns, firing.end_ns);
        let waiting = self.compute.as_ref().map_or(0, |compute| compute.columns_waiting());
        out.check((columns.len() + waiting) * self.beams.len())?;
        let is_complete = !columns.is_empty() && columns.end == self.spec.columns;
        let receiver = Receiver::new(&self.spec, tree.weather(), self.turn);
        match self.compute.take() {
            None => self.fire_here(tree, (firing, &columns), receiver, out),
            Some(compute) if columns.is_empty() => self.compute = Some(compute),
            Some(compute) => {
                let under = Under { receiver, hidden: firing.hidden_instance };
                self.fire_there(compute, tree, (firing, &columns), under, out);
            }
        }
        Ok(Fired { columns, is_complete })
    }

    /// Has columns wait, and fires all that wait on the GPU when they complete the turn; on the CPU if it fails.
    fn fire_there(
        &mut self,
        mut compute: Box<Compute>,
        tree: &SceneTree,
        (firing, columns): (&Firing, &Range<u32>),
        under: Under,
        out: &mut CloudMut<'_>,
    ) {
        if compute.is_apart(tree, &under)
            && let Err(why) = compute.flush(self, out)
        {
            compute.fire_without(self, tree, out);
            self.fallback = Some(why);
            return self.fire_here(tree, (firing, columns), under.receiver, out);
        }
        compute.add(self, tree, under, (firing, columns));
        if columns.end < self.spec.columns {
            self.compute = Some(compute);
            return;
        }
        match compute.flush(self, out) {
            Ok(()) => self.compute = Some(compute),
            Err(why) => {
                compute.fire_without(self, tree, out);
                self.fallback = Some(why);
            }
        }
    }

    /// Sends the columns of one step on their way; [`Self::collect`] gives their points. So a GPU casts the rays of
    /// one call while the points of an earlier one are taken over; two on their way at a time are enough for that.
    ///
    /// The points are those of [`Self::begin_turn`] with this turn and [`Self::fire`]. Pieces of a turn of the latter
    /// that are not complete are forgotten. On the CPU the rays are cast at once.
    ///
    /// # Errors
    /// As [`Self::fire`]; nothing is on its way then.
    pub fn submit(&mut self, turn: u64, tree: &SceneTree, firing: &Firing) -> Result<Fired, FireError> {
        check(firing)?;
        let columns = self.columns_between(firing.begin_ns, firing.end_ns);
        let is_complete = !columns.is_empty() && columns.end == self.spec.columns;
        let receiver = Receiver::new(&self.spec, tree.weather(), turn);
        let flight = if columns.is_empty() { None } else { self.launch(tree, (firing, &columns), receiver) };
        let way = match flight {
            None => self.here(tree, (firing, &columns), receiver),
            Some(flight) => {
                let mut moment = Box::<Moment>::default();
                tree.moment(&mut moment);
                Way::There { flight, firing: Box::new(*firing), moment, receiver }
            }
        };
        self.submitted.push_back(Submitted { columns: columns.clone(), way });
        Ok(Fired { columns, is_complete })
    }

    /// Waits for the columns that were submitted first, and adds their points; `None` if none are on their way.
    ///
    /// `tree` is for the CPU, should the GPU be lost: what never moves has to be as it was when they were submitted;
    /// what moves is remembered.
    ///
    /// # Errors
    /// Arrays without room: nothing is added then, and the columns are still on their way.
    pub fn collect(
        &mut self,
        tree: &SceneTree,
        out: &mut CloudMut<'_>,
    ) -> Result<Option<Range<u32>>, FireError> {
        let Some(first) = self.submitted.front() else { return Ok(None) };
        out.check(first.columns.len() * self.beams.len())?;
        let Some(Submitted { columns, way }) = self.submitted.pop_front() else { return Ok(None) };
        let (flight, firing, moment, receiver) = match way {
            Way::Here(cloud) => {
                out.append(&cloud);
                self.spare.push(cloud);
                return Ok(Some(columns));
            }
            Way::There { flight, firing, moment, receiver } => (flight, firing, moment, receiver),
        };
        if let Some(mut compute) = self.compute.take() {
            match compute.land(self, (*flight, columns.clone()), out) {
                Ok(()) => {
                    self.compute = Some(compute);
                    return Ok(Some(columns));
                }
                Err(why) => self.fallback = Some(why),
            }
        }
        let mut past = tree.clone();
        past.recall(&moment);
        self.fire_here(&past, (&firing, &columns), receiver, out);
        Ok(Some(columns))
    }

    /// Sends columns to the GPU; `None` if there is none, or none any more.
    fn launch(
        &mut self,
        tree: &SceneTree,
        (firing, columns): (&Firing, &Range<u32>),
        receiver: Receiver,
    ) -> Option<Box<Flight>> {
        let mut compute = self.compute.take()?;
        let under = Under { receiver, hidden: firing.hidden_instance };
        match compute.launch(self, tree, under, (firing, columns)) {
            Ok(flight) => {
                self.compute = Some(compute);
                Some(Box::new(flight))
            }
            Err(why) => {
                self.fallback = Some(why);
                None
            }
        }
    }

    /// Casts the rays on the CPU and keeps the points.
    fn here(&mut self, tree: &SceneTree, piece: (&Firing, &Range<u32>), receiver: Receiver) -> Way {
        let mut cloud = self.spare.pop().unwrap_or_else(|| Cloud::new(&self.spec, true));
        cloud.len = 0;
        self.fire_here(tree, piece, receiver, &mut cloud.as_mut());
        Way::Here(cloud)
    }

    /// Fires columns on the CPU and adds their points.
    pub(super) fn fire_here(
        &mut self,
        tree: &SceneTree,
        (firing, columns): (&Firing, &Range<u32>),
        receiver: Receiver,
        out: &mut CloudMut<'_>,
    ) {
        let beams = self.beams.len();
        let count = columns.len() * beams;
        if self.shots.len() < count {
            self.shots.resize(count, Shot::default());
        }
        let mut shots = std::mem::take(&mut self.shots);
        let volley = Volley { sweeper: self, tree, firing, receiver };
        let first = columns.start;
        let group = |(k, shots): (usize, &mut [Shot])| volley.group(first + (k * LANES) as u32, shots);
        let chunk = LANES * beams;
        match &self.pool {
            Some(pool) => {
                // The caller's thread takes groups like the others: late threads just find fewer left.
                let groups = Mutex::new(shots[..count].chunks_mut(chunk).enumerate());
                let next = || groups.lock().unwrap_or_else(PoisonError::into_inner).next();
                let work = || std::iter::from_fn(next).for_each(group);
                pool.in_place_scope(|scope| {
                    (0..pool.current_num_threads()).for_each(|_| scope.spawn(|_| work()));
                    work();
                });
            }
            None => shots[..count].chunks_mut(chunk).enumerate().for_each(group),
        }
        for (column, shots) in columns.clone().zip(shots.chunks(beams)) {
            let offset_s = self.offset_s(column);
            for (ring, shot) in shots.iter().enumerate().filter(|(_, shot)| shot.is_seen) {
                let Shot { at_m, intensity, instance, class, .. } = *shot;
                out.push(&Point { at_m, intensity, ring: ring as u16, offset_s, instance, class });
            }
        }
        self.shots = shots;
    }

    /// When a column is fired, seconds since the first.
    pub(super) fn offset_s(&self, column: u32) -> f32 {
        self.columns[column as usize].offset_s
    }

    /// Sine and cosine of a column's azimuth.
    pub(super) fn azimuth(&self, column: u32) -> [f32; 2] {
        self.columns[column as usize].azimuth.map(|part| part as f32)
    }

    /// The point at a range along a beam of a column with this azimuth, sensor's frame.
    pub(super) fn point(&self, ring: usize, [sin, cos]: [f32; 2], range_m: f32) -> [f32; 3] {
        let [x, y, z] = self.beams[ring];
        crate::vector::scale([x * cos - y * sin, x * sin + y * cos, z], range_m)
    }

    /// From where to where a column looks, frame of the trees.
    pub(super) fn aim(&self, tree: &SceneTree, firing: &Firing, column: u32) -> Aim {
        self.aim_from(tree, &Station::of(firing, self.columns[column as usize].at_ns), column)
    }

    /// As [`Self::aim`] for many columns.
    pub(super) fn aims(
        &self,
        tree: &SceneTree,
        firing: &Firing,
        columns: Range<u32>,
    ) -> impl Iterator<Item = Aim> {
        // A sensor at rest has one station for all.
        let rest = (firing.begin == firing.end).then(|| Station::of(firing, firing.begin_ns));
        columns.map(move |column| match &rest {
            Some(station) => self.aim_from(tree, station, column),
            None => self.aim(tree, firing, column),
        })
    }

    fn aim_from(&self, tree: &SceneTree, station: &Station, column: u32) -> Aim {
        let Column { azimuth: [sin, cos], .. } = self.columns[column as usize];
        let matrix = station
            .rotation
            .map(|[x, y, z]| [(x * cos + y * sin) as f32, (y * cos - x * sin) as f32, z as f32]);
        Aim { origin: tree.local(station.origin_m), matrix }
    }
}

/// When a column of a turn is fired, nanoseconds since the first.
fn column_ns(column: u32, period_ns: i64, columns: u32) -> i64 {
    (i128::from(column) * i128::from(period_ns) / i128::from(columns)) as i64
}

fn start(threads: usize) -> Result<rayon::ThreadPool, ParamError> {
    require("threads", (threads + 1).to_string(), threads < THREADS_MAX, "at most 256 threads")?;
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("lidar-{k}")).build();
    pool.map_err(|error| ParamError {
        key: "threads".into(),
        value: format!("{threads} ({error})").into(),
        expected: "a number of threads that the system can start".into(),
    })
}

fn check(firing: &Firing) -> Result<(), FireError> {
    for (when, pose) in [("begin", &firing.begin), ("end", &firing.end)] {
        let placed = pose.origin().coords.iter().all(|x| x.abs() <= REACH_MAX_M);
        if !placed || !pose.rotation().coords.iter().all(|x| x.is_finite()) {
            return Err(FireError::Pose { when });
        }
    }
    if firing.end_ns < firing.begin_ns {
        return Err(FireError::Backwards { by_ns: firing.end_ns.abs_diff(firing.begin_ns) });
    }
    Ok(())
}

/// The columns of one piece of a turn.
struct Volley<'a> {
    sweeper: &'a Sweeper,
    tree: &'a SceneTree,
    firing: &'a Firing,
    receiver: Receiver,
}

/// From where to where a column looks, in the frame of the trees: origin, and the rotation that turns the
/// directions of the beams, row by row.
pub(super) struct Aim {
    pub(super) origin: [f32; 3],
    pub(super) matrix: [[f32; 3]; 3],
}

/// Where the sensor is at a column's instant: origin, and rotation from its frame, row by row.
struct Station {
    origin_m: [f64; 3],
    rotation: [[f64; 3]; 3],
}

impl Volley<'_> {
    /// Fires up to eight columns from `first` on; `shots` has the beams of each.
    fn group(&self, first: u32, shots: &mut [Shot]) {
        let beams = self.sweeper.beams.len();
        let count = shots.len() / beams;
        let (mut origin, mut matrix) = ([[0.0_f32; LANES]; 3], [[[0.0_f32; LANES]; 3]; 3]);
        // Lanes without a column look where the last one does, but reach nothing.
        let mut range = [-1.0; LANES];
        let mut turned = [[0.0_f32; 2]; LANES];
        for lane in 0..LANES {
            let column = first + lane.min(count - 1) as u32;
            if lane < count {
                range[lane] = self.receiver.range_max();
            }
            turned[lane] = self.sweeper.azimuth(column);
            let aim = self.sweeper.aim(self.tree, self.firing, column);
            for axis in 0..3 {
                origin[axis][lane] = aim.origin[axis];
                for (lanes, part) in matrix[axis].iter_mut().zip(aim.matrix[axis]) {
                    lanes[lane] = part;
                }
            }
        }
        let origin = origin.map(f32x8::new);
        let matrix = matrix.map(|row| row.map(f32x8::new));
        let range = f32x8::new(range);
        let mut memory = RayMemory::default();
        for (ring, &[x, y, z]) in self.sweeper.beams.iter().enumerate() {
            let along =
                |[a, b, c]: [f32x8; 3]| a * f32x8::splat(x) + b * f32x8::splat(y) + c * f32x8::splat(z);
            let directions = [along(matrix[0]), along(matrix[1]), along(matrix[2])];
            let hits = self.tree.first_of_packet(
                &mut memory,
                origin,
                directions,
                range,
                self.firing.hidden_instance,
            );
            let [dx, dy, dz] = directions.map(|d| d.to_array());
            for lane in 0..count {
                let number = (first + lane as u32) * beams as u32 + ring as u32;
                let seen = hits[lane].and_then(|hit| {
                    let back = self.receiver.notice(&hit, [dx[lane], dy[lane], dz[lane]], number)?;
                    let at_m = self.sweeper.point(ring, turned[lane], back.range_m);
                    let (instance, class) = (hit.instance_id, hit.class as u8);
                    Some(Shot { at_m, intensity: back.intensity, instance, class, is_seen: true })
                });
                shots[lane * beams + ring] = seen.unwrap_or_default();
            }
        }
    }
}

impl Station {
    /// The sensor's pose at an instant: the place between those at the step's ends, and the rotation by the
    /// normalised mean of their quaternions, whose error over one step is below all others.
    fn of(firing: &Firing, at_ns: i64) -> Self {
        let Firing { begin_ns, begin, end_ns, end, .. } = firing;
        let since = |ns: i64| ns as f64 - *begin_ns as f64;
        let share = since(at_ns) / since(*end_ns).max(1.0);
        let (from, to) = (begin.origin().coords, end.origin().coords);
        let origin_m = [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]));
        let (from, to) = (begin.rotation(), end.rotation());
        let turn = if from.coords.dot(&to.coords) < 0.0 { -share } else { share };
        let mixed = [0, 1, 2, 3].map(|k| (1.0 - share) * from.coords[k] + turn * to.coords[k]);
        let [x, y, z, w] = mixed;
        let scale = 1.0 / (x * x + y * y + z * z + w * w).sqrt();
        let [x, y, z, w] = mixed.map(|q| q * scale);
        let rotation = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        Self { origin_m, rotation }
    }
}
