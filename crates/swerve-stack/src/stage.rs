//! What all cameras and lidars of a run share.

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
use crate::shot::Shots;
use crate::street::Street;

/// What all cameras and lidars of a run share: the world as it looks, and what images and rays need of it.
///
/// It makes nothing depend on who asks first: images and echoes are functions of the world's state. Who asks for a
/// scene or a tree keeps it while later states are shown to others.
///
/// Raised where the run is driven; a process that takes steps of others needs none.
#[derive(Default)]
pub(crate) struct Stage {
    set: OnceLock<Set>,
    pub(crate) shots: Shots,
    lidars: Mutex<Lidars>,
}

struct Set {
    shown: Mutex<Shown>,
    renderers: Renderers,
}

/// The newest state that anybody asked for.
struct Shown {
    street: Street,
    tree: Arc<SceneTree>,
    /// The state that the street shows.
    shown: Option<Time>,
    /// The state that the tree was made of.
    planted: Option<Time>,
}

/// A stage and who else has it.
pub(crate) type SharedStage = Arc<Stage>;

/// Threads of a renderer and of a lidar where the real clock moves the run: there they are their own.
const ON_WALL_CLOCK: usize = 2;

/// Threads of a renderer or lidar: in virtual time those of the run.
pub(crate) fn threads(config: &Config) -> usize {
    if config.clock.source == Clock::Wall { ON_WALL_CLOCK } else { 0 }
}

impl Stage {
    /// Sets it up for a run.
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
        let (first, shown) = (first?, Shown { street, tree: Arc::default(), shown: None, planted: None });
        // An adapter works for one at a time, and so do the threads of a renderer that has its own.
        let more = (!is_wall && first.backend() == Backend::Cpu).then_some(render);
        let renderers = Renderers { free: Mutex::new(vec![first]), returned: Condvar::new(), more };
        let _raised_once = self.set.set(Set { shown: Mutex::new(shown), renderers });
        Ok(())
    }

    fn set(&self) -> &Set {
        self.set.get().expect("sensors are stepped where the run is driven, and there the stage is raised")
    }

    /// The scene of a state of the world.
    pub(crate) fn scene_of(&self, world: &WorldState) -> Arc<Scene> {
        let mut shown = lock(&self.set().shown);
        shown.show(world);
        shown.street.shared()
    }

    /// The scene of a state of the world as rays meet it.
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

    /// Whether several frames may be drawn at once.
    pub(crate) fn draws_at_once(&self) -> bool {
        self.set().renderers.more.is_some()
    }

    /// Draws with a renderer that nobody else draws with.
    pub(crate) fn draw<T>(&self, work: impl FnOnce(&mut Renderer) -> T) -> T {
        let renderers = &self.set().renderers;
        let mut taken = Taken { renderers, renderer: Some(renderers.take()) };
        work(taken.renderer.as_mut().expect("it is given back when this is dropped"))
    }

    /// Remembers what casts the rays of a lidar.
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
            self.street.show(world);
            self.shown = Some(world.stamp);
        }
    }
}

/// Renderers of a run: any of them draws any camera, and keeps what it can for the next.
struct Renderers {
    /// With which nobody draws.
    free: Mutex<Vec<Renderer>>,
    returned: Condvar,
    /// What makes another one when none is free; none where who draws waits instead.
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

/// A renderer that is drawn with.
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

/// What computed the images and point clouds of a run.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Rendered {
    /// `cpu`, or what did it in its place.
    pub by: String,
    /// Whether the digest holds on every machine.
    pub is_portable: bool,
    /// Why the run went on with the processor, if it had to.
    pub fell_back: Option<String>,
}

pub(crate) fn rendered(stage: &Stage) -> Rendered {
    let lidars = core::mem::take(&mut *lock(&stage.lidars));
    // Where there are several they are all of a kind.
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

/// What cast the rays of the lidars.
#[derive(Default)]
struct Lidars {
    on_gpu: bool,
    fell_back: Option<String>,
}

/// Works on in spite of a panic elsewhere, which ends the run anyway.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From farther off than this a sensor sees the car that carries it, metres from its outline.
const CLOSE_M: f64 = 0.5;

/// Whether a sensor at this place of the ego sits so close that the body would fill what it sees with what is no
/// obstacle.
pub(crate) fn hides_ego([x, y, z]: [f64; 3], shape: &Shape) -> bool {
    let along_m = (x - shape.center_ahead_m()).abs() - 0.5 * shape.length_m;
    let across_m = y.abs() - 0.5 * shape.width_m;
    along_m.max(across_m).max(z - shape.height_m) < CLOSE_M
}

/// Where the big payloads of one stream lie: in memory of this process, until another one is found to read them.
#[derive(Clone)]
pub struct StreamMemory {
    /// How many arrays each message has.
    pub arrays: usize,
    shared: Arc<OnceLock<Box<dyn Memory>>>,
}

impl StreamMemory {
    pub(crate) fn new(arrays: usize) -> Self {
        Self { arrays, shared: Arc::default() }
    }

    /// From now on they lie in `memory`. It is decided once.
    pub fn share(&self, memory: Box<dyn Memory>) {
        let _first_counts = self.shared.set(memory);
    }

    fn shared(&self) -> Option<&dyn Memory> {
        self.shared.get().map(|memory| &**memory)
    }
}

/// Payloads that were published, to be used again once no reader holds them.
pub(crate) struct Pool<T> {
    memory: StreamMemory,
    lent: Vec<Arc<T>>,
}

impl<T> Pool<T> {
    pub(crate) fn new(memory: StreamMemory) -> Self {
        Self { memory, lent: Vec::new() }
    }

    /// One that nobody else holds; made anew where there is none, and in memory that is shared.
    pub(crate) fn take(&mut self, make: impl FnOnce(Option<&dyn Memory>) -> T) -> Arc<T> {
        if let Some(memory) = self.memory.shared() {
            return Arc::new(make(Some(memory)));
        }
        match self.lent.iter_mut().position(|lent| Arc::get_mut(lent).is_some()) {
            Some(index) => self.lent.swap_remove(index),
            None => Arc::new(make(None)),
        }
    }

    /// Remembers what is published.
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
    fn what_is_read_no_longer_is_used_again() {
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
    fn the_car_is_seen_from_far_off_only() {
        let shape = Shape::default();
        let ahead_m = shape.center_ahead_m();
        assert!(hides_ego([ahead_m, 0.0, 1.9], &shape));
        assert!(hides_ego([ahead_m, 0.0, 1.2], &shape));
        assert!(!hides_ego([ahead_m, 0.0, 40.0], &shape));
        assert!(!hides_ego([ahead_m - 9.5, 0.0, 4.2], &shape));
    }
}
