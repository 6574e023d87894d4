//! A command writer whose clock is adjusted.

use super::{Car, Stack, causes};
use crate::support::alone;

#[test]
#[ignore = "real clock"]
fn clock_change_while_driving_stops_the_car_until_re_engaged() {
    let _alone = alone();
    let mut car = Car::start(6, "34.0");
    let mut stack = Stack::start(car.network);
    stack.engage();
    stack.ahead_s = 3600;
    stack.drive(5.0, |_, _| {});
    assert!(stack.speed_mps().abs() < 0.1, "it drives on: {} m/s", stack.speed_mps());
    stack.let_in_again();
    // An hour back and forth, interleaved with good commands, which they sometimes displace.
    let mut n = 0;
    stack.drive(6.0, |stack, mut control| {
        n += 1;
        control.stamp.sec += if n % 3 == 0 { -3600 } else { 3600 };
        control.lateral.steering_tire_angle = 0.5;
        control.longitudinal.velocity = 20.0;
        control.longitudinal.acceleration = 2.0;
        stack.publish(control);
    });
    stack.drive_to_end(&mut car);
    println!("at most {:.2} m beside its lane", stack.beside_m);
    assert!(stack.beside_m < 0.5, "it was steered: {} m", stack.beside_m);
    let (metrics, told) = car.end();
    let causes = causes(&metrics);
    assert_eq!(causes[0], "clock_jump");
    assert!(
        causes.iter().all(|cause| ["clock_jump", "released", "command_timeout"].contains(cause)),
        "{causes:?}"
    );
    assert!(told.contains("the clock that stamps the commands was set"), "{told}");
}
