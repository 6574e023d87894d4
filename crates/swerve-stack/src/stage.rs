//! Shared resources of all cameras and lidars of a run.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

use swerve_camera::{Backend, Renderer};
use swerve_core::Time;
use swerve_gpu as gpu;
use swerve_lidar::{LidarEngine, SceneTree, Sweeper, TreeError};
use swerve_msg::block::Memory;
use swerve_msg::truth::WorldState;
use swerve_scenario::Scenario;
use swerve_scene::Scene;
use swerve_vehicle::Shape;

use crate::config::Config;
use crate::config::camera::{RenderBackend, RenderConfig};
use crate::config::clock::Clock;
use crate::street::Street;
use crate::unseen::Unseen;

/// Shared resources of all cameras and lidars of a run: the visible world, and renderers and trees for images and rays.
///
/// Results do not depend on the order of requests: images and echoes are functions of the world's state. A scene or a
/// tree stays valid for its holder while later states are shown to others.
///
/// Initialised in the coordinator; a worker needs none.
#[derive(Default)]
pub(crate) struct Stage {
    set: OnceLock<Set>,
    lidars: Mutex<Lidars>,
}

struct Set {
    shown: Mutex<Shown>,
    renderers: Renderers,
}

/// The newest requested state.
struct Shown {
    street: Street,
    unseen: Unseen,
    tree: Arc<SceneTree>,
    /// State that the street shows.
    shown: Option<Time>,
    /// State that the tree was built from.
    planted: Option<Time>,
}

/// A shared stage.
pub(crate) type SharedStage = Arc<Stage>;

/// Threads of a renderer and of a lidar under wall clock, not shared with the run.
const ON_WALL_CLOCK: usize = 2;

/// Threads of a renderer or lidar; 0 in virtual time, for the threads of the run.
pub(crate) fn threads(config: &Config) -> usize {
    if config.clock.source == Clock::Wall { ON_WALL_CLOCK } else { 0 }
}

impl Stage {
    /// Initialises it for a run.
    pub(crate) fn raise(&self, config: &Config, scenario: &Scenario) -> anyhow::Result<()> {
        let (mut render, is_wall) = (config.render, config.clock.source == Clock::Wall);
        if is_wall && render.backend == RenderBackend::Auto {
            (render.backend, _) = render.backend.on_this_machine(&gpu::probe());
        }
        // An adapter takes as long to start as a street to be built.
        let (street, first) = std::thread::scope(|scope| {
            let renderer = scope.spawn(|| render.renderer(threads(config)));
            let street = Street::new(scenario, &config.sim.vehicle.shape, render.weather, config.seed);
            (street, renderer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
        });
        let unseen = Unseen::new(&config.sensing, scenario)?;
        let shown = Shown { street, unseen, tree: Arc::default(), shown: None, planted: None };
        let first = first?;
        // An adapter works for one caller at a time, and so do the threads of a renderer with its own threads.
        let more = (!is_wall && first.backend() == Backend::Cpu).then_some(render);
        let renderers = Renderers { free: Mutex::new(vec![first]), returned: Condvar::new(), more };
        let _raised_once = self.set.set(Set { shown: Mutex::new(shown), renderers });
        Ok(())
    }

    fn set(&self) -> &Set {
        self.set.get().expect("sensors are stepped where the run is driven, and there the stage is raised")
    }

    /// Scene of a state of the world.
    pub(crate) fn scene_of(&self, world: &WorldState) -> Arc<Scene> {
        let mut shown = lock(&self.set().shown);
        shown.show(world);
        shown.street.shared()
    }

    /// Tree for ray casting of a state of the world.
    pub(crate) fn tree_of(&self, world: &WorldState) -> Result<Arc<SceneTree>, TreeError> {
        let mut shown = lock(&self.set().shown);
        shown.show(world);
        let Shown { street, tree, planted, .. } = &mut *shown;
        if *planted != Some(world.stamp) {
            Arc::make_mut(tree).update(street.scene())?;
            *planted = Some(world.stamp);
        }
        Ok(tree.clone())
    }

    /// Returns true if several frames may be drawn at once.
    pub(crate) fn draws_at_once(&self) -> bool {
        self.set().renderers.more.is_some()
    }

    /// Draws with exclusive use of a renderer.
    pub(crate) fn draw<T>(&self, work: impl FnOnce(&mut Renderer) -> T) -> T {
        let renderers = &self.set().renderers;
        let mut taken = Taken { renderers, renderer: Some(renderers.take()) };
        work(taken.renderer.as_mut().expect("it is given back when this is dropped"))
    }

    /// Records the engine of a lidar.
    pub(crate) fn note(&self, sweeper: &Sweeper) {
        let mut lidars = lock(&self.lidars);
        lidars.on_gpu |= sweeper.engine() == LidarEngine::Gpu;
        if lidars.fell_back.is_none() {
            lidars.fell_back = sweeper.fallback().map(str::to_owned);
        }
    }
}

impl Shown {
    fn show(&mut self, world: &WorldState) {
        if self.shown != Some(world.stamp) {
            self.street.show(&self.unseen.seen(world));
            self.shown = Some(world.stamp);
        }
    }
}

/// Renderers of a run: each can draw any camera, and keeps reusable data for the next frame.
struct Renderers {
    /// Renderers not in use.
    free: Mutex<Vec<Renderer>>,
    returned: Condvar,
    /// Settings of further renderers for when none is free; `None` if callers wait instead.
    more: Option<RenderConfig>,
}

impl Renderers {
    fn take(&self) -> Renderer {
        let mut free = lock(&self.free);
        loop {
            if let Some(renderer) = free.pop() {
                return renderer;
            }
            if let Some(Ok(another)) = self.more.map(|more| more.renderer(0)) {
                return another;
            }
            free = self.returned.wait(free).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// A renderer in use.
struct Taken<'a> {
    renderers: &'a Renderers,
    renderer: Option<Renderer>,
}

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        lock(&self.renderers.free).extend(self.renderer.take());
        self.renderers.returned.notify_one();
    }
}

/// Device that computed the images and point clouds of a run.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Rendered {
    /// `cpu`, or the device used instead.
    pub by: String,
    /// True if the digest is the same on every machine.
    pub is_portable: bool,
    /// Reason that the run continued on the processor, if it had to.
    pub fell_back: Option<String>,
}

pub(crate) fn rendered(stage: &Stage) -> Rendered {
    let lidars = core::mem::take(&mut *lock(&stage.lidars));
    // Several renderers are all of the same kind.
    stage.draw(|renderer| {
        let backend = renderer.backend();
        let adapter = renderer.adapter().map(|adapter| format!(", {adapter}")).unwrap_or_default();
        let lidars_by = if lidars.on_gpu { ", lidars by gpu" } else { "" };
        let fell_back = renderer.fell_back().map(str::to_owned).or_else(|| lidars.fell_back.clone());
        Rendered {
            by: format!("{}{adapter}{lidars_by}", backend.name()),
            is_portable: backend.is_portable() && !lidars.on_gpu && fell_back.is_none(),
            fell_back,
        }
    })
}

/// Ray casters of the lidars.
#[derive(Default)]
struct Lidars {
    on_gpu: bool,
    fell_back: Option<String>,
}

/// Locks despite a panic elsewhere, which ends the run anyway.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Distance from the outline beyond which a sensor sees the car that carries it, metres.
const CLOSE_M: f64 = 0.5;

/// Returns true if a sensor at this position on the ego is so close that the body would fill its view.
pub(crate) fn hides_ego([x, y, z]: [f64; 3], shape: &Shape) -> bool {
    let along_m = (x - shape.center_ahead_m()).abs() - 0.5 * shape.length_m;
    let across_m = y.abs() - 0.5 * shape.width_m;
    along_m.max(across_m).max(z - shape.height_m) < CLOSE_M
}

/// Memory for large payloads of one stream: of this process, until another one is set for its readers.
#[derive(Clone)]
pub struct StreamMemory {
    /// Number of arrays in each message.
    pub arrays: usize,
    shared: Arc<OnceLock<Box<dyn Memory>>>,
}

impl StreamMemory {
    pub(crate) fn new(arrays: usize) -> Self {
        Self { arrays, shared: Arc::default() }
    }

    /// Uses `memory` from now on. Only the first call has an effect.
    pub fn share(&self, memory: Box<dyn Memory>) {
        let _first_counts = self.shared.set(memory);
    }

    fn shared(&self) -> Option<&dyn Memory> {
        self.shared.get().map(|memory| &**memory)
    }
}

/// Published payloads, to be reused once no reader holds them.
pub(crate) struct Pool<T> {
    memory: StreamMemory,
    lent: Vec<Arc<T>>,
}

impl<T> Pool<T> {
    pub(crate) fn new(memory: StreamMemory) -> Self {
        Self { memory, lent: Vec::new() }
    }

    /// A payload held by no reader; a new one if there is none or if memory is shared.
    pub(crate) fn take(&mut self, make: impl FnOnce(Option<&dyn Memory>) -> T) -> Arc<T> {
        if let Some(memory) = self.memory.shared() {
            return Arc::new(make(Some(memory)));
        }
        match self.lent.iter_mut().position(|lent| Arc::get_mut(lent).is_some()) {
            Some(index) => self.lent.swap_remove(index),
            None => Arc::new(make(None)),
        }
    }

    /// Keeps a published payload for reuse.
    pub(crate) fn keep(&mut self, lent: &Arc<T>) {
        if self.memory.shared().is_none() {
            self.lent.push(lent.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pool_reuses_payloads_without_readers() {
        let mut pool = Pool::new(StreamMemory::new(1));
        let (first, second) = (pool.take(|_| vec![1]), pool.take(|_| vec![2]));
        pool.keep(&first);
        pool.keep(&second);
        let at = second.as_ptr();
        assert_eq!(*pool.take(|_| vec![3]), [3], "both are held");
        drop(second);
        let again = pool.take(|_| vec![4]);
        assert_eq!((&*again, again.as_ptr()), (&vec![2], at));
        assert_eq!(*first, [1]);
    }

    #[test]
    fn sensor_sees_its_car_only_from_afar() {
        let shape = Shape::default();
        let ahead_m = shape.center_ahead_m();
        assert!(hides_ego([ahead_m, 0.0, 1.9], &shape));
        assert!(hides_ego([ahead_m, 0.0, 1.2], &shape));
        assert!(!hides_ego([ahead_m, 0.0, 40.0], &shape));
        assert!(!hides_ego([ahead_m - 9.5, 0.0, 4.2], &shape));
    }
}
