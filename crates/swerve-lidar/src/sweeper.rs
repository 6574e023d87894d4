//! Spinning lidar that fires the columns of one world step at a time.

mod cpu;
mod engine;
mod firing;
mod pose;
mod submit;

pub use engine::LidarEngine;
pub(crate) use firing::Piece;
pub use firing::{FireError, Fired, Firing};

use core::ops::Range;
use std::collections::VecDeque;
use std::sync::Arc;

use swerve_core::param::{ParamError, require};
use swerve_geom::math;
use swerve_gpu::Gpu;
use swerve_scene::vector::scale;

use crate::cloud::{Cloud, CloudMut};
use crate::gpu::{GpuEngine, ShotParams};
use crate::returns::Receiver;
use crate::scene_tree::SceneTree;
use crate::spec::LidarSpec;
use submit::Submitted;

/// Spinning lidar.
///
/// **Engines.** [`Sweeper::new`] casts the rays on the CPU, which is the reference: the same bytes everywhere.
/// [`Sweeper::on_gpu`] sends them to a GPU, whole turns at a time, with the same trees, the same noise for the same
/// shot, and each column in the scene of its step. Points differ only by rounding; occasionally a ray passes an edge on
/// the other side. A turn takes a GPU some tenths of a millisecond of any size, mostly for the transfers; one CPU core
/// casts millions of rays per second. A small lidar at 10 Hz is therefore best left on the CPU, where results are
/// portable. With 64 beams and more, with several lidars on a car, or for fast data generation, a GPU relieves the
/// cores: fastest with [`Sweeper::submit`] and [`Sweeper::collect`], which hide the transfers. Software adapters
/// (llvmpipe) are always slower and only for tests.
///
/// When the GPU fails, the current turn is fired by the CPU without missing points, and the CPU continues: see
/// [`Sweeper::engine`] and [`Sweeper::fallback`].
pub struct Sweeper {
    spec: LidarSpec,
    period_ns: i64,
    /// Directions of the beams in a column at azimuth 0.
    beams: Vec<[f32; 3]>,
    columns: Vec<Column>,
    threads: Threads,
    shots: Vec<Shot>,
    turn: u64,
    gpu: Option<Box<GpuEngine>>,
    fallback: Option<String>,
    submitted: VecDeque<Submitted>,
    spare: Vec<Cloud>,
}

/// Column of a turn.
#[derive(Clone, Copy, Debug)]
struct Column {
    /// Sine and cosine of its azimuth.
    azimuth: [f64; 2],
    /// Firing time since the first column, nanoseconds.
    at_ns: i64,
    offset_s: f32,
}

/// Return of one shot.
#[derive(Clone, Copy, Debug, Default)]
struct Shot {
    at_m: [f32; 3],
    intensity: f32,
    instance: u32,
    class: u8,
    is_seen: bool,
}

/// Threads that fire columns.
enum Threads {
    /// The caller's thread.
    One,
    /// Threads of the pool that the caller runs in, if any.
    Callers,
    /// Additional threads beside the caller's.
    Own(rayon::ThreadPool),
}

/// Nanoseconds per second.
const SECOND_NS: f64 = 1e9;
/// Largest number of threads of a lidar.
const THREADS_MAX: usize = 256;

impl Sweeper {
    /// Lidar from a specification; its columns are distributed over `threads` threads including the caller's, or with 0
    /// over the rayon pool of the caller, if it is in one.
    ///
    /// # Errors
    /// If a field of the specification is invalid, or threads cannot be started.
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
        let threads = match threads {
            0 => Threads::Callers,
            1 => Threads::One,
            _ => Threads::Own(start(threads - 1)?),
        };
        Ok(Self {
            spec,
            period_ns,
            beams,
            columns,
            threads,
            shots: Vec::new(),
            turn: 0,
            gpu: None,
            fallback: None,
            submitted: VecDeque::new(),
            spare: Vec::new(),
        })
    }

    /// As [`Self::new`], with the rays on a GPU. `threads` are used by the CPU if the GPU is lost.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn on_gpu(spec: LidarSpec, threads: usize, gpu: &Arc<Gpu>) -> Result<Self, ParamError> {
        let mut sweeper = Self::new(spec, threads)?;
        sweeper.gpu = Some(Box::new(GpuEngine::new(gpu, &sweeper.beams)));
        Ok(sweeper)
    }

    /// Engine that currently casts the rays.
    pub fn engine(&self) -> LidarEngine {
        if self.gpu.is_some() { LidarEngine::Gpu } else { LidarEngine::Cpu }
    }

    /// Reason for the fallback of a GPU lidar to the CPU; `None` if it did not happen.
    pub fn fallback(&self) -> Option<&str> {
        self.fallback.as_deref()
    }

    /// Specification of the lidar.
    pub fn spec(&self) -> &LidarSpec {
        &self.spec
    }

    /// Largest number of points per turn.
    pub fn points_max(&self) -> usize {
        self.beams.len() * self.columns.len()
    }

    /// Duration of a turn, nanoseconds.
    pub fn period_ns(&self) -> i64 {
        self.period_ns
    }

    /// Columns of a turn with instants in `[begin_ns, end_ns)`; consecutive pieces cover each column once.
    fn columns_between(&self, begin_ns: i64, end_ns: i64) -> Range<u32> {
        let (period, columns) = (i128::from(self.period_ns), i128::from(self.spec.columns));
        // The first column fired at or after an instant t is the smallest k with k period / columns >= t.
        let from = |at_ns: i64| {
            let at = i128::from(at_ns.clamp(0, self.period_ns));
            let k = ((at * columns) / period).clamp(0, columns);
            let late = |k: i128| k >= columns || k * period / columns >= i128::from(at_ns);
            if late(k) { k } else { k + 1 }
        };
        let first = from(begin_ns) as u32;
        first..(from(end_ns) as u32).max(first)
    }

    /// Begins a turn: clears the cloud and keys the noise by the turn number.
    pub fn begin_turn(&mut self, turn: u64, out: &mut CloudMut<'_>) {
        self.turn = turn;
        *out.len = 0;
        if let Some(gpu) = &mut self.gpu {
            gpu.forget_pieces();
        }
    }

    /// Fires the columns of one step and appends their points, by column and then by beam.
    ///
    /// On a GPU the columns of a turn are batched: their points are appended by the call that completes the turn, or
    /// that has another weather, hidden instance or static part than those before it. All calls of a turn must use the
    /// same cloud.
    ///
    /// # Errors
    /// Arrays without room, poses that are not finite, a step that ends before it begins; nothing is appended then.
    pub fn fire(
        &mut self,
        tree: &SceneTree,
        firing: &Firing,
        out: &mut CloudMut<'_>,
    ) -> Result<Fired, FireError> {
        let piece = Piece::new(self, firing)?;
        let waiting = self.gpu.as_ref().map_or(0, |gpu| gpu.columns_waiting());
        out.check((piece.columns.len() + waiting) * self.beams.len())?;
        let receiver = Receiver::new(&self.spec, tree.weather(), self.turn);
        match self.gpu.take() {
            None => self.fire_on_cpu(tree, &piece, receiver, out),
            Some(gpu) if piece.columns.is_empty() => self.gpu = Some(gpu),
            Some(gpu) => {
                let params = ShotParams { receiver, hidden: firing.hidden_instance };
                self.fire_on_gpu(gpu, tree, &piece, params, out);
            }
        }
        Ok(piece.fired(self.spec.columns))
    }

    /// Queues columns, and fires all queued ones on the GPU when they complete the turn; on the CPU if the GPU fails.
    fn fire_on_gpu(
        &mut self,
        mut gpu: Box<GpuEngine>,
        tree: &SceneTree,
        piece: &Piece,
        params: ShotParams,
        out: &mut CloudMut<'_>,
    ) {
        if gpu.needs_flush(tree, &params)
            && let Err(why) = gpu.flush(self, out)
        {
            gpu.fire_on_cpu(self, tree, out);
            self.fallback = Some(why);
            return self.fire_on_cpu(tree, piece, params.receiver, out);
        }
        gpu.add(self, tree, params, piece);
        if piece.columns.end < self.spec.columns {
            self.gpu = Some(gpu);
            return;
        }
        match gpu.flush(self, out) {
            Ok(()) => self.gpu = Some(gpu),
            Err(why) => {
                gpu.fire_on_cpu(self, tree, out);
                self.fallback = Some(why);
            }
        }
    }

    /// Fires one turn with all steps known on the CPU, equivalent to [`Self::begin_turn`] and one [`Self::fire`] per
    /// step: `steps` holds the scene and the firing of each. The columns of all steps are distributed over the threads
    /// at once.
    ///
    /// # Errors
    /// As for [`Self::fire`].
    pub fn fire_turn(
        &self,
        turn: u64,
        steps: &[(Arc<SceneTree>, Firing)],
        out: &mut CloudMut<'_>,
    ) -> Result<(), FireError> {
        *out.len = 0;
        let pieces: Result<Vec<Piece>, _> =
            steps.iter().map(|(_, firing)| Piece::new(self, firing)).collect();
        let pieces = pieces?;
        out.check(pieces.iter().map(|piece| piece.columns.len()).sum::<usize>() * self.beams.len())?;
        self.cast_turn(turn, steps, &pieces, out);
        Ok(())
    }

    /// Firing time of a column since the first, seconds.
    pub(crate) fn offset_s(&self, column: u32) -> f32 {
        self.columns[column as usize].offset_s
    }

    /// Sine and cosine of a column's azimuth.
    pub(crate) fn azimuth(&self, column: u32) -> [f32; 2] {
        self.columns[column as usize].azimuth.map(|part| part as f32)
    }

    /// Point at a range along a beam of a column with this azimuth, sensor frame.
    pub(crate) fn point(&self, ring: usize, [sin, cos]: [f32; 2], range_m: f32) -> [f32; 3] {
        let [x, y, z] = self.beams[ring];
        scale([x * cos - y * sin, x * sin + y * cos, z], range_m)
    }
}

/// Firing time of a column since the first, nanoseconds.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_between_covers_every_column_once() {
        for (columns, rate_hz) in [(1800, 10.0), (2083, 10.0), (7, 333.0), (1, 20.0), (2048, 9.7)] {
            let spec = LidarSpec { columns, rate_hz, ..LidarSpec::default() };
            let sweeper = Sweeper::new(spec, 1).unwrap();
            let (mut next, mut from) = (0, -3_000_000);
            while from < sweeper.period_ns() {
                let fired = sweeper.columns_between(from, from + 5_000_000);
                assert_eq!(fired.start, next);
                for column in fired.clone() {
                    assert!((from..from + 5_000_000).contains(&sweeper.columns[column as usize].at_ns));
                }
                (next, from) = (fired.end, from + 5_000_000);
            }
            assert_eq!(next, columns);
            assert_eq!(sweeper.columns_between(9, 9).len(), 0);
            assert_eq!(sweeper.columns_between(i64::MIN, i64::MAX), 0..columns);
        }
        let sweeper = Sweeper::new(LidarSpec::default(), 1).unwrap();
        assert_eq!(sweeper.columns_between(5_000_000, 10_000_000), 90..180);
    }
}
