//! Spinning lidar that fires the columns of one world step at a time.

mod cpu;
mod engine;
mod firing;
mod pattern;
mod pose;
mod submit;
mod submitted;

pub use engine::LidarEngine;
pub(crate) use firing::Piece;
pub use firing::{FireError, Fired, Firing};
pub(crate) use pattern::Pattern;

use std::collections::VecDeque;
use std::sync::Arc;

use swerve_core::param::{ParamError, require};
use swerve_geom::{Lidar, Map, Transform};
use swerve_gpu::Gpu;

use crate::cloud::{Cloud, CloudMut};
use crate::gpu::{GpuEngine, ShotParams};
use crate::returns::Receiver;
use crate::scene_tree::SceneTree;
use crate::spec::LidarSpec;
use submitted::Submitted;

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
    pattern: Pattern,
    threads: Threads,
    shots: Vec<Shot>,
    turn: u64,
    gpu: Option<Box<GpuEngine>>,
    fallback: Option<String>,
    submitted: VecDeque<Submitted>,
    spare: Vec<Cloud>,
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
        let pattern = Pattern::new(spec);
        let threads = match threads {
            0 => Threads::Callers,
            1 => Threads::One,
            _ => Threads::Own(start(threads - 1)?),
        };
        Ok(Self {
            pattern,
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
        sweeper.gpu = Some(Box::new(GpuEngine::new(gpu, &sweeper.pattern.beams)));
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
        &self.pattern.spec
    }

    /// Largest number of points per turn.
    pub fn points_max(&self) -> usize {
        self.pattern.points_max()
    }

    /// Duration of a turn, nanoseconds.
    pub fn period_ns(&self) -> i64 {
        self.pattern.period_ns
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
        let piece = Piece::new(&self.pattern, firing)?;
        let waiting = self.gpu.as_ref().map_or(0, |gpu| gpu.columns_waiting());
        out.check((piece.columns.len() + waiting) * self.pattern.beams.len())?;
        let receiver = Receiver::new(&self.pattern.spec, tree.weather(), self.turn);
        match self.gpu.take() {
            None => self.fire_on_cpu(tree, &piece, receiver, out),
            Some(gpu) if piece.columns.is_empty() => self.gpu = Some(gpu),
            Some(gpu) => {
                let params = ShotParams { receiver, hidden: firing.hidden_instance };
                self.fire_on_gpu(gpu, tree, &piece, params, out);
            }
        }
        Ok(piece.fired(self.pattern.spec.columns))
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
            && let Err(why) = gpu.flush(&self.pattern, out)
        {
            self.fire_waiting(*gpu, tree, out);
            self.fallback = Some(why);
            return self.fire_on_cpu(tree, piece, params.receiver, out);
        }
        gpu.add(&self.pattern, tree, params, piece);
        if piece.columns.end < self.pattern.spec.columns {
            self.gpu = Some(gpu);
            return;
        }
        match gpu.flush(&self.pattern, out) {
            Ok(()) => self.gpu = Some(gpu),
            Err(why) => {
                self.fire_waiting(*gpu, tree, out);
                self.fallback = Some(why);
            }
        }
    }

    /// Fires the pieces queued for a GPU on the CPU and appends their points.
    fn fire_waiting(&mut self, gpu: GpuEngine, tree: &SceneTree, out: &mut CloudMut<'_>) {
        let (params, pieces) = gpu.into_pieces();
        let Some(params) = params else { return };
        let mut past = tree.clone();
        for (piece, dynamics) in pieces {
            past.restore_dynamics(&dynamics);
            self.fire_on_cpu(&past, &piece, params.receiver, out);
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
            steps.iter().map(|(_, firing)| Piece::new(&self.pattern, firing)).collect();
        let pieces = pieces?;
        out.check(pieces.iter().map(|piece| piece.columns.len()).sum::<usize>() * self.pattern.beams.len())?;
        self.cast_turn(turn, steps, &pieces, out);
        Ok(())
    }
}

impl Firing {
    /// Whole turn of a sensor at rest.
    pub fn turn_at_rest(sweeper: &Sweeper, map_from_lidar: Transform<Map, Lidar>) -> Self {
        let (begin, end) = (map_from_lidar, map_from_lidar);
        Self { begin_ns: 0, begin, end_ns: sweeper.period_ns(), end, hidden_instance: None }
    }
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
