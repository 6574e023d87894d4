//! Pictures of a running drive: the driver's view and a chase view, with plan and obstacles drawn in.
//!
//! For each camera of the configuration, the published images are written to one folder, and the same images with the
//! detections of the operators that read them to another.
//! The frames are written by an observer, which does not affect the run. Identical runs give identical files.

mod annotate;
mod colours;
mod overlay;
#[cfg(test)]
mod tests;
mod video;

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use swerve_camera::{Camera, CameraSpec, Frame, Intrinsics, Outputs, Renderer, View, mount};
use swerve_core::{Span, Time};
use swerve_flow::{Event, Observer};
use swerve_geom::{Ego, Map, Transform};
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorNames, Detections, Image, Lanes, ObstacleList, Plan, TrafficLights};
use swerve_report::files::{write_png_by, written_by};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::assembly::{Assembly, Placed};
use swerve_stack::street::{EGO_INSTANCE, Street};

use annotate::Canvas;
use video::Video;

pub use overlay::overlay;

/// Interval between pictures.
const PERIOD: Span = Span::from_ms(50);
/// PNG comment that marks a picture as written by this module; pictures without it are foreign, whatever their name.
const OURS: &str = "swerve --frames";
/// Suffix of the folder with a stream's images and detections.
const SEEN: &str = "seen";
/// Length of the history of ego poses, for messages that are published later than their stamp.
const MEMORY: Span = Span::from_ms(1000);
/// Sizes in pixels: the chase view, and beside it, where it hides nothing important, the driver's view above the top
/// view.
const WIDTH_PX: u32 = 1280;
const HEIGHT_PX: u32 = 720;
const BESIDE_PX: u32 = 448;
const DRIVER_HEIGHT_PX: u32 = 252;

/// Contents of a picture besides the world.
#[derive(Default)]
struct Contents {
    world: Option<WorldState>,
    plan: Option<Plan>,
    obstacles: Option<ObstacleList>,
    /// Names of the actors, in the order of their ids.
    names: ActorNames,
    /// Latest lane lines of each operator, and the ego pose at that time.
    lanes: BTreeMap<String, (Lanes, Transform<Map, Ego>)>,
    /// Recent ego poses, oldest first.
    poses: VecDeque<(Time, Transform<Map, Ego>)>,
}

/// Destinations of the pictures.
#[derive(Clone, Copy, Default, Debug)]
pub struct Sinks<'a> {
    /// Folder for one file per picture, and for the images of the configured cameras.
    pub folder: Option<&'a Path>,
    /// Video file.
    pub video: Option<&'a Path>,
}

impl Sinks<'_> {
    /// True if no pictures are requested.
    pub fn is_none(&self) -> bool {
        self.folder.is_none() && self.video.is_none()
    }
}

/// Draws a picture of the run every 50 ms.
pub struct Frames {
    folder: Option<PathBuf>,
    /// Pictures of an earlier run, deleted when the first new one is written.
    earlier: Vec<PathBuf>,
    video: Option<Video>,
    sheet: Frame,
    title: String,
    street: Street,
    renderer: Renderer,
    follower: Eye,
    driver: Eye,
    above: Eye,
    next: Time,
    count: usize,
    seen: Contents,
    /// Camera and number of written images of each image stream.
    cameras: BTreeMap<String, Camera>,
    written: BTreeMap<String, usize>,
    /// Newest image of each stream with its number, which waits for detections; and the stream read by each detector.
    waiting: BTreeMap<String, (Time, usize, Frame)>,
    detectors: BTreeMap<String, String>,
    failure: Option<anyhow::Error>,
}

impl Contents {
    /// Draws everything except the world over a view of it.
    fn draw(&self, canvas: &mut Canvas<'_>, world: &WorldState) {
        if let Some(plan) = &self.plan {
            canvas.plan(plan, world.stamp);
        }
        self.lanes.values().for_each(|(lanes, map_from_ego)| canvas.lanes(lanes, *map_from_ego));
        if let Some(list) = &self.obstacles {
            canvas.obstacles(list, world, &self.names);
        }
    }
}

/// A camera on the ego with an image buffer.
struct Eye {
    camera: Camera,
    ego_from_camera: Transform<Ego, swerve_geom::Camera>,
    frame: Frame,
    hides_ego: bool,
    /// True for a map view that ignores fog and rain: at 60 m little of the road would be visible.
    is_map: bool,
}

impl Eye {
    fn new(
        (width_px, height_px): (u32, u32),
        fov_deg: f64,
        at_m: [f64; 3],
        pitch_deg: f64,
    ) -> anyhow::Result<Self> {
        let intrinsics = Intrinsics::HorizontalFovRad(fov_deg.to_radians());
        let camera = Camera::new(CameraSpec { width_px, height_px, intrinsics, ..CameraSpec::default() })?;
        let ego_from_camera = mount(at_m, 0.0, pitch_deg.to_radians(), 0.0);
        Ok(Self {
            frame: Frame::new(&camera, Outputs::RGB),
            camera,
            ego_from_camera,
            hides_ego: false,
            is_map: false,
        })
    }

    fn look(
        &mut self,
        renderer: &mut Renderer,
        street: &Street,
        map_from_ego: Transform<Map, Ego>,
    ) -> anyhow::Result<()> {
        let mut view = View::new(&self.camera, map_from_ego * self.ego_from_camera);
        view.hidden_instance = self.hides_ego.then_some(EGO_INSTANCE);
        if !self.is_map {
            return Ok(renderer.render(street.scene(), &view, self.frame.as_mut())?);
        }
        let mut scene = street.scene().clone();
        (scene.weather.fog_1pm, scene.weather.rain) = (0.0, 0.0);
        Ok(renderer.render(&scene, &view, self.frame.as_mut())?)
    }
}

impl Frames {
    /// Creates a writer for pictures of a scenario. Creates the folder; pictures of an earlier run are deleted when the
    /// first new one is written.
    ///
    /// # Errors
    /// If the folder cannot be created or contains foreign files, or if a video is requested without `ffmpeg`.
    pub fn create(to: Sinks<'_>, title: String, scenario: &Scenario, config: &Setup) -> anyhow::Result<Self> {
        let (shape, render) = (&config.sim.vehicle.shape, &config.render);
        let size_px = (WIDTH_PX + BESIDE_PX, HEIGHT_PX);
        let mut earlier = Vec::new();
        if let Some(folder) = to.folder {
            std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
            pictures_in(folder, &mut earlier)?;
        }
        let video = to.video.map(|file| Video::create(file, size_px, 1.0 / PERIOD.as_secs())).transpose()?;
        let ahead_m = shape.center_ahead_m();
        let assembly = Assembly::new(config)?;
        let looks_at = |placed: &Placed| {
            assembly.image_of(&placed.name).map(|stream| (placed.name.clone(), stream.to_owned()))
        };
        let follower = Eye::new((WIDTH_PX, HEIGHT_PX), 70.0, [ahead_m - 9.5, 0.0, 4.2], 14.0)?;
        let eye_m = [ahead_m + 0.35, 0.36, 1.25];
        let mut driver = Eye::new((BESIDE_PX, DRIVER_HEIGHT_PX), 75.0, eye_m, 2.0)?;
        driver.hides_ego = true;
        // From 7 m behind to 29 m ahead, 34 m wide.
        let above_px = (BESIDE_PX, HEIGHT_PX - DRIVER_HEIGHT_PX);
        let mut above = Eye::new(above_px, 32.0, [ahead_m + 11.0, 0.0, 60.0], 90.0)?;
        above.is_map = true;
        let cameras = config
            .camera
            .iter()
            .map(|(name, camera)| Ok::<_, swerve_core::ParamError>((name.clone(), camera.camera(0)?)));
        Ok(Self {
            folder: to.folder.map(Path::to_owned),
            earlier,
            video,
            sheet: sheet(size_px),
            title,
            street: Street::new(scenario, shape, render.weather, config.seed),
            renderer: render.renderer(0)?,
            follower,
            driver,
            above,
            next: Time::ZERO,
            count: 0,
            seen: Contents { names: scenario.names(), ..Contents::default() },
            cameras: cameras.collect::<Result<_, _>>()?,
            written: BTreeMap::new(),
            waiting: BTreeMap::new(),
            detectors: assembly.operators().iter().filter_map(looks_at).collect(),
            failure: None,
        })
    }

    /// Finishes and returns the number of pictures written.
    ///
    /// # Errors
    /// The first error while writing pictures.
    pub fn finish(&mut self) -> anyhow::Result<usize> {
        let waiting: Vec<String> = self.waiting.keys().cloned().collect();
        let written = waiting.iter().try_for_each(|stream| self.write(stream));
        let filmed = self.video.take().map_or(Ok(()), |mut video| video.finish());
        let failure = self.failure.take().or(written.and(filmed).err());
        failure.map_or(Ok(self.count), Err)
    }

    /// Writes an image of a configured camera as published. If operators read it, a copy waits for their detections: it
    /// is written with their boxes, or without them when the next image arrives.
    fn camera(&mut self, operator: &str, stream: &str, image: &Image) -> anyhow::Result<()> {
        if self.folder.is_none() {
            return Ok(());
        }
        let (width_px, height_px) = (image.width_px as usize, image.height_px as usize);
        let mut frame = Frame { width_px, height_px, rgb: colours::of(&image.pixels), ..Frame::default() };
        let count = self.written.entry(stream.to_owned()).or_default();
        let number = *count;
        *count += 1;
        self.write_image(&stream.replace('.', "/"), number, &frame)?;
        self.write(stream)?;
        let is_read = self.detectors.values().any(|read| read == stream);
        if let (true, Some(camera), Some(world)) = (is_read, self.cameras.get(operator), &self.seen.world) {
            let camera_from_map = (world.ego.map_from_ego * image.camera.ego_from_camera).inverse();
            let mut canvas = Canvas::new(&mut frame, camera, camera_from_map);
            self.seen.lanes.values().for_each(|(lanes, map_from_ego)| canvas.lanes(lanes, *map_from_ego));
            self.waiting.insert(stream.to_owned(), (image.stamp, number, frame));
        }
        Ok(())
    }

    /// Draws a detector's boxes into the image that it processed, if that is still the newest one.
    fn found(&mut self, operator: &str, found: &Detections) -> anyhow::Result<()> {
        if !self.draw(operator, found.stamp, |canvas| canvas.found(found)) {
            return Ok(());
        }
        self.detectors.get(operator).cloned().map_or(Ok(()), |stream| self.write(&stream))
    }

    /// Draws into the image of this stamp that an operator processed; returns true if it is still waiting.
    fn draw(&mut self, operator: &str, stamp: Time, draw: impl FnOnce(&mut Canvas<'_>)) -> bool {
        let Some(stream) = self.detectors.get(operator) else { return false };
        let newest = self.waiting.get_mut(stream).filter(|(at, ..)| *at == stamp);
        let camera = stream.split('.').next().and_then(|camera| self.cameras.get(camera));
        let (Some((.., frame)), Some(camera)) = (newest, camera) else { return false };
        draw(&mut Canvas::new(frame, camera, nowhere()));
        true
    }

    /// Writes the waiting image of a stream with its annotations.
    fn write(&mut self, stream: &str) -> anyhow::Result<()> {
        let Some((_, number, frame)) = self.waiting.remove(stream) else { return Ok(()) };
        self.write_image(&format!("{}_{SEEN}", stream.replace('.', "/")), number, &frame)
    }

    /// Writes an image into a subfolder, which is created for the first one.
    fn write_image(&self, below: &str, number: usize, frame: &Frame) -> anyhow::Result<()> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let folder = folder.join(below);
        if !folder.is_dir() {
            std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        }
        write_picture(&folder.join(format!("{number:05}.png")), frame)
    }

    /// Deletes the pictures of an earlier run, once.
    fn clear(&mut self) -> anyhow::Result<()> {
        let earlier = std::mem::take(&mut self.earlier);
        earlier.iter().try_for_each(|path| {
            std::fs::remove_file(path).with_context(|| format!("removing {}", path.display()))
        })
    }

    fn take(&mut self, world: &WorldState) -> anyhow::Result<()> {
        self.street.show(world);
        // Roll and pitch of the body affect the driver's view, not the chase view.
        let level = level(world.ego.map_from_ego);
        self.driver.look(&mut self.renderer, &self.street, world.ego.map_from_ego)?;
        for eye in [&mut self.follower, &mut self.above] {
            eye.look(&mut self.renderer, &self.street, level)?;
            let camera_from_map = (level * eye.ego_from_camera).inverse();
            let mut canvas = Canvas::new(&mut eye.frame, &eye.camera, camera_from_map);
            self.seen.draw(&mut canvas, world);
        }
        paste(&mut self.sheet, &self.follower.frame, (0, 0));
        paste(&mut self.sheet, &self.driver.frame, (WIDTH_PX, 0));
        paste(&mut self.sheet, &self.above.frame, (WIDTH_PX, DRIVER_HEIGHT_PX));
        let mut canvas = Canvas::new(&mut self.sheet, &self.follower.camera, nowhere());
        canvas.head(&self.title, world, self.seen.plan.as_ref());
        if let Some(folder) = &self.folder {
            write_picture(&folder.join(format!("{:05}.png", self.count)), &self.sheet)?;
        }
        if let Some(video) = &mut self.video {
            video.take(&self.sheet)?;
        }
        self.count += 1;
        Ok(())
    }
}

impl Observer for Frames {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Err(error) = self.clear() {
            self.failure.get_or_insert(error);
        }
        if let Some(image) = payload.downcast_ref::<Image>() {
            if self.failure.is_none() {
                self.failure = self.camera(publication.operator, publication.stream, image).err();
            }
        } else if let Some(found) = payload.downcast_ref::<Detections>() {
            if self.failure.is_none() {
                self.failure = self.found(publication.operator, found).err();
            }
        } else if let Some(seen) = payload.downcast_ref::<TrafficLights>() {
            // The image still waits for boxes or for the next image.
            self.draw(publication.operator, seen.stamp, |canvas| canvas.lights(seen));
        } else if let Some(plan) = payload.downcast_ref::<Plan>() {
            self.seen.plan = Some(plan.clone());
        } else if let Some(list) = payload.downcast_ref::<ObstacleList>() {
            self.seen.obstacles = Some(list.clone());
        } else if let Some(lanes) = payload.downcast_ref::<Lanes>() {
            let then = self.seen.poses.iter().rev().find(|(at, _)| *at <= lanes.stamp);
            if let Some((_, map_from_ego)) = then {
                self.seen.lanes.insert(publication.operator.to_owned(), (lanes.clone(), *map_from_ego));
            }
        } else if let Some(world) = payload.downcast_ref::<WorldState>()
            && self.failure.is_none()
        {
            self.seen.world = Some(world.clone());
            self.seen.poses.push_back((world.stamp, world.ego.map_from_ego));
            while self.seen.poses.front().is_some_and(|(at, _)| world.stamp - *at > MEMORY) {
                self.seen.poses.pop_front();
            }
            if world.stamp >= self.next || world.ended.is_some() {
                self.next = world.stamp + PERIOD;
                self.failure = self.take(world).err();
            }
        }
    }
}

/// Placeholder pose for drawings in image coordinates.
fn nowhere() -> Transform<swerve_geom::Camera, Map> {
    Transform::from_roll_pitch_yaw(swerve_geom::Point::default(), 0.0, 0.0, 0.0)
}

/// Creates a black picture.
fn sheet((width_px, height_px): (u32, u32)) -> Frame {
    let (width_px, height_px) = (width_px as usize, height_px as usize);
    Frame { width_px, height_px, rgb: vec![0; 3 * width_px * height_px], ..Frame::default() }
}

/// Copies a picture into a larger one with its top left corner at a position, pixels.
fn paste(sheet: &mut Frame, view: &Frame, (left, top): (u32, u32)) {
    for (row, pixels) in view.rgb.chunks_exact(3 * view.width_px).enumerate() {
        let start = 3 * ((row + top as usize) * sheet.width_px + left as usize);
        sheet.rgb[start..start + pixels.len()].copy_from_slice(pixels);
    }
}

/// The pose without roll and pitch.
fn level(pose: Transform<Map, Ego>) -> Transform<Map, Ego> {
    let ahead = pose * swerve_geom::Vector::new(1.0, 0.0, 0.0);
    let yaw_rad = swerve_geom::math::atan2(ahead.coords.y, ahead.coords.x);
    Transform::from_roll_pitch_yaw(pose.origin(), 0.0, 0.0, yaw_rad)
}

/// Collects the pictures of an earlier run in a folder and its subfolders.
///
/// # Errors
/// If anything else is there, so that files kept beside the pictures or under their names are not lost. Hidden files,
/// such as those of file managers, are ignored.
fn pictures_in(folder: &Path, found: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("reading {}", folder.display()))?;
    for entry in entries {
        let entry = entry.with_context(|| format!("reading {}", folder.display()))?;
        let path = entry.path();
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            pictures_in(&path, found)?;
        } else if written_by(OURS, &path) {
            found.push(path);
        } else if !entry.file_name().to_string_lossy().starts_with('.') {
            anyhow::bail!(
                "--frames: {} is not a picture written by --frames: expected a folder without other files",
                path.display()
            );
        }
    }
    Ok(())
}

/// Writes the colour image of a frame.
fn write_picture(path: &Path, frame: &Frame) -> anyhow::Result<()> {
    let size = (frame.width_px as u32, frame.height_px as u32);
    write_png_by(Some(OURS), path, size, (png::ColorType::Rgb, png::BitDepth::Eight), &frame.rgb)
}
