//! Tests of simulated time.

use super::*;

const MS: i64 = 1_000_000;

/// Message of a simulator whose clock shows this time, ms.
fn message(ms: i64) -> Clock {
    let (sec, nanosec) = ((ms / 1000) as i32, (ms % 1000 * MS) as u32);
    Clock { clock: builtin::Time { sec, nanosec } }
}

fn started(ms: i64, timeout_ms: i64) -> Simulated {
    Simulated::start(&message(ms), Span::from_ms(timeout_ms))
}

fn failure(clock: &Simulated) -> String {
    match clock.check() {
        Some(ClockEvent::Failed(what)) => what,
        other => panic!("{other:?}"),
    }
}

#[test]
fn run_time_is_the_newest_message_and_zero_at_the_first() {
    let clock = started(12_350, 60_000);
    let drive = DriveClock::Simulated(clock.clone());
    assert_eq!((drive.now(), drive.epoch_ns()), (Time::ZERO, 12_350 * MS));
    for (ms, expected) in [(12_400, 50), (12_450, 100), (12_450, 100), (12_400, 100), (13_450, 1100)] {
        clock.hear(&message(ms));
        assert_eq!(drive.now(), Time::from_ms(expected), "{ms}");
    }
    assert_eq!((clock.check(), drive.has_failed()), (None, false));
}

#[test]
fn jumps_of_simulated_time_fail_with_both_times_and_are_final() {
    for (to, expected) in [
        (0, "simulated time jumped back from 12.400 s to 0.000 s: the simulator was reset"),
        (90_000, "simulated time jumped ahead from 12.400 s to 90.000 s: expected steps of at most 10 s"),
    ] {
        let clock = started(12_350, 60_000);
        clock.hear(&message(12_400));
        clock.hear(&message(to));
        assert!(failure(&clock).starts_with(expected), "{}", failure(&clock));
        clock.hear(&message(12_450));
        let drive = DriveClock::Simulated(clock);
        assert!(drive.has_failed() && drive.now() == Time::from_ms(50));
    }
}

#[test]
fn simulated_time_that_stands_still_fails_after_the_timeout_of_real_time() {
    let clock = started(1000, 30);
    assert_eq!(clock.check(), None);
    std::thread::park_timeout(Duration::from_millis(40));
    assert_eq!(failure(&clock), "simulated time stood still at 1.000 s for 0.0 s (live.clock_timeout_s)");
}

#[test]
fn messages_that_overtake_the_clock_are_early_until_it_reaches_them() {
    let clock = started(1000, 60_000);
    let drive = DriveClock::Simulated(clock.clone());
    let stamp = |ms| Some(message(ms).clock);
    let early = |ms| drive.is_early(stamp(ms));
    assert_eq!(
        [early(1000), early(1050), early(1500), early(1501), drive.is_early(None)],
        [false, true, true, false, false]
    );
    clock.hear(&message(1050));
    assert!(!early(1050));
    assert!(!DriveClock::from(HostClock::start()).is_early(stamp(1050)));
}

#[test]
fn clock_that_is_silent_while_messages_go_on_fails() {
    let clock = started(1000, 60_000);
    let drive = DriveClock::Simulated(clock.clone());
    let hear = |ms| drive.is_early(Some(message(ms).clock));
    // Sensors with another clock are not the simulator's.
    assert!((0..20).all(|_| !hear(1_700_000_000)) && clock.check().is_none());
    assert!((0..4).all(|_| !hear(1550)) && clock.check().is_none());
    clock.hear(&message(1040));
    assert!((0..4).all(|_| !hear(1550)) && clock.check().is_none());
    assert!(!hear(1600));
    let expected = "simulated time stood still at 1.040 s while the stamps of messages reached 1.600 s: the topic \
                    `clock` is silent, or its messages are more than 0.5 s apart";
    assert_eq!(failure(&clock), expected);
}
