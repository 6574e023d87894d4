//! Reasons of a stop in words, with the streams that are silent or the numbers that deviate.

use swerve_core::{Span, Time};
use swerve_msg::{GateMode, StopCause};
use swerve_ros2::mapping::Purpose;

use super::intake::TopicSummary;
use super::watch::{DriveStatus, FollowFigures};

/// Age from which a stream is silent, and that age in periods of the stream.
const QUIET: Span = Span::from_ms(300);
const PERIODS: f64 = 3.0;

/// Description of a mode; `why` replaces the words of its cause.
pub(super) fn mode_words(mode: GateMode, why: Option<&str>) -> String {
    let words = |cause: StopCause| why.unwrap_or_else(|| cause.words()).to_owned();
    match mode {
        GateMode::Manual => "manual".into(),
        GateMode::Driving => "driving".into(),
        GateMode::Stopping(cause) => format!("stopping: {}", words(cause)),
        GateMode::Holding(cause) => format!("holding: {}", words(cause)),
    }
}

/// Reason of a stop. `end` is the reason for the end of the drive, if it has come.
pub(super) fn stop_reason<'a>(
    cause: StopCause,
    end: Option<&str>,
    topics: impl Iterator<Item = TopicSummary<'a>>,
    status: &DriveStatus,
    now: Time,
) -> String {
    let words = cause.words();
    let FollowFigures { commanded_rad, commanded_mps2, reported_rad, speed_mps, accel_mps2 } = status.follow;
    match cause {
        StopCause::Released => end.unwrap_or(words).to_owned(),
        StopCause::CommandTimeout | StopCause::ReportTimeout => {
            let mut silent = silent_topics(topics, now);
            // Without poses, there are no plans either: the cause is named alone.
            let planned = status.planned.filter(|planned| silent.is_empty() && now - *planned > QUIET);
            silent.extend(planned.map(|planned| format!("plans for {:.1} s", (now - planned).as_secs())));
            if silent.is_empty() { words.to_owned() } else { format!("{words}: no {}", silent.join(", no ")) }
        }
        StopCause::SteeringDeviation => {
            format!("{words}: {commanded_rad:.3} rad commanded, {reported_rad:.3} rad reported: take over")
        }
        StopCause::AccelDeviation => format!(
            "{words}: {commanded_mps2:.1} m/s² commanded, {accel_mps2:.1} m/s² measured at {speed_mps:.1} m/s: take over"
        ),
        StopCause::SpeedExcess => {
            format!("{words}: {speed_mps:.1} m/s, {commanded_mps2:.1} m/s² commanded: take over")
        }
        _ => words.to_owned(),
    }
}

/// Topics that were heard and have fallen silent, each with the time since then.
fn silent_topics<'a>(topics: impl Iterator<Item = TopicSummary<'a>>, now: Time) -> Vec<String> {
    let silent = |TopicSummary { name, role, tally, .. }: TopicSummary<'a>| {
        let heard = tally.heard.filter(|_| role.purpose() != Purpose::Switch)?;
        let age_s = (now - heard).as_secs();
        let period_s = heard.as_secs() / tally.used.max(1) as f64;
        (age_s > QUIET.as_secs().max(PERIODS * period_s)).then(|| format!("{name} for {age_s:.1} s"))
    };
    topics.filter_map(silent).collect()
}

#[cfg(test)]
mod tests {
    use swerve_ros2::clock::ClockParams;
    use swerve_ros2::mapping::Role;

    use super::super::intake::TopicTally;
    use super::super::time::TopicClock;
    use super::*;

    fn reason(
        cause: StopCause,
        end: Option<&str>,
        tallies: &[(&str, Role, TopicTally)],
        status: &DriveStatus,
    ) -> String {
        let clock = TopicClock::new(ClockParams::default());
        let topics = tallies.iter().map(|(name, role, tally)| TopicSummary {
            name,
            role: *role,
            tally,
            clock: &clock,
        });
        stop_reason(cause, end, topics, status, Time::from_ms(20_000))
    }

    #[test]
    fn silent_topics_and_plans_are_named_with_their_ages() {
        let heard = |used, ms| TopicTally { used, heard: Some(Time::from_ms(ms)), ..TopicTally::default() };
        let topics = [
            ("odometry", Role::Odometry, heard(1000, 19_400)),
            ("objects", Role::Objects, heard(180, 18_700)),
            ("velocity", Role::Velocity, heard(1000, 19_990)),
            // Once a second.
            ("gnss", Role::Gnss, heard(19, 19_000)),
            ("enable", Role::Enable, heard(1, 4_000)),
            ("imu", Role::Imu, TopicTally::default()),
        ];
        let status = DriveStatus { planned: Some(Time::from_ms(19_950)), ..DriveStatus::default() };
        let said = reason(StopCause::CommandTimeout, None, &topics, &status);
        assert_eq!(said, "no sound command: no odometry for 0.6 s, no objects for 1.3 s");
        let status = DriveStatus { planned: Some(Time::from_ms(19_000)), ..status };
        assert_eq!(
            reason(StopCause::CommandTimeout, None, &topics[2..3], &status),
            "no sound command: no plans for 1.0 s"
        );
        assert_eq!(reason(StopCause::CommandTimeout, None, &[], &DriveStatus::default()), "no sound command");
    }

    #[test]
    fn end_of_the_drive_is_not_a_release_by_a_person() {
        let status = DriveStatus::default();
        let released = |end| reason(StopCause::Released, end, &[], &status);
        assert_eq!(released(None), "the switch was released");
        assert_eq!(released(Some("the time limit was reached")), "the time limit was reached");
        let emergency = reason(StopCause::Emergency, Some("the time limit was reached"), &[], &status);
        assert_eq!(emergency, "emergency stop");
    }

    #[test]
    fn deviations_are_given_in_numbers() {
        let follow = FollowFigures {
            commanded_rad: 0.22,
            commanded_mps2: -1.31,
            reported_rad: 0.0,
            speed_mps: 7.9,
            accel_mps2: 0.72,
        };
        let status = DriveStatus { follow, ..DriveStatus::default() };
        assert_eq!(
            reason(StopCause::SteeringDeviation, None, &[], &status),
            "the steering does not follow its commands: 0.220 rad commanded, 0.000 rad reported: take over"
        );
        assert_eq!(
            reason(StopCause::AccelDeviation, None, &[], &status),
            "the vehicle does not accelerate or brake as commanded: -1.3 m/s² commanded, 0.7 m/s² measured at 7.9 m/s: \
             take over"
        );
        assert_eq!(
            reason(StopCause::SpeedExcess, None, &[], &status),
            "the vehicle is faster than permitted: 7.9 m/s, -1.3 m/s² commanded: take over"
        );
    }
}
