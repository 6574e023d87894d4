//! Validation of inputs: scenes, views, frames.

use swerve_geom::Transform;
use swerve_scene::{Motion, Scene};

use crate::View;
use crate::error::RenderError;

/// Checks that there is one frame per view.
pub(crate) fn check_count(views: usize, frames: usize) -> Result<(), RenderError> {
    if views == frames { Ok(()) } else { Err(RenderError::Count { views, frames }) }
}

/// Checks that views of a scene can be rendered.
pub(crate) fn check(scene: &Scene, views: &[View<'_>]) -> Result<(), RenderError> {
    scene.weather.check()?;
    check_scene(scene)?;
    views.iter().try_for_each(check_view)
}

fn motion_is_finite(motion: &Motion) -> bool {
    motion.linear_mps.iter().chain(&motion.angular_radps).all(|x| x.is_finite())
}

fn pose_is_finite<A, B>(pose: &Transform<A, B>) -> bool {
    let (origin, rotation): ([f64; 3], [f64; 4]) =
        (pose.origin().coords.into(), pose.rotation().coords.into());
    origin.iter().chain(&rotation).all(|x| x.is_finite())
}

fn expect_finite(finite: bool, what: &'static str) -> Result<(), RenderError> {
    if finite { Ok(()) } else { Err(RenderError::NotFinite { what }) }
}

fn check_view(view: &View<'_>) -> Result<(), RenderError> {
    expect_finite(pose_is_finite(&view.map_from_camera), "the camera's pose")?;
    expect_finite(motion_is_finite(&view.motion), "the camera's motion")
}

fn check_scene(scene: &Scene) -> Result<(), RenderError> {
    let sun = &scene.sun;
    expect_finite(sun.azimuth_rad.is_finite() && sun.elevation_rad.is_finite(), "the sun's direction")?;
    for instance in scene.statics().instances().iter().chain(&scene.dynamics) {
        expect_finite(pose_is_finite(&instance.map_from_body), "an instance's pose")?;
        expect_finite(motion_is_finite(&instance.motion), "an instance's motion")?;
    }
    for light in &scene.lights {
        let numbers = [light.range_m, light.cos_inner, light.cos_outer];
        let finite = light.position_m.iter().chain(&light.direction).all(|x| x.is_finite())
            && light.intensity.iter().chain(&numbers).all(|x| x.is_finite());
        expect_finite(finite, "a light")?;
    }
    Ok(())
}
