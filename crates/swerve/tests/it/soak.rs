//! Long drives: memory, descriptors and threads stay constant. `SWERVE_SOAK_SECONDS=3600` sets the duration.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Stdio;

use crate::live::{Car, domain, has_car};
use crate::support::{Bench, Said, alone};

const SPEED_MPS: f64 = 8.0;

/// A road with bends to both sides, as long as the drive.
fn road(seconds: f64) -> String {
    let bends = "  { length_m = 60.0 },\n  { length_m = 60.0, curvature_1pm = 0.01 },\n  \
        { length_m = 60.0, curvature_1pm = -0.01 },\n";
    let times = (SPEED_MPS * seconds / 180.0).ceil() as usize + 1;
    let end_m = 180 * times - 20;
    format!(
        "name = \"long\"\n[road]\nsegments = [\n{}]\nlane_width_m = 4.0\n[ego]\ntarget_speed_mps = {SPEED_MPS}\n\
         end_m = {end_m}.0\n[end]\ntimeout_s = {}\n",
        bends.repeat(times),
        2.0 * seconds + 60.0
    )
}

/// Resources held by the processes of a call, in total.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
struct Held {
    processes: usize,
    memory_kib: u64,
    descriptors: usize,
    threads: u64,
}

impl Held {
    /// Resources of a process and its descendants; zero once it has ended.
    fn by(root: u32) -> Self {
        let mut parents = BTreeMap::new();
        for entry in std::fs::read_dir("/proc").unwrap().map_while(Result::ok) {
            let Some(id) = entry.file_name().to_str().and_then(|name| name.parse::<u32>().ok()) else {
                continue;
            };
            let status = std::fs::read_to_string(entry.path().join("status")).unwrap_or_default();
            parents.insert(id, (number(&status, "PPid:"), status));
        }
        let is_of_root = |mut id: u32| {
            while id != root {
                let Some(&(parent, _)) = parents.get(&id) else { return false };
                id = parent as u32;
            }
            true
        };
        let mut held = Self::default();
        for (&id, (_, status)) in parents.iter().filter(|(id, _)| is_of_root(**id)) {
            held.processes += 1;
            held.memory_kib += number(status, "VmRSS:");
            held.threads += number(status, "Threads:");
            held.descriptors += std::fs::read_dir(format!("/proc/{id}/fd")).map_or(0, Iterator::count);
        }
        held
    }

    fn max(self, other: Self) -> Self {
        Self {
            processes: self.processes.max(other.processes),
            memory_kib: self.memory_kib.max(other.memory_kib),
            descriptors: self.descriptors.max(other.descriptors),
            threads: self.threads.max(other.threads),
        }
    }
}

fn number(status: &str, key: &str) -> u64 {
    let line = status.lines().find_map(|line| line.strip_prefix(key));
    line.and_then(|rest| rest.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

/// Maximum in each quarter of the time, from one sample per second.
fn quarters(samples: &[Held]) -> [Held; 4] {
    let most = |k: usize| {
        let of_quarter = &samples[samples.len() * k / 4..samples.len() * (k + 1) / 4];
        of_quarter.iter().copied().fold(Held::default(), Held::max)
    };
    [most(0), most(1), most(2), most(3)]
}

/// A third-party car is driven with log, safety gate and a separate transport process.
#[test]
#[ignore = "real clock, Cyclone DDS"]
fn long_drive_takes_no_more_memory_than_a_short_one() {
    if !has_car() || !Path::new("/proc/self/status").exists() {
        return;
    }
    let _alone = alone();
    let seconds: f64 = std::env::var("SWERVE_SOAK_SECONDS").map_or(20.0, |s| s.parse().unwrap());
    let bench = Bench::new();
    bench.write("long.toml", &road(seconds));
    bench.write("car.toml", "[live]\nroute = \"long.toml\"\n[ros2]\nvehicle = \"autoware\"\n");
    let mut car = Car::start(domain(7), "autoware", &[]);
    let mut call = bench.command(&["live", "car.toml", "--out", "o", "--enable", "at-start"]);
    call.args(["--seconds", &seconds.to_string()]);
    call.envs([("ROS_DOMAIN_ID", domain(7).to_string()), ("ROS_LOCALHOST_ONLY", "1".into())]);
    let mut call = call.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut samples = Vec::new();
    while call.try_wait().unwrap().is_none() && (samples.len() as f64) < seconds {
        samples.push(Held::by(call.id()));
        car.await_second();
    }
    let said = Said::of(&call.wait_with_output().unwrap());
    let car = car.end();
    assert!(said.code == Some(0), "{said:?}");
    let held = quarters(&samples);
    let log_bytes = bench.path("o/log.mcap").metadata().unwrap().len();
    println!("{seconds} s, log of {:.1} MB, at the most in each quarter:", log_bytes as f64 * 1e-6);
    held.iter().for_each(|quarter| println!("{quarter:?}"));
    let driven_m: f64 = car.windows(2).map(|pair| pair[1]["speed"].as_f64().unwrap()).sum();
    assert!(driven_m > 0.5 * SPEED_MPS * seconds, "{driven_m} m by its own word, in {seconds} s");
    let [_, early, _, late] = held;
    assert!(early.processes >= 2, "the transport is a process of its own: {early:?}");
    let bound_kib = early.memory_kib + early.memory_kib / 20 + (8 << 10);
    assert!(late.memory_kib <= bound_kib, "{} KiB, expected at most {bound_kib}", late.memory_kib);
    assert!(late.descriptors <= early.descriptors + 2, "descriptors: {early:?}, then {late:?}");
    assert!(late.threads <= early.threads, "threads: {early:?}, then {late:?}");
}
