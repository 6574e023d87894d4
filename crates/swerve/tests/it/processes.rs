//! Runs over several processes of this very program.
//!
//! `SWERVE_KILLS=50` kills that many workers at random moments, `SWERVE_SPLITS=20` drives that many random splits.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a failed test says where, a skipped one why")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use swerve::config::Config;
use swerve::config::process::ProcessConfig;
use swerve::pipeline::Pipeline;
use swerve::process::Processes;
use swerve::program::Program;
use swerve::run::{Outcome, drive_pipeline, read_scenario, run_start};
use swerve_core::{Digest, Rng, Time};
use swerve_flow::{Event, Observer};
use swerve_ipc::{OnLoss, Traffic};
use swerve_log::{Log, Recorder};
use swerve_msg::Supervision;
use swerve_text::{Document, parse_assignment};
use tempfile::TempDir;

/// The program whose other end the workers are.
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

fn config(file: &str, sets: &[&str]) -> Config {
    let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
    let file = root().join("configs").join(file).with_extension("toml");
    Config::load(Some(&file), &sets).unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// A small camera and a lidar, each watched.
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

fn watched(operators: &[&str]) -> Config {
    let text = format!("{WATCHED}[process.watch]\noperators = {operators:?}\n");
    Config::from_document(&Document::parse("watched", text).unwrap(), &[]).unwrap()
}

/// The same in one process.
fn together(config: &Config) -> Config {
    Config { process: Default::default(), ..config.clone() }
}

/// A run that has not begun: its processes are there.
struct Run {
    pipeline: Pipeline,
    processes: Processes,
    seed: u64,
}

fn start(config: &Config, until: Time) -> Run {
    let mut pipeline = Pipeline::build(config, &read_scenario(&scenario_file()).unwrap()).unwrap();
    pipeline.until = until;
    let text = std::fs::read_to_string(scenario_file()).unwrap();
    let processes = Processes::start(&program(), config, &text, &mut pipeline).unwrap();
    Run { pipeline, processes, seed: config.seed }
}

fn drive_split(config: &Config, until: Time) -> (Outcome, Traffic) {
    let Run { pipeline, processes, seed } = start(config, until);
    let outcome = drive_pipeline(pipeline, seed, 1, &mut []).unwrap();
    (outcome, processes.traffic())
}

fn drive_here(config: &Config, until: Time) -> Outcome {
    let scenario = read_scenario(&scenario_file()).unwrap();
    let mut pipeline = Pipeline::build(&together(config), &scenario).unwrap();
    pipeline.until = until;
    drive_pipeline(pipeline, config.seed, 1, &mut []).unwrap()
}

/// The files in the shared-memory folder whose names start so.
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
fn images_and_clouds_are_read_where_they_were_written() {
    let until = Time::from_ms(1500);
    let config = watched(&["eye", "ear", "planner"]);
    let here = drive_here(&config, until);
    let (outcome, traffic) = drive_split(&config, until);
    assert_eq!(outcome.digest, here.digest);
    assert_eq!(outcome.report.operators, here.report.operators);
    assert_eq!(traffic.copied, 0, "{traffic:?}");
    // 14 images of 86 kB; 14 clouds of five arrays of 115 kB and more, and one of half that.
    assert!(traffic.in_place >= 14 + 14 * 5, "{traffic:?}");
    assert!(traffic.bytes < 64 * 1024 * traffic.calls, "{traffic:?}");
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
            // Half of the time it stays, else it goes to one of three.
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
fn two_runs_at_once_leave_each_other_alone() {
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
    // One that is gone already gets none.
    let command = format!("kill -s {name} {process}");
    Command::new("sh").args(["-c", &command]).stderr(Stdio::null()).status().unwrap();
}

/// Kills with no chance to clean up.
fn kill(process: u32) {
    signal(process, "KILL");
}

#[expect(clippy::disallowed_methods, reason = "how soon a loss is noticed")]
fn now() -> Instant {
    Instant::now()
}

/// Kills a worker after so many publications, and tells when that was.
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

/// Does something after so long, on a thread of its own.
fn after<T: Send + 'static>(wait: Duration, act: impl FnOnce() -> T + Send + 'static) -> JoinHandle<T> {
    std::thread::spawn(move || {
        let (_never, nothing) = channel::<()>();
        assert_eq!(nothing.recv_timeout(wait), Err(RecvTimeoutError::Timeout));
        act()
    })
}

/// When a worker is killed.
#[derive(Clone, Copy)]
enum Moment {
    /// Between two steps: after so many publications.
    Publications(u64),
    /// Wherever it is then.
    After(Duration),
}

/// Drives until a worker of the run is killed; checks that this is told, logged and cleaned up. Gives how long it took
/// to be noticed, unless the run was over before.
fn lose_one(config: &Config, which: usize, moment: Moment) -> Option<Duration> {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    let Run { pipeline, processes, seed } = start(config, Time::from_ms(600_000));
    let prefix = processes.workers().prefix().to_owned();
    let all = processes.workers().processes();
    let (name, process) = all[which % all.len()].clone();
    let publications = if let Moment::Publications(n) = moment { n } else { u64::MAX };
    let mut killer = Killer { after: publications, process, killed: None };
    let mut recorder = Recorder::create(&log, &run_start(config, &scenario_file()).unwrap()).unwrap();
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
    let Err(error) = driven else {
        other.unwrap().join().unwrap();
        drop(processes);
        assert_eq!(left_over(&prefix), [""; 0]);
        return None;
    };
    let error = error.to_string();
    let killed = other.map(|other| other.join().unwrap()).or(killer.killed).unwrap();
    assert!(error.contains(&format!("process `{name}` ended (signal: 9")), "{error}");
    let log = Log::read(&log).unwrap();
    assert!(log.records.len() > 10 || matches!(moment, Moment::Publications(..10)));
    assert_eq!(log.end.unwrap().reason, format!("failed: {error}"));
    drop(processes);
    assert_eq!(left_over(&prefix), [""; 0]);
    Some(ended - killed)
}

#[test]
fn a_killed_process_ends_a_virtual_run_with_its_log_whole() {
    let config = config("two_processes", &[]);
    assert!(lose_one(&config, 0, Moment::Publications(300)).is_some());
}

#[test]
#[ignore = "real clock"]
fn a_process_killed_at_any_moment_is_noticed_within_half_a_second() {
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
        // Between the kill and the next call of that process lie steps of others.
        assert!(noticed < Duration::from_millis(500), "noticed after {noticed:?}");
        in_time += 1;
    }
    assert!(2 * in_time >= kills, "{in_time} of {kills} kills came before the end of the run");
}

#[test]
#[ignore = "real clock"]
fn a_process_killed_while_it_is_waited_for_is_noticed_within_100_ms() {
    let config = config("two_processes", &[]);
    let Run { mut pipeline, processes, seed } = start(&config, Time::from_ms(60_000));
    let process = processes.workers().processes()[1].1;
    // Stopped, it answers no call; killed, it never will.
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
fn a_killed_coordinator_takes_its_workers_along_and_the_next_run_cleans_up() {
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

/// The processes that this one started.
fn workers_of(coordinator: u32) -> Vec<u32> {
    let children = std::fs::read_to_string(format!("/proc/{coordinator}/task/{coordinator}/children"));
    children.unwrap_or_default().split_whitespace().filter_map(|id| id.parse().ok()).collect()
}

/// Under wall clock: kills a worker after so many publications, and follows what the log is told of processes.
struct Watcher {
    killer: Killer,
    supervision: Vec<(Time, Supervision)>,
    brakes: f64,
}

impl Observer for Watcher {
    fn event(&mut self, event: &Event<'_>) {
        self.killer.event(event);
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload.map(|payload| payload.as_any()) else { return };
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

/// Drives against the real clock, with a worker killed; replays the log. Gives what was told of processes.
fn lose_one_under_wall_clock(on_loss: OnLoss, until: Time) -> Watcher {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.mcap");
    let mut config = config("two_processes", &["clock.source=wall"]);
    config.process.values_mut().for_each(|process: &mut ProcessConfig| process.on_loss = on_loss);
    let Run { pipeline, processes, seed } = start(&config, until);
    let process = processes.workers().processes()[1].1;
    let killer = Killer { after: 400, process, killed: None };
    let mut watcher = Watcher { killer, supervision: Vec::new(), brakes: 0.0 };
    let mut recorder = Recorder::create(&log, &run_start(&config, &scenario_file()).unwrap()).unwrap();
    let outcome = drive_pipeline(pipeline, seed, 3, &mut [&mut watcher, &mut recorder]).unwrap();
    recorder.finish().unwrap();
    drop(processes);
    assert!(outcome.report.operator("world").unwrap().ticks.unwrap().ticks > 200);
    let verified = Command::new(PROGRAM).args(["replay", "--verify"]).arg(&log).output().unwrap();
    let said =
        String::from_utf8_lossy(&verified.stdout).into_owned() + &String::from_utf8_lossy(&verified.stderr);
    assert!(verified.status.success(), "{said}");
    watcher
}

#[test]
#[ignore = "real clock"]
fn under_wall_clock_a_loss_brings_the_ego_to_a_stop() {
    let watcher = lose_one_under_wall_clock(OnLoss::Stop, Time::from_ms(2000));
    let [(_, told)] = &watcher.supervision[..] else { panic!("{:?}", watcher.supervision) };
    assert_eq!(told.gone[0].process, "planning");
    assert!(told.gone[0].why.contains("signal: 9"), "{told:?}");
    assert!(watcher.brakes > 0.05, "{}", watcher.brakes);
}

#[test]
#[ignore = "real clock"]
fn under_wall_clock_a_lost_process_is_started_again() {
    let watcher = lose_one_under_wall_clock(OnLoss::Restart, Time::from_ms(4000));
    let told: Vec<usize> = watcher.supervision.iter().map(|(_, told)| told.gone.len()).collect();
    assert_eq!(told, [1, 0], "{:?}", watcher.supervision);
}

/// iceoryx2's tunnel: the program that `SWERVE_TUNNEL` names, or what is on the path.
fn tunnel() -> Option<PathBuf> {
    const NAME: &str = "iox2-link-tunnel-zenoh";
    let named = std::env::var_os("SWERVE_TUNNEL").map(PathBuf::from);
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let mut on_path = std::env::split_paths(&paths).map(|folder| folder.join(NAME));
    named.or_else(|| on_path.find(|file| file.exists()))
}

#[test]
#[ignore = "iceoryx2's tunnel"]
fn a_run_over_two_hosts_is_that_of_one_process() {
    let Some(tunnel) = tunnel() else {
        println!("skipped: there is no iceoryx2 tunnel, see docs/howto/two_hosts.md");
        return;
    };
    let may = Command::new("ip").args(["netns", "list"]).output().is_ok_and(|out| out.status.success());
    if !may {
        println!("skipped: no `ip`, or no right to make network namespaces");
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

/// The program, in the middle of a run over processes that it was called for.
struct Called {
    child: Child,
    out: TempDir,
}

impl Called {
    /// Returns once the run is under way.
    fn start(args: &[&str]) -> Self {
        let out = tempfile::tempdir().unwrap();
        let mut command = Command::new(PROGRAM);
        command.args(["run", scenario_file().to_str().unwrap(), "--out"]).arg(out.path()).args(args);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut called = Self { child, out };
        let log = called.out.path().join("log.partial.mcap");
        // Past what is in a log before the first step.
        called.wait_until(|_| std::fs::metadata(&log).is_ok_and(|log| log.len() > 20_000));
        called
    }

    fn wait_until(&mut self, mut is_so: impl FnMut(&mut Child) -> bool) {
        let patience = now() + Duration::from_secs(60);
        let (_never, nothing) = channel::<()>();
        while !is_so(&mut self.child) {
            assert!(now() < patience, "it takes too long");
            let _waited = nothing.recv_timeout(Duration::from_millis(5));
        }
    }

    /// Waits for its end; its exit code, and what it said.
    fn end(self) -> (Option<i32>, String, TempDir) {
        let output = self.child.wait_with_output().unwrap();
        let said = [&output.stdout[..], &output.stderr].concat();
        let said = String::from_utf8_lossy(&said).into_owned();
        (output.status.code(), said, self.out)
    }
}

#[test]
#[ignore = "other processes' timing"]
fn an_interrupted_virtual_run_ends_in_order_and_leaves_nothing() {
    let file = root().join("configs/two_processes.toml");
    let called = Called::start(&["-c", file.to_str().unwrap()]);
    let prefix = format!("swerve_{}_", called.child.id());
    assert!(!left_over(&prefix).is_empty());
    signal(called.child.id(), "INT");
    let (code, said, out) = called.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("interrupted at") && said.contains("log.partial.mcap"), "{said}");
    assert_eq!(left_over(&prefix), [""; 0]);
    let log = Log::read(&out.path().join("log.partial.mcap")).unwrap();
    assert_eq!(log.end.unwrap().reason, "interrupted");
}

#[test]
#[ignore = "real clock"]
fn a_suspended_run_counts_what_it_missed_and_goes_on() {
    let called = Called::start(&["--clock", "wall", "--json"]);
    let process = called.child.id();
    signal(process, "STOP");
    after(Duration::from_millis(300), move || signal(process, "CONT")).join().unwrap();
    let (code, said, _out) = called.end();
    assert_eq!(code, Some(0), "{said}");
    let said: serde_json::Value = serde_json::from_str(&said[said.find('{').unwrap()..]).unwrap();
    let timer = |name: &str| {
        let timers = said["timers"].as_array().unwrap();
        timers.iter().find(|timer| timer["operator"] == name).unwrap().clone()
    };
    for (operator, period_ms) in [("controller", 10), ("obstacles", 50)] {
        let timer = timer(operator);
        let missed = timer["missed"].as_u64().unwrap();
        assert!(missed >= 300 / period_ms - 2, "{timer}");
        assert!(timer["max_ns"].as_u64().unwrap() >= 250_000_000, "{timer}");
        // None is left out, none is taken twice: as many as there are periods in the drive.
        let driven_ms = said["drive"]["duration_s"].as_f64().unwrap() * 1e3;
        let due = driven_ms / period_ms as f64;
        let ticks = timer["ticks"].as_u64().unwrap() as f64;
        assert!((ticks - due).abs() <= 2.0, "{ticks} ticks, {due} were due");
    }
}

/// Calls this program with folders of so many bytes at the places named; none where this is not permitted.
fn in_small_folders(folders: &[(&Path, u64)], args: &[&str]) -> Option<(Option<i32>, String)> {
    in_small_folders_as(PROGRAM, folders, args)
}

fn in_small_folders_as(
    program: &str,
    folders: &[(&Path, u64)],
    args: &[&str],
) -> Option<(Option<i32>, String)> {
    let mut script = String::new();
    for (folder, bytes) in folders {
        script += &format!("mount -t tmpfs -o size={bytes} small {} || exit 77\n", folder.display());
    }
    script += "exec \"$@\"";
    let mut command = Command::new("unshare");
    command.args(["-m", "sh", "-c", &script, "sh", program]).args(args);
    let output = command.output().ok()?;
    let said = [&output.stdout[..], &output.stderr].concat();
    let said = String::from_utf8_lossy(&said).into_owned();
    let refused = output.status.code() == Some(77) || said.contains("unshare failed");
    if refused {
        println!("skipped: no small file system may be mounted here: {said}");
        return None;
    }
    Some((output.status.code(), said))
}

#[test]
fn a_full_disk_ends_a_virtual_run_with_what_was_written_readable() {
    let (small, keep) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let out = small.path().join("out");
    // The log has to be looked at where it is mounted.
    let kept = keep.path().join("log.mcap");
    let script = format!(
        "\"$@\"; code=$?; cp {} {}; exit $code",
        out.join("log.partial.mcap").display(),
        kept.display()
    );
    let scenario = scenario_file();
    let run = [PROGRAM, "run", scenario.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let args = [&["-c", &script, "sh"][..], &run].concat();
    let Some((code, said)) = in_small_folders_as("sh", &[(small.path(), 400_000)], &args) else { return };
    assert_eq!(code, Some(1), "{said}");
    assert_eq!(said.matches("warning:").count(), 1, "{said}");
    assert!(said.contains("log.partial.mcap: cannot write: No space left on device"), "{said}");
    assert!(said.contains("bytes are written); the run ends"), "{said}");
    let (log, damage) = Log::salvage(&kept).unwrap();
    assert!(log.records.len() > 100 && damage.is_some(), "{}, {damage:?}", log.records.len());
}

#[test]
#[ignore = "real clock"]
fn a_full_disk_does_not_stop_a_drive_against_the_real_clock() {
    let small = tempfile::tempdir().unwrap();
    let out = small.path().join("out");
    let scenario = scenario_file();
    let args = ["run", scenario.to_str().unwrap(), "--clock", "wall", "--out", out.to_str().unwrap()];
    let Some((code, said)) = in_small_folders(&[(small.path(), 400_000)], &args) else { return };
    assert_eq!(code, Some(1), "the log is not whole: {said}");
    assert!(said.contains("the run drives on without its log"), "{said}");
    assert!(said.contains("AVOIDED") || said.contains("COLLISION"), "{said}");
    assert!(said.contains("late p50 ms"), "{said}");
}

#[test]
fn where_shared_memory_is_short_a_run_copies_or_is_refused_and_is_not_killed() {
    let files = tempfile::tempdir().unwrap();
    let config = files.path().join("watched.toml");
    std::fs::write(&config, format!("{WATCHED}[process.watch]\noperators = ['eye', 'ear']\n")).unwrap();
    let scenario = files.path().join("short.toml");
    let text = std::fs::read_to_string(scenario_file()).unwrap();
    let short: Vec<&str> =
        text.lines().map(|l| if l.starts_with("timeout_s") { "timeout_s = 1.0" } else { l }).collect();
    std::fs::write(&scenario, short.join("\n")).unwrap();
    let out = files.path().join("out");
    let paths = [&scenario, &config, &out].map(|path| path.to_str().unwrap());
    let args = ["run", paths[0], "-c", paths[1], "--out", paths[2], "--json"];
    let shared = Path::new("/dev/shm");
    let mut digests = Vec::new();
    for megabytes in [1_u64, 8, 20, 200] {
        let Some((code, said)) = in_small_folders(&[(shared, megabytes << 20)], &args) else { return };
        match code {
            Some(0) => {
                let said: serde_json::Value = serde_json::from_str(&said[said.find('{').unwrap()..]).unwrap();
                let copied = said["traffic"]["copied"].as_u64().unwrap();
                assert!(copied == 0 || megabytes < 200, "{megabytes} MiB: {copied} bytes copied");
                digests.push(said["digest"].as_str().unwrap().to_owned());
            }
            // Not by a signal, and with a word on what is short.
            Some(1) => {
                assert!(said.contains("getting shared memory") && megabytes < 200, "{megabytes} MiB: {said}")
            }
            _ => panic!("{megabytes} MiB: {code:?}: {said}"),
        }
    }
    assert!(!digests.is_empty() && digests.windows(2).all(|pair| pair[0] == pair[1]), "{digests:?}");
}
