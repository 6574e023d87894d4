//! Speed of the traffic: vehicle updates per second of processor time on one core.
//!
//! ```sh
//! cargo run --release -p swerve-traffic --example throughput -- MAP [VEHICLES [SECONDS]]
//! ```

#![expect(clippy::print_stdout, clippy::disallowed_methods, reason = "an example that measures this host")]

use std::time::Instant;

use swerve_core::{Span, Time};
use swerve_map_io::MapFile;
use swerve_traffic::{Lights, Traffic, TrafficSetup};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().expect("expected a map");
    let mut number = |default: usize| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (vehicles, seconds) = (number(200), number(600));
    let text = std::fs::read_to_string(&file).expect("the map is a readable file");
    let map = MapFile::read(&file, &text).expect("the map is valid").map;
    let begun = Instant::now();
    let setup = TrafficSetup { vehicles, ..TrafficSetup::default() };
    let lights = Lights::of_map(&map);
    let mut traffic = Traffic::new(map, &setup, lights, 1, &[]);
    let made = begun.elapsed();
    let ticks = Span::from_secs(seconds as f64).ns() / traffic.interval().ns();
    let begun = Instant::now();
    traffic.advance_alone(Time::ZERO + traffic.interval() * ticks);
    let took_s = begun.elapsed().as_secs_f64();
    let updates = traffic.actors().len() as f64 * ticks as f64;
    println!("{} vehicles, created in {:.3} s", traffic.actors().len(), made.as_secs_f64());
    println!("{ticks} ticks in {took_s:.3} s: {:.2} million updates per second", updates * 1e-6 / took_s);
    println!("{:?}", traffic.counts());
}
