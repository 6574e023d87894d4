//! Camera frames: each drawn on a thread of the run, or all of one instant together on an adapter.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use swerve_camera::{Camera, FrameMut, Outputs, RenderError, Renderer, Submission, View};
use swerve_core::Time;
use swerve_flow::{Promise, Workers};
use swerve_geom::{Ego, Transform};
use swerve_msg::block::Memory;
use swerve_msg::truth::EgoTruth;
use swerve_msg::{CameraInfo, Encoding, Image, Pixels};
use swerve_scene::Scene;

use crate::stage::{Pool, SharedStage, Stage, lock};
use crate::street::{EGO_INSTANCE, motion_of};

/// Encodings of the images, in the order of the ports.
const ENCODINGS: [Encoding; 4] =
    [Encoding::Rgb8, Encoding::DepthF32M, Encoding::ClassU8, Encoding::InstanceU32];

/// Submissions in flight on an adapter while another one is prepared or read back.
const ON_THE_WAY: usize = 2;

/// Images of one instant, for the ports that have one.
pub(crate) type Images = [Option<Arc<Image>>; 4];

/// A camera, and the memory of its images.
pub(crate) struct Eye {
    pub(crate) camera: Camera,
    pub(crate) ego_from_camera: Transform<Ego, swerve_geom::Camera>,
    pub(crate) info: CameraInfo,
    pub(crate) outputs: Outputs,
    /// True if the camera is so close that the ego's body would fill the image.
    pub(crate) hides_ego: bool,
    pub(crate) pools: Mutex<[Pool<Image>; 4]>,
}

impl Eye {
    /// True for each port that has images.
    pub(crate) fn wanted(&self) -> [bool; 4] {
        let Outputs { rgb, depth, semantic, instance } = self.outputs;
        [rgb, depth, semantic, instance]
    }

    /// Viewpoint at an instant.
    pub(crate) fn view(&self, stamp: Time, ego: &EgoTruth) -> View<'_> {
        let mut view = View::new(&self.camera, ego.map_from_ego * self.ego_from_camera);
        view.motion = motion_of(ego);
        view.frame = stamp.ns() as u64;
        view.hidden_instance = self.hides_ego.then_some(EGO_INSTANCE);
        view
    }

    /// Draws the images of one instant.
    pub(crate) fn shoot(
        &self,
        stage: &Stage,
        scene: &Scene,
        stamp: Time,
        ego: &EgoTruth,
    ) -> Result<Images, String> {
        let mut images = self.blank(stamp);
        let view = self.view(stamp, ego);
        stage
            .draw(|renderer| renderer.render(scene, &view, frame(&mut images)))
            .map_err(|error| error.to_string())?;
        self.seal(&mut images)?;
        Ok(images)
    }

    /// Memory for the images of one instant, held by no reader.
    fn blank(&self, stamp: Time) -> Images {
        let (width_px, height_px) = (self.camera.width_px() as u32, self.camera.height_px() as u32);
        let mut images = Images::default();
        let mut pools = lock(&self.pools);
        for (k, image) in images.iter_mut().enumerate().filter(|(k, _)| self.wanted()[*k]) {
            let make =
                |memory: Option<&dyn Memory>| Image::in_memory(memory, width_px, height_px, ENCODINGS[k]);
            let mut taken = pools[k].take(make);
            let free = Arc::get_mut(&mut taken).expect("a pool gives what nobody else holds");
            (free.stamp, free.camera) = (stamp, self.info);
            *image = Some(taken);
        }
        images
    }

    /// Prepares drawn images for publication.
    fn seal(&self, images: &mut Images) -> Result<(), String> {
        images.iter_mut().flatten().filter_map(Arc::get_mut).try_for_each(Image::seal)?;
        let mut pools = lock(&self.pools);
        for (image, pool) in images.iter().zip(&mut *pools) {
            image.iter().for_each(|image| pool.keep(image));
        }
        Ok(())
    }
}

/// Blank images as a renderer's output.
fn frame(images: &mut Images) -> FrameMut<'_> {
    let [rgb, depth, semantic, instance] =
        images.each_mut().map(|image| image.as_mut().and_then(Arc::get_mut));
    FrameMut {
        rgb: rgb.and_then(bytes),
        depth_m: depth.and_then(|image| match &mut image.pixels {
            Pixels::DepthF32M(numbers) => Some(&mut numbers[..]),
            _ => None,
        }),
        semantic: semantic.and_then(bytes),
        instance: instance.and_then(|image| match &mut image.pixels {
            Pixels::InstanceU32(numbers) => Some(&mut numbers[..]),
            _ => None,
        }),
    }
}

fn bytes(image: &mut Image) -> Option<&mut [u8]> {
    match &mut image.pixels {
        Pixels::Rgb8(numbers) | Pixels::ClassU8(numbers) => Some(&mut numbers[..]),
        _ => None,
    }
}

/// A frame to be drawn by threads of the run, and the promises of its images.
pub(crate) struct Shot {
    pub(crate) eye: Arc<Eye>,
    pub(crate) scene: Arc<Scene>,
    pub(crate) stamp: Time,
    pub(crate) ego: EgoTruth,
    pub(crate) promises: [Option<Promise<Image>>; 4],
}

impl Shot {
    /// Passes the frame to the threads of the run: to any of them where frames are drawn one by one, to the one that
    /// uses the adapter where there is one.
    pub(crate) fn leave(self, stage: &SharedStage, shots: &Arc<Shots>, workers: &Workers) {
        let (stage, shots) = (stage.clone(), shots.clone());
        if stage.draws_at_once() {
            workers.spawn(move || {
                let shot = self.eye.shoot(&stage, &self.scene, self.stamp, &self.ego);
                self.keep(shot);
            });
        } else if shots.add(self) {
            let others = workers.clone();
            workers.spawn(move || stage.draw(|renderer| shots.draw(renderer, &others)));
        }
    }

    fn keep(self, images: Result<Images, String>) {
        for (k, promise) in self.promises.into_iter().enumerate() {
            let Some(promise) = promise else { continue };
            match &images {
                Ok(images) => images[k].clone().map_or((), |image| promise.keep(image)),
                Err(error) => promise.fail(error.as_str()),
            }
        }
    }
}

/// Frames waiting for the adapter, oldest first.
#[derive(Default)]
pub(crate) struct Shots {
    queue: Mutex<Queue>,
}

#[derive(Default)]
struct Queue {
    waiting: VecDeque<Shot>,
    /// True while a thread draws them.
    is_drawn: bool,
}

impl Shots {
    /// Adds a frame and returns true if no thread draws frames yet.
    fn add(&self, shot: Shot) -> bool {
        let mut queue = lock(&self.queue);
        queue.waiting.push_back(shot);
        !std::mem::replace(&mut queue.is_drawn, true)
    }

    /// Draws all waiting frames, including those that arrive meanwhile: frames of one scene in one submission, the next
    /// one prepared while the adapter draws, images published by `others`.
    fn draw(&self, renderer: &mut Renderer, others: &Workers) {
        let _left = LeftToNobody(self);
        let mut drawing: VecDeque<Drawing> = VecDeque::new();
        while let Some(shots) = self.next(drawing.is_empty()) {
            let is_none = shots.is_empty();
            if !is_none {
                drawing.push_back(Drawing::begin(renderer, shots));
            }
            if (is_none || drawing.len() > ON_THE_WAY)
                && let Some(oldest) = drawing.pop_front()
            {
                oldest.end(renderer, others);
            }
        }
    }

    /// Next frames of one scene, empty if none wait; `None` ends the drawing, which must have nothing in flight then.
    fn next(&self, may_end: bool) -> Option<Vec<Shot>> {
        let mut queue = lock(&self.queue);
        let same = |shot: &&Shot| Arc::ptr_eq(&shot.scene, &queue.waiting[0].scene);
        let count = queue.waiting.iter().take_while(same).count();
        queue.is_drawn = count > 0 || !may_end;
        queue.is_drawn.then(|| queue.waiting.drain(..count).collect())
    }
}

/// Drops the waiting frames if drawing panics: their promises fail, and the run ends instead of waiting for them.
struct LeftToNobody<'a>(&'a Shots);

impl Drop for LeftToNobody<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let left = std::mem::take(&mut *lock(&self.0.queue));
            drop(left);
        }
    }
}

/// Frames in flight on the adapter.
struct Drawing {
    shots: Vec<Shot>,
    submission: Result<Submission, RenderError>,
}

impl Drawing {
    fn begin(renderer: &mut Renderer, shots: Vec<Shot>) -> Self {
        let submission = submit(renderer, &shots);
        Self { shots, submission }
    }

    fn end(self, renderer: &mut Renderer, others: &Workers) {
        let Self { shots, submission } = self;
        let mut images: Vec<Images> = shots.iter().map(|shot| shot.eye.blank(shot.stamp)).collect();
        let mut collect = |renderer: &mut Renderer, submission| {
            renderer.collect(submission, &mut images.iter_mut().map(frame).collect::<Vec<_>>())
        };
        let drawn = match submission.and_then(|submission| collect(renderer, submission)) {
            // The renderer has switched from its adapter to the processor.
            Err(RenderError::Lost { .. }) => {
                submit(renderer, &shots).and_then(|submission| collect(renderer, submission))
            }
            drawn => drawn,
        };
        let drawn = drawn.map_err(|error| error.to_string());
        for (shot, mut images) in shots.into_iter().zip(images) {
            let drawn = drawn.clone();
            // Digests are computed where the promises are kept.
            others.spawn(move || {
                let sealed = drawn.and_then(|()| shot.eye.seal(&mut images));
                shot.keep(sealed.map(|()| images));
            });
        }
    }
}

/// Submits frames of one scene to the renderer.
fn submit(renderer: &mut Renderer, shots: &[Shot]) -> Result<Submission, RenderError> {
    let views: Vec<_> =
        shots.iter().map(|shot| (shot.eye.view(shot.stamp, &shot.ego), shot.eye.outputs)).collect();
    renderer.submit(&shots[0].scene, &views)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panic_while_drawing_drops_waiting_frames() {
        let shots = Shots::default();
        lock(&shots.queue).is_drawn = true;
        let drawn = std::panic::catch_unwind(|| {
            let _left = LeftToNobody(&shots);
            panic!("an adapter did what it never does");
        });
        assert!(drawn.is_err());
        assert!(!lock(&shots.queue).is_drawn, "the next frame is drawn by another thread");
        {
            let _left = LeftToNobody(&shots);
            lock(&shots.queue).is_drawn = true;
        }
        assert!(lock(&shots.queue).is_drawn, "without a panic it changes nothing");
    }
}
