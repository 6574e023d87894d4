//! One type for all back ends.

use swerve_geom::{Map, Transform};

use crate::Camera;
use crate::cpu::CpuRenderer;
use crate::frame::{FrameMut, FrameSizeError};
use crate::scene::{Motion, Scene};
use crate::weather::WeatherError;

/// What computes the images.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub enum Backend {
    /// The rasteriser in this crate: always there; the same bytes on every x86-64 machine and thread count.
    #[default]
    Cpu,
}

impl Backend {
    /// Name in configurations and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
        }
    }

    /// Whether the same scene gives the same bytes on any machine.
    pub fn is_portable(self) -> bool {
        match self {
            Self::Cpu => true,
        }
    }
}

/// How a renderer is set up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RenderOptions {
    /// Which back end.
    pub backend: Backend,
    /// Threads of the CPU back end. With 1 (or 0) all is done on the caller's thread; with more on that
    /// many of the renderer's own, while the caller waits.
    pub threads: usize,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { backend: Backend::Cpu, threads: 1 }
    }
}

/// One look at the scene.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Through which camera.
    pub camera: &'a Camera,
    /// From where: optical axes, see [`crate::camera`].
    pub map_from_camera: Transform<Map, swerve_geom::Camera>,
    /// How the camera moves, for blur and rolling shutter.
    pub motion: Motion,
    /// Number of the frame: keys the noise of the sensor and the rain.
    pub frame: u64,
    /// The instance id that this camera does not see (its shadow stays): the vehicle that carries it.
    pub hidden_instance: Option<u32>,
}

impl<'a> View<'a> {
    /// A view at rest that hides nothing.
    pub fn new(camera: &'a Camera, map_from_camera: Transform<Map, swerve_geom::Camera>) -> Self {
        Self { camera, map_from_camera, motion: Motion::default(), frame: 0, hidden_instance: None }
    }
}

/// A pass could not be made.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum RenderError {
    /// An image of the caller has the wrong size.
    #[error(transparent)]
    FrameSize(#[from] FrameSizeError),
    /// The scene's weather is out of its range.
    #[error(transparent)]
    Weather(#[from] WeatherError),
    /// A pose, a speed or an angle is not finite.
    #[error("{what} is not finite")]
    NotFinite {
        /// What it is.
        what: &'static str,
    },
    /// The threads of the renderer could not be started.
    #[error("cannot start {threads} threads: {why}")]
    Threads {
        /// How many.
        threads: usize,
        /// The system's words.
        why: String,
    },
}

/// Renders scenes; keeps what can be kept between passes.
pub struct Renderer {
    engine: Engine,
}

/// The back end that was started.
enum Engine {
    Cpu(Box<CpuRenderer>),
}

impl Renderer {
    /// Starts the back end.
    ///
    /// # Errors
    /// If its threads cannot be started.
    pub fn new(options: RenderOptions) -> Result<Self, RenderError> {
        match options.backend {
            Backend::Cpu => Ok(Self { engine: Engine::Cpu(Box::new(CpuRenderer::new(options.threads)?)) }),
        }
    }

    /// Which back end it is.
    pub fn backend(&self) -> Backend {
        match self.engine {
            Engine::Cpu(_) => Backend::Cpu,
        }
    }

    /// One pass: writes the images that `out` has.
    ///
    /// The images are a function of scene, view and options alone, not of earlier passes.
    ///
    /// # Errors
    /// Images of the wrong size, a weather out of its range, a pose that is not finite; nothing is written
    /// then.
    pub fn render(&mut self, scene: &Scene, view: &View<'_>, out: FrameMut<'_>) -> Result<(), RenderError> {
        out.check(view.camera)?;
        scene.weather.check()?;
        check_finite(scene, view)?;
        match &mut self.engine {
            Engine::Cpu(cpu) => cpu.render(scene, view, out),
        }
        Ok(())
    }
}

fn check_finite(scene: &Scene, view: &View<'_>) -> Result<(), RenderError> {
    let motion_is =
        |motion: &Motion| motion.linear_mps.iter().chain(&motion.angular_radps).all(|x| x.is_finite());
    let pose_is =
        |origin: [f64; 3], rotation: [f64; 4]| origin.iter().chain(&rotation).all(|x| x.is_finite());
    let camera = &view.map_from_camera;
    let fine =
        |finite: bool, what: &'static str| if finite { Ok(()) } else { Err(RenderError::NotFinite { what }) };
    fine(pose_is(camera.origin().coords.into(), camera.rotation().coords.into()), "the camera's pose")?;
    fine(motion_is(&view.motion), "the camera's motion")?;
    fine(scene.sun.azimuth_rad.is_finite() && scene.sun.elevation_rad.is_finite(), "the sun's direction")?;
    for instance in scene.statics().instances().iter().chain(&scene.dynamics) {
        let pose = &instance.map_from_body;
        fine(pose_is(pose.origin().coords.into(), pose.rotation().coords.into()), "an instance's pose")?;
        fine(motion_is(&instance.motion), "an instance's motion")?;
    }
    for light in &scene.lights {
        let numbers = [light.range_m, light.cos_inner, light.cos_outer];
        let finite = light.position_m.iter().chain(&light.direction).all(|x| x.is_finite())
            && light.intensity.iter().chain(&numbers).all(|x| x.is_finite());
        fine(finite, "a light")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scenes are read and renderers are moved by worker threads; this compiles only if they can be.
    #[test]
    fn scenes_are_shared_and_renderers_moved() {
        fn shared<T: Send + Sync>(_: &T) {}
        fn moved<T: Send>(_: T) {}
        shared(&Scene::default());
        let renderer = Renderer::new(RenderOptions::default()).expect("no threads are needed");
        assert_eq!((renderer.backend(), renderer.backend().name()), (Backend::Cpu, "cpu"));
        assert!(renderer.backend().is_portable());
        moved(renderer);
    }
}
