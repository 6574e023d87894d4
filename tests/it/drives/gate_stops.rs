//! Stops by the gate under faults of commands, reports and pose sensors: by braking only, and permanently.

use std::path::Path;

use swerve_core::{Span, Time};
use swerve_drive::{drive_pipeline, read_scenario};
use swerve_eval::Verdict;
use swerve_flow::{Event, Observer};
use swerve_msg::truth::WorldState;
use swerve_msg::{Command, GateMode, GateOutput, StopCause};
use swerve_stack::pipeline::Pipeline;

use crate::common;

const STRAIGHT: &str = r#"name = "straight"

[road]
segments = [{ length_m = 260.0 }]
lane_width_m = 4.0

[ego]
target_speed_mps = 9.0
end_m = 150.0

[end]
timeout_s = 20.0
"#;

const BEND: &str = r#"name = "bend"

[road]
segments = [{ length_m = 25.0 }, { length_m = 150.0, curvature_1pm = 0.04 }, { length_m = 40.0 }]
lane_width_m = 4.0

[ego]
target_speed_mps = 7.0
end_m = 160.0

[end]
timeout_s = 26.0
"#;

/// A receiver with corrections and a car's IMU.
const LOCALIZER: [&str; 3] = [
    "localization.localizer=eskf",
    "sensing.gnss={ noise_m = 0.02, bias_m = 0 }",
    "sensing.imu={ accel_noise_mps2 = 0.05, accel_bias_mps2 = 0.02, gyro_noise_radps = 0.002, gyro_bias_radps = 0.0005 }",
];

/// Pedals by mode of the gate, and motion of the car.
#[derive(Default)]
struct Recorded {
    mode: GateMode,
    /// First stop by the gate, and its cause.
    stop: Option<(Time, StopCause)>,
    /// Commands to the pedals while the gate stopped or held the car, and those of them with throttle.
    braked: usize,
    throttled: usize,
    /// Stamp, position and speed.
    motion: Vec<(Time, f64, f64, f64)>,
    /// Modes of the gate, each once.
    modes: Vec<GateMode>,
}

impl Observer for Recorded {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(gate) = payload.downcast_ref::<GateOutput>() {
            self.mode = gate.mode;
            if self.modes.last() != Some(&gate.mode) {
                self.modes.push(gate.mode);
            }
            if let (None, GateMode::Stopping(cause)) = (self.stop, gate.mode) {
                self.stop = Some((publication.visible_at, cause));
            }
        } else if let Some(command) = payload.downcast_ref::<Command>() {
            let brakes = self.mode.brakes();
            self.braked += usize::from(brakes);
            self.throttled += usize::from(brakes && command.throttle > 0.0);
        } else if let Some(world) = payload.downcast_ref::<WorldState>() {
            let state = &world.ego.state;
            self.motion.push((world.stamp, state.pose.x_m, state.pose.y_m, state.speed_mps));
        }
    }
}

/// Drives `text` with a gate.
fn drive(text: &str, sets: &[&str]) -> (Recorded, Verdict) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("road.toml");
    std::fs::write(&file, text).unwrap();
    let config = common::config(&[&["gate.enabled=true"], sets].concat());
    let pipeline = Pipeline::build(&config, &read_scenario(Path::new(&file)).unwrap()).unwrap();
    let mut seen = Recorded::default();
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut [&mut seen]).unwrap();
    (seen, outcome.metrics.verdict)
}

/// Drives `text` with a gate; checks that it stops by braking only and stays there.
fn stops(text: &str, sets: &[&str]) -> (Recorded, Verdict) {
    let (seen, verdict) = drive(text, sets);
    assert!(seen.stop.is_some() && seen.braked > 500, "{sets:?}: {} commands", seen.braked);
    assert_eq!(seen.throttled, 0, "{sets:?}: of {} commands", seen.braked);
    assert!(!seen.modes[2..].contains(&GateMode::Driving), "{sets:?}: {:?}", seen.modes);
    // 9 m/s at 3 m/s² are 3 s and 14 m; with lags never more than 5 s.
    let (since, _) = seen.stop.unwrap();
    let rest = seen.motion.iter().filter(|(stamp, ..)| *stamp >= since + Span::from_ms(5000));
    let rest: Vec<_> = rest.collect();
    let (_, x_m, y_m, _) = *rest[0];
    for (stamp, x, y, speed_mps) in rest {
        assert!(speed_mps.abs() < 0.05, "{sets:?}: {speed_mps} m/s at {stamp:?}");
        let off_m2 = (x - x_m) * (x - x_m) + (y - y_m) * (y - y_m);
        assert!(off_m2 < 0.05 * 0.05, "{sets:?}: it left its place at {stamp:?}");
    }
    (seen, verdict)
}

#[test]
fn noisy_report_never_applies_throttle_during_a_stop() {
    let silent = "fault.a={ stream = \"controller\", drop = true, from_ms = 3000 }";
    for noise in ["0.1", "0.5", "2.0"] {
        let noisy = format!("fault.b={{ stream = \"report\", noise = {noise}, from_ms = 3000 }}");
        let (seen, verdict) = stops(STRAIGHT, &[silent, &noisy]);
        assert_eq!(verdict, Verdict::Stopped, "{noise}");
        // Half a second of silence, unless the report is rejected earlier.
        let (at, _) = seen.stop.unwrap();
        assert!(at > Time::from_ms(3000) && at <= Time::from_ms(3530), "{noise}: {at:?}");
    }
}

#[test]
fn other_report_faults_do_not_affect_a_stop() {
    let released = "gate.release_at_ms=3000";
    for what in [
        "drop = true",
        "nan = true",
        "freeze_ms = 60000",
        "delay_ms = 2000",
        "noise = 0.5, probability = 0.3",
    ] {
        let fault = format!("fault.b={{ stream = \"report\", {what}, from_ms = 2900 }}");
        let (_, verdict) = stops(STRAIGHT, &[released, &fault]);
        assert_eq!(verdict, Verdict::Stopped, "{what}");
    }
}

#[test]
fn lost_pose_does_not_move_a_stopped_car() {
    // IMU and wheels are silent for 3 s on a bend: the car's rotation is unknown.
    let silent = ["imu", "odometry"].map(|stream| {
        format!(
            "fault.no_{stream}={{ stream = \"{stream}\", drop = true, from_ms = 8000, until_ms = 11000 }}"
        )
    });
    for noise in ["0", "0.1", "0.5"] {
        let noisy = format!("fault.b={{ stream = \"report\", noise = {noise}, from_ms = 8000 }}");
        let (seen, verdict) = stops(BEND, &[&LOCALIZER[..], &[&silent[0], &silent[1], &noisy]].concat());
        assert_eq!(verdict, Verdict::Stopped, "{noise}");
        // Half a second of mode `lost`, and 0.15 s; the report itself may be rejected earlier.
        let (at, _) = seen.stop.unwrap();
        assert!(at > Time::from_ms(8000) && at <= Time::from_ms(9000), "{noise}: {at:?}");
    }
}

#[test]
fn pose_inconsistent_with_the_wheels_stops_the_car_on_the_road() {
    // Noise of half a metre from 8 s on: jumps by more than the wheels moved within one second.
    let noisy = "fault.a={ stream = \"localizer\", noise = 0.5, from_ms = 8000, until_ms = 11000 }";
    for road in [BEND, STRAIGHT] {
        for seed in ["seed=1", "seed=2", "seed=3"] {
            let (seen, verdict) = stops(road, &[&LOCALIZER[..], &[noisy, seed]].concat());
            let (at, cause) = seen.stop.unwrap();
            assert_eq!((cause, verdict), (StopCause::PoseImplausible, Verdict::Stopped), "{seed} at {at:?}");
            assert!(at > Time::from_ms(8000) && at <= Time::from_ms(9500), "{seed}: {at:?}");
        }
    }
}

#[test]
fn faulty_imu_is_bridged_by_wheels_and_fixes_and_the_gate_permits_driving() {
    for what in ["drop = true", "freeze_ms = 3000", "noise = 20"] {
        for (road, from_ms) in [(BEND, 3200), (BEND, 8000), (STRAIGHT, 9000)] {
            let until_ms = from_ms + 3000;
            let fault =
                format!("fault.a={{ stream = \"imu\", {what}, from_ms = {from_ms}, until_ms = {until_ms} }}");
            let (seen, verdict) = drive(road, &[&LOCALIZER[..], &[&fault]].concat());
            // Leaving the road would end it at once.
            assert!(
                matches!(verdict, Verdict::Completed | Verdict::Stopped),
                "{what} {from_ms}: {verdict:?}"
            );
            assert_eq!(seen.throttled, 0, "{what} {from_ms}");
            assert!(seen.stop.is_none() || what == "noise = 20", "{what} {from_ms}: {:?}", seen.stop);
        }
    }
}
