//! Swerve with custom operators, algorithms and a message, which all of its commands know.

mod barriers;
mod cautious;
mod clear_ahead;
mod colourful;
mod fading;
mod nearest_ahead;
mod nearest_box;
mod nearest_points;
mod pulled;
mod pursuit;
mod slow_down;

use std::process::ExitCode;

use swerve::Registry;

fn main() -> ExitCode {
    swerve::main(
        Registry::standard()
            .with::<nearest_ahead::NearestAhead>()
            .with::<slow_down::SlowDown>()
            .with::<barriers::Barriers>()
            .with_planner::<cautious::Cautious>()
            .with_controller::<pursuit::Pursuit>()
            .with_predictor::<fading::Fading>()
            .with_detector::<colourful::Colourful>()
            .with_lidar_detector::<nearest_points::NearestPoints>()
            .with_tracker::<nearest_box::NearestBox>()
            .with_localizer::<pulled::Pulled>()
            .with_view(clear_ahead::show),
    )
}
