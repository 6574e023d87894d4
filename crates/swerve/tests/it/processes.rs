//! Runs over several processes of this program.
//!
//! `SWERVE_KILLS=50` kills that many workers at random moments, `SWERVE_SPLITS=20` drives that many random splits.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use swerve_core::{Digest, Rng, Time};
use swerve_drive::process::Processes;
use swerve_drive::program::Program;
use swerve_drive::{Outcome, drive_pipeline, read_scenario, run_start, set_up};
use swerve_flow::{Event, Observer};
use swerve_ipc::{OnLoss, Traffic};
use swerve_log::{Log, Recorder};
use swerve_msg::Supervision;
use swerve_stack::Setup;
use swerve_stack::config::process::ProcessConfig;
use swerve_stack::pipeline::Pipeline;
use swerve_text::{Document, parse_assignment};
use tempfile::TempDir;

mod called;
mod hangs;

/// Program run by the workers.
const PROGRAM: &str = env!("CARGO_BIN_EXE_swerve");
const SCENARIO: &str = "person_behind_truck";

fn program() -> Program {
    Program { path: PROGRAM.into(), arguments: Vec::new(), code: PROGRAM.into() }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn scenario_file() -> PathBuf {
    root().join("scenarios").join(SCENARIO).with_extension("toml")
}

fn config(file: &str, sets: &[&str]) -> Setup {
    let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
    let file = root().join("configs").join(file).with_extension("toml");
    Setup::load(Some(&file), &sets).unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// A small camera and a lidar, each with an observer.
const WATCHED: &str = "
[camera.front]
width_px = 240
height_px = 120
period_ms = 100
transfer_ms = 10
[lidar.roof]
preset = 'vlp_32'
[monitor.eye]
sensor = 'front'
[monitor.ear]
sensor = 'roof'
";

fn watched(operators: &[&str]) -> Setup {
    let text = format!("{WATCHED}[process.watch]\noperators = {operators:?}\n");
    Setup::from_document(&Document::parse("watched", text).unwrap(), &[]).unwrap()
}

/// The same configuration in one process.
fn together(config: &Setup) -> Setup {
    let mut together = config.clone();
    together.process.clear();
    together
}

/// A run before its start, with its processes ready.
struct Run {
    pipeline: Pipeline,
    processes: Processes,
    seed: u64,
}

fn start(config: &Setup, until: Time) -> Run {
    let mut pipeline = Pipeline::build(config, &read_scenario(&scenario_file()).unwrap()).unwrap();
    pipeline.until = until;
    let processes = Processes::start(&program(), config, &mut pipeline).unwrap();
    Run { pipeline, processes, seed: config.seed }
}

fn drive_split(config: &Setup, until: Time) -> (Outcome, Traffic) {
    let Run { pipeline, processes, seed } = start(config, until);
    let outcome = drive_pipeline(pipeline, seed, 1, &mut []).unwrap();
    (outcome, processes.traffic())
}

fn drive_here(config: &Setup, until: Time) -> Outcome {
    let scenario = read_scenario(&scenario_file()).unwrap();
    let mut pipeline = Pipeline::build(&together(config), &scenario).unwrap();
    pipeline.until = until;
    drive_pipeline(pipeline, config.seed, 1, &mut []).unwrap()
}

/// Names of the shared-memory files with this prefix.
fn left_over(prefix: &str) -> Vec<String> {
    let names = std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().file_name());
    names.filter_map(|name| name.into_string().ok()).filter(|name| name.starts_with(prefix)).collect()
}

#[test]
fn two_processes_drive_as_one() {
    let until = Time::from_ms(6000);
    let split = config("two_processes", &[]);
    let here = drive_here(&split, until);
    let run = start(&split, until);
    assert!(!left_over(run.processes.workers().prefix()).is_empty());
    for threads in [1, 2] {
        let Run { pipeline, processes, seed } = start(&split, until);
        let outcome = drive_pipeline(pipeline, seed, threads, &mut []).unwrap();
        assert_eq!(outcome.digest, here.digest);
        assert_eq!(outcome.report.operators, here.report.operators);
        assert!(processes.traffic().calls > 200, "{:?}", processes.traffic());
        let prefix = processes.workers().prefix().to_owned();
        drop(processes);
        assert_eq!(left_over(&prefix), [""; 0]);
    }
}

#[test]
fn images_and_clouds_are_read_in_place() {
    let until = Time::from_ms(1500);
    let config = watched(&["eye", "ear", "planner"]);
    let here = drive_here(&config, until);
    // On a busy machine more than six frames wait for the worker, and those after the sixth are copied. A machine is
    // not that busy each time.
    let mut copied = Vec::new();
    for _ in 0..5 {
        let (outcome, traffic) = drive_split(&config, until);
        assert_eq!(outcome.digest, here.digest);
        assert_eq!(outcome.report.operators, here.report.operators);
        // 6 images of 86 kB and 6 clouds of five arrays of 115 kB and more.
        assert!(traffic.in_place >= 6 + 6 * 5, "{traffic:?}");
        assert!(traffic.bytes - traffic.copied < 64 * 1024 * traffic.calls, "{traffic:?}");
        copied.push(traffic.copied);
        // 14 images, 14 clouds and one of half the length.
        if traffic.copied <= 2 * 86_400 && traffic.in_place >= 14 + 14 * 5 {
            return;
        }
    }
    panic!("{copied:?} bytes copied");
}

#[test]
fn every_split_gives_the_same_digest() {
    let cases = std::env::var("SWERVE_SPLITS").map_or(2, |n| n.parse().unwrap());
    let until = Time::from_ms(1000);
    let operators = ["tracker", "predictor", "planner", "eye", "ear"];
    let config = watched(&["eye"]);
    let here = drive_here(&config, until);
    let mut rng = Rng::keyed(1, "splits", &[]);
    for _ in 0..cases {
        let mut split = together(&config);
        for operator in operators {
            // Stays in half of the cases, else moves to one of three.
            let process = (rng.bits() >> 8) % 6;
            if process < 3 {
                let process = split.process.entry(format!("p{process}")).or_default();
                process.operators.push(operator.to_owned());
            }
        }
        let (outcome, traffic) = drive_split(&split, until);
        assert_eq!(outcome.digest, here.digest, "{:?}", split.process);
        assert_eq!(traffic.copied, 0, "{:?}", split.process);
    }
}

#[test]
fn concurrent_runs_do_not_disturb_each_other() {
    let until = Time::from_ms(2000);
    let config = config("two_processes", &[]);
    let here = drive_here(&config, until).digest;
    let (one, other) = (start(&config, until), start(&config, until));
    assert_ne!(one.processes.workers().prefix(), other.processes.workers().prefix());
    let drive = |Run { pipeline, processes, seed }: Run| {
        let digest = drive_pipeline(pipeline, seed, 1, &mut []).unwrap().digest;
        drop(processes);
        digest
    };
    let digests: Vec<Digest> = std::thread::scope(|scope| {
        let runs = [one, other].map(|run| scope.spawn(|| drive(run)));
        runs.into_iter().map(|run| run.join().unwrap()).collect()
    });
    assert_eq!(digests, [here; 2]);
}

fn signal(process: u32, name: &str) {
    // The process may be gone already.
    let command = format!("kill -s {name} {process}");
    Command::new("sh").args(["-c", &command]).stderr(Stdio::null()).status().unwrap();
}

/// Kills without a chance to clean up.
fn kill(process: u32) {
    signal(process, "KILL");
}

#[expect(clippy::disallowed_methods, reason = "how soon a loss is noticed")]
fn now() -> Instant {
    Instant::now()
}

/// Kills a worker after a number of publications and reports when.
struct Killer {
    after: u64,
    process: u32,
    killed: Option<Instant>,
}

impl Observer for Killer {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(_) = event {
            self.after = self.after.saturating_sub(1);
            if self.after == 0 && self.killed.is_none() {
                kill(self.process);
                self.killed = Some(now());
            }
        }
    }
}

/// Runs `act` after a delay on a separate thread.
fn after<T: Send + 'static>(wait: Duration, act: impl FnOnce() -> T + Send + 'static) -> JoinHandle<T> {
    std::thread::spawn(move || {
        let (_never, nothing) = channel::<()>();
        assert_eq!(nothing.recv_timeout(wait), Err(RecvTimeoutError::Timeout));
        act()
    })
}

/// Time at which a worker is killed.
#[derive(Clone, Copy)]
enum Moment {
    /// Between two steps: after this many publications.
    Publications(u64),
    /// After this duration, wherever it is then.
    After(Duration),
}

/// Drives until a worker of the run is killed; checks that this is reported, logged and cleaned up. Returns the
/// detection time, or `None` if the run ended first.
fn lose_one(config: &Setup, which: usize, moment: Moment) -> Option<Duration> {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    let Run { pipeline, processes, seed } = start(config, Time::from_ms(600_000));
    let prefix = processes.workers().prefix().to_owned();
    let all = processes.workers().processes();
    let (name, process) = all[which % all.len()].clone();
    let publications = if let Moment::Publications(n) = moment { n } else { u64::MAX };
    let mut killer = Killer { after: publications, process, killed: None };
    let mut recorder =
        Recorder::create(&log, &run_start(config, &pipeline.scenario, &scenario_file())).unwrap();
    set_up(&mut recorder, config, &pipeline);
    let other = match moment {
        Moment::Publications(_) => None,
        Moment::After(wait) => Some(after(wait, move || {
            kill(process);
            now()
        })),
    };
    let driven = drive_pipeline(pipeline, seed, 1, &mut [&mut killer, &mut recorder]);
    let ended = now();
    recorder.finish().unwrap();
    let path = log;
    let Err(error) = driven else {
        other.unwrap().join().unwrap();
        drop(processes);
        assert_eq!(left_over(&prefix), [""; 0]);
        return None;
    };
    let error = error.to_string();
    let killed = other.map(|other| other.join().unwrap()).or(killer.killed).unwrap();
    assert!(error.contains(&format!("process `{name}` ended (signal: 9")), "{error}");
    let log = Log::read(&path).unwrap();
    assert!(log.records.len() > 10 || matches!(moment, Moment::Publications(..10)));
    let end = log.end.unwrap();
    assert_eq!(end.failure(), Some(&error[..]));
    // The complete part of the log verifies.
    let said = verify(&path);
    let failed = format!("the run failed at {:.3} s ({error}): that instant is incomplete", end.at.as_secs());
    assert!(said.contains(&failed), "{said}");
    drop(processes);
    assert_eq!(left_over(&prefix), [""; 0]);
    Some(ended - killed)
}

/// Verifies a log; returns the output.
fn verify(log: &Path) -> String {
    let verified = Command::new(PROGRAM).args(["replay", "--verify"]).arg(log).output().unwrap();
    let [said, error] = [verified.stdout, verified.stderr].map(|all| String::from_utf8(all).unwrap());
    assert!(verified.status.success(), "{said}{error}");
    said
}

#[test]
fn killed_process_ends_a_virtual_run_with_a_complete_verified_log() {
    let config = config("two_processes", &[]);
    // Consecutive counts end at all places of an instant: before the tracker, predictor and planner, and after them.
    for publications in 296..308 {
        for process in 0..2 {
            assert!(lose_one(&config, process, Moment::Publications(publications)).is_some());
        }
    }
}

#[test]
#[ignore = "real clock"]
fn process_killed_at_any_moment_is_detected_within_half_a_second() {
    let config = config("two_processes", &[]);
    let kills = std::env::var("SWERVE_KILLS").map_or(1, |n| n.parse().unwrap());
    let mut rng = Rng::keyed(2, "kills", &[]);
    let watched = watched(&["eye", "ear", "planner"]);
    let mut in_time = 0;
    for _ in 0..kills {
        let config = if rng.bits().is_multiple_of(4) { &watched } else { &config };
        let moment = match rng.bits() % 2 {
            0 => Moment::Publications(1 + rng.bits() % 2000),
            _ => Moment::After(Duration::from_micros(rng.bits() % 100_000)),
        };
        let Some(noticed) = lose_one(config, (rng.bits() % 2) as usize, moment) else { continue };
        // Other processes step between the kill and the next call of that process.
        assert!(noticed < Duration::from_millis(500), "noticed after {noticed:?}");
        in_time += 1;
    }
    assert!(2 * in_time >= kills, "{in_time} of {kills} kills came before the end of the run");
}

#[test]
#[ignore = "real clock"]
fn process_killed_during_a_call_is_detected_within_100_ms() {
    let config = config("two_processes", &[]);
    let Run { mut pipeline, processes, seed } = start(&config, Time::from_ms(60_000));
    let process = processes.workers().processes()[1].1;
    // Stopped, it answers no call; then killed, it never will.
    signal(process, "STOP");
    pipeline.until = Time::from_ms(60_000);
    let killer = after(Duration::from_millis(300), move || {
        kill(process);
        now()
    });
    let error = drive_pipeline(pipeline, seed, 1, &mut []).unwrap_err().to_string();
    let noticed = now() - killer.join().unwrap();
    assert!(error.contains("ended (signal: 9"), "{error}");
    assert!(noticed < Duration::from_millis(100), "noticed after {noticed:?}");
}

#[test]
#[ignore = "other processes' timing"]
fn killed_coordinator_ends_its_workers_and_the_next_run_cleans_up() {
    let out = tempfile::tempdir().unwrap();
    let mut coordinator = Command::new(PROGRAM)
        .args(["run", scenario_file().to_str().unwrap(), "--clock", "wall", "--out"])
        .arg(out.path())
        .arg("-c")
        .arg(root().join("configs/two_processes.toml"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let prefix = format!("swerve_{}_", coordinator.id());
    let patience = now() + Duration::from_secs(20);
    let pause = || {
        let (_never, nothing) = channel::<()>();
        let _waited = nothing.recv_timeout(Duration::from_millis(20));
        assert!(now() < patience, "it takes too long");
    };
    while workers_of(coordinator.id()).len() < 2 || !out.path().join("log.partial.mcap").exists() {
        pause();
    }
    let workers = workers_of(coordinator.id());
    kill(coordinator.id());
    coordinator.wait().unwrap();
    while workers.iter().any(|worker| Path::new(&format!("/proc/{worker}")).exists()) {
        pause();
    }
    drop(start(&config("two_processes", &[]), Time::ZERO));
    assert_eq!(left_over(&prefix), [""; 0]);
}

/// Child processes of this process.
fn workers_of(coordinator: u32) -> Vec<u32> {
    let children = std::fs::read_to_string(format!("/proc/{coordinator}/task/{coordinator}/children"));
    children.unwrap_or_default().split_whitespace().filter_map(|id| id.parse().ok()).collect()
}

/// Under wall clock: kills a worker after a number of publications and records the supervision events.
struct Watcher {
    killer: Killer,
    supervision: Vec<(Time, Supervision)>,
    brakes: f64,
}

impl Observer for Watcher {
    fn event(&mut self, event: &Event<'_>) {
        self.killer.event(event);
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(supervision) = payload.downcast_ref::<Supervision>() {
            self.supervision.push((publication.visible_at, supervision.clone()));
        }
        if let Some(command) = payload.downcast_ref::<swerve_msg::Command>()
            && self.supervision.last().is_some_and(|(_, last)| !last.gone.is_empty())
        {
            self.brakes = self.brakes.max(command.brake);
        }
    }
}

/// Drives under wall clock with a worker killed and replays the log. Returns the supervision events.
fn lose_one_under_wall_clock(on_loss: OnLoss, until: Time) -> Watcher {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    let mut config = config("two_processes", &["clock.source=wall"]);
    config.process.values_mut().for_each(|process: &mut ProcessConfig| process.on_loss = on_loss);
    let Run { pipeline, processes, seed } = start(&config, until);
    let process = processes.workers().processes()[1].1;
    let killer = Killer { after: 400, process, killed: None };
    let mut watcher = Watcher { killer, supervision: Vec::new(), brakes: 0.0 };
    let mut recorder =
        Recorder::create(&log, &run_start(&config, &pipeline.scenario, &scenario_file())).unwrap();
    let outcome = drive_pipeline(pipeline, seed, 3, &mut [&mut watcher, &mut recorder]).unwrap();
    recorder.finish().unwrap();
    drop(processes);
    assert!(outcome.report.operator("world").unwrap().ticks.unwrap().ticks > 200);
    verify(&log);
    watcher
}

#[test]
#[ignore = "real clock"]
fn process_loss_under_wall_clock_stops_the_ego() {
    let watcher = lose_one_under_wall_clock(OnLoss::Stop, Time::from_ms(2000));
    let [(_, told)] = &watcher.supervision[..] else { panic!("{:?}", watcher.supervision) };
    assert_eq!(told.gone[0].process, "planning");
    assert!(told.gone[0].why.contains("signal: 9"), "{told:?}");
    assert!(watcher.brakes > 0.05, "{}", watcher.brakes);
}

#[test]
#[ignore = "real clock"]
fn lost_process_under_wall_clock_is_restarted() {
    let watcher = lose_one_under_wall_clock(OnLoss::Restart, Time::from_ms(4000));
    let mut told: Vec<usize> = watcher.supervision.iter().map(|(_, told)| told.gone.len()).collect();
    // A slow restart is reported as well.
    told.dedup();
    assert_eq!(told, [1, 0], "{:?}", watcher.supervision);
}

/// iceoryx2's tunnel: the program named by `SWERVE_TUNNEL`, or the one on the path.
fn tunnel() -> Option<PathBuf> {
    const NAME: &str = "iox2-link-tunnel-zenoh";
    let named = std::env::var_os("SWERVE_TUNNEL").map(PathBuf::from);
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let mut on_path = std::env::split_paths(&paths).map(|folder| folder.join(NAME));
    named.or_else(|| on_path.find(|file| file.exists()))
}

#[test]
#[ignore = "iceoryx2's tunnel"]
fn run_over_two_hosts_equals_that_of_one_process() {
    let Some(tunnel) = tunnel() else {
        swerve_tests::skipped("there is no iceoryx2 tunnel, see docs/howto/two_hosts.md");
        return;
    };
    let may = Command::new("ip").args(["netns", "list"]).output().is_ok_and(|out| out.status.success());
    if !may {
        swerve_tests::skipped("no `ip`, or no right to make network namespaces");
        return;
    }
    let out = tempfile::tempdir().unwrap();
    let script = root().join("tests/hosts/two_hosts.sh");
    let script =
        Command::new(script).arg(PROGRAM).arg(tunnel).arg(out.path()).arg("--json").output().unwrap();
    assert!(script.status.success(), "{}", String::from_utf8_lossy(&script.stderr));
    let told: serde_json::Value = serde_json::from_slice(&script.stdout).unwrap();
    let config = config("two_hosts", &[]);
    let until = Pipeline::build(&together(&config), &read_scenario(&scenario_file()).unwrap()).unwrap().until;
    let here = drive_here(&config, until);
    assert_eq!(told["digest"], here.digest.to_string());
    assert!(told["traffic"]["calls"].as_u64().unwrap() > 300, "{told}");
}
