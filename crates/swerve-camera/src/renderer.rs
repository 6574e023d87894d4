//! Renderer over all back ends.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use swerve_gpu::{AdapterKind, AdapterReport, Gpu};
use swerve_scene::Scene;

use crate::check::{check, check_count};
use crate::cpu::CpuRenderer;
use crate::error::RenderError;
use crate::frame::{Frame, FrameMut, Outputs};
use crate::frontend::Threads;
use crate::gpu::{GpuRenderer, InFlight};
use crate::{Camera, View};

/// Rendering back end.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub enum Backend {
    /// Rasteriser of this crate: always available; the same bytes on every x86-64 machine and thread count.
    #[default]
    Cpu,
    /// GPU: the same bytes from run to run on one adapter and driver.
    Gpu,
    /// Software implementation of a graphics adapter on the CPU: for comparisons, and for testing the shaders without a
    /// GPU.
    Software,
}

impl Backend {
    /// Name in configurations and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Software => "software",
        }
    }

    /// Returns true if the same scene gives the same bytes on any machine.
    pub fn is_portable(self) -> bool {
        self == Self::Cpu
    }

    /// Kind of adapter required, if any.
    pub fn adapter(self) -> Option<AdapterKind> {
        match self {
            Self::Cpu => None,
            Self::Gpu => Some(AdapterKind::Gpu),
            Self::Software => Some(AdapterKind::Software),
        }
    }
}

/// Options of a renderer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RenderOptions {
    /// Rendering back end.
    pub backend: Backend,
    /// Number of threads of the CPU back end: 1 runs on the caller's thread; more run on the renderer's own threads
    /// while the caller waits; 0 runs on the rayon pool of the caller, if it is in one. The other back ends use as many
    /// threads to copy images.
    pub threads: usize,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { backend: Backend::Cpu, threads: 1 }
    }
}

/// Renders scenes; keeps reusable data between passes.
///
/// If an adapter fails during a run, the renderer continues on the CPU back end and reports it: see
/// [`Renderer::fell_back`].
pub struct Renderer {
    engine: Engine,
    threads: usize,
    fell_back: Option<String>,
}

/// Active back end.
enum Engine {
    Cpu(Box<CpuRenderer>),
    Gpu(Box<GpuRenderer>),
}

/// Frames in progress: see [`Renderer::submit`].
pub struct Submission {
    asked: Vec<(Camera, Outputs)>,
    state: State,
}

enum State {
    InFlight(InFlight),
    Done(Vec<Frame>),
}

impl Renderer {
    /// Starts the back end.
    ///
    /// # Errors
    /// If the threads cannot be started or there is no such adapter.
    pub fn new(options: RenderOptions) -> Result<Self, RenderError> {
        match options.backend.adapter() {
            None => {
                let cpu = CpuRenderer::new(options.threads)?;
                Ok(Self { engine: Engine::Cpu(Box::new(cpu)), threads: options.threads, fell_back: None })
            }
            Some(kind) => Self::on(Gpu::shared(kind)?, options.threads),
        }
    }

    /// Starts the back end on a device of the caller; see [`RenderOptions`] for `threads`.
    ///
    /// # Errors
    /// If the threads cannot be started or the device lacks a capability that the back end needs.
    pub fn on(gpu: Arc<Gpu>, threads: usize) -> Result<Self, RenderError> {
        let pool = Threads::new(threads)?;
        let started = guarded(|| GpuRenderer::new(gpu, pool));
        let engine = started.map_err(|why| RenderError::Adapter { why })?;
        Ok(Self { engine: Engine::Gpu(Box::new(engine)), threads, fell_back: None })
    }

    /// Active back end.
    pub fn backend(&self) -> Backend {
        match &self.engine {
            Engine::Cpu(_) => Backend::Cpu,
            Engine::Gpu(gpu) => match gpu.gpu().report().kind {
                Some(AdapterKind::Gpu) => Backend::Gpu,
                _ => Backend::Software,
            },
        }
    }

    /// Active adapter, if any.
    pub fn adapter(&self) -> Option<&AdapterReport> {
        match &self.engine {
            Engine::Cpu(_) => None,
            Engine::Gpu(gpu) => Some(gpu.gpu().report()),
        }
    }

    /// Reason for the fallback from an adapter to the CPU back end, if it happened.
    pub fn fell_back(&self) -> Option<&str> {
        self.fell_back.as_deref()
    }

    /// Checks that a scene and a view can be rendered.
    ///
    /// # Errors
    /// Weather out of range, or a non-finite pose.
    pub fn check(scene: &Scene, view: &View<'_>) -> Result<(), RenderError> {
        check(scene, core::slice::from_ref(view))
    }

    /// Renders one pass and writes the images present in `out`.
    ///
    /// The images are a function of scene, view and options only, independent of earlier passes.
    ///
    /// # Errors
    /// Images of the wrong size, weather out of range, or a non-finite pose; nothing is written in these cases.
    pub fn render(&mut self, scene: &Scene, view: &View<'_>, out: FrameMut<'_>) -> Result<(), RenderError> {
        self.render_batch(scene, core::slice::from_ref(view), &mut [out])
    }

    /// Renders one pass per view, in parallel where the back end supports it; writes the images present in each of
    /// `out`.
    ///
    /// # Errors
    /// As for [`Self::render`], and if the numbers of frames and views differ.
    pub fn render_batch(
        &mut self,
        scene: &Scene,
        views: &[View<'_>],
        out: &mut [FrameMut<'_>],
    ) -> Result<(), RenderError> {
        check_count(views.len(), out.len())?;
        for (view, out) in views.iter().zip(out.iter()) {
            out.check(view.camera)?;
        }
        check(scene, views)?;
        if let Engine::Gpu(gpu) = &mut self.engine {
            let asked: Vec<_> =
                views.iter().zip(out.iter()).map(|(view, out)| (*view, out.outputs())).collect();
            let drawn = guarded(|| {
                let in_flight = gpu.submit(scene, &asked)?;
                gpu.collect(in_flight, out)
            });
            match drawn {
                Ok(()) => return Ok(()),
                Err(why) => self.fall_back(why)?,
            }
        }
        if let Engine::Cpu(cpu) = &mut self.engine {
            for (view, out) in views.iter().zip(out) {
                cpu.render(scene, view, out.reborrow());
            }
        }
        Ok(())
    }

    /// Starts one pass per view, for the images named beside it, and returns while the device works on them;
    /// [`Self::collect`] waits for the images. Back ends without a device have finished when this returns.
    ///
    /// With two submissions in flight the device is always busy, while the CPU prepares the next one and copies images.
    ///
    /// # Errors
    /// As for [`Self::render`].
    pub fn submit(
        &mut self,
        scene: &Scene,
        views: &[(View<'_>, Outputs)],
    ) -> Result<Submission, RenderError> {
        views.iter().try_for_each(|(view, _)| Self::check(scene, view))?;
        let asked: Vec<_> = views.iter().map(|(view, outputs)| (*view.camera, *outputs)).collect();
        if let Engine::Gpu(gpu) = &mut self.engine {
            match guarded(|| gpu.submit(scene, views)) {
                Ok(in_flight) => return Ok(Submission { asked, state: State::InFlight(in_flight) }),
                Err(why) => self.fall_back(why)?,
            }
        }
        let mut frames: Vec<Frame> =
            asked.iter().map(|(camera, outputs)| Frame::new(camera, *outputs)).collect();
        if let Engine::Cpu(cpu) = &mut self.engine {
            for ((view, _), frame) in views.iter().zip(&mut frames) {
                cpu.render(scene, view, frame.as_mut());
            }
        }
        Ok(Submission { asked, state: State::Done(frames) })
    }

    /// Waits for the images of a submission of this renderer and writes those present in each of `out`. Images that
    /// were not submitted cannot be requested.
    ///
    /// # Errors
    /// Frames that do not match the submission; [`RenderError::Lost`] if the adapter failed meanwhile: the renderer has
    /// then fallen back, and the same views can be submitted again.
    pub fn collect(&mut self, submission: Submission, out: &mut [FrameMut<'_>]) -> Result<(), RenderError> {
        let Submission { asked, state } = submission;
        check_count(asked.len(), out.len())?;
        for ((camera, submitted), out) in asked.iter().zip(out.iter()) {
            out.check(camera)?;
            let wanted = out.outputs();
            let images = [
                (wanted.rgb && !submitted.rgb, "rgb"),
                (wanted.depth && !submitted.depth, "depth_m"),
                (wanted.semantic && !submitted.semantic, "semantic"),
                (wanted.instance && !submitted.instance, "instance"),
            ];
            if let Some((_, image)) = images.into_iter().find(|(missing, _)| *missing) {
                return Err(RenderError::NotSubmitted { image });
            }
        }
        let in_flight = match state {
            State::Done(frames) => {
                frames.iter().zip(out).for_each(|(frame, out)| out.copy_from(frame));
                return Ok(());
            }
            State::InFlight(in_flight) => in_flight,
        };
        let collected = match &mut self.engine {
            Engine::Gpu(gpu) => guarded(|| gpu.collect(in_flight, out)),
            Engine::Cpu(_) => Err(self.fell_back.clone().unwrap_or_default()),
        };
        collected.or_else(|why| {
            self.fall_back(why.clone())?;
            Err(RenderError::Lost { why })
        })
    }

    /// Switches to the CPU back end.
    fn fall_back(&mut self, why: String) -> Result<(), RenderError> {
        if let Engine::Gpu(_) = self.engine {
            self.engine = Engine::Cpu(Box::new(CpuRenderer::new(self.threads)?));
            self.fell_back = Some(why);
        }
        Ok(())
    }
}

/// Calls `work`, converting a panic of the graphics interface to an error.
fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err("the graphics interface failed".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Worker threads read scenes and move renderers; this compiles only if the types allow it.
    #[test]
    fn scenes_are_sync_and_renderers_are_send() {
        fn shared<T: Send + Sync>(_: &T) {}
        fn moved<T: Send>(_: T) {}
        shared(&Scene::default());
        let renderer = Renderer::new(RenderOptions::default()).expect("no threads are needed");
        assert_eq!((renderer.backend(), renderer.backend().name()), (Backend::Cpu, "cpu"));
        assert!(renderer.backend().is_portable());
        moved(renderer);
    }
}
