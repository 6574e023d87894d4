//! Workers that neither answer nor exit, because a signal has stopped them.

use super::*;
use swerve_stack::Setup;

/// Configuration with a bound on each reply of its processes.
fn bounded(reply_within_s: f64, more: &[&str]) -> Setup {
    let mut config = config("two_processes", more);
    config.process.values_mut().for_each(|process| process.reply_within_s = reply_within_s);
    config
}

#[test]
fn stopped_worker_ends_a_virtual_run_naming_its_operator_and_process() {
    let config = bounded(0.5, &[]);
    let Run { pipeline, processes, seed } = start(&config, Time::from_ms(60_000));
    let prefix = processes.workers().prefix().to_owned();
    let (name, worker) = processes.workers().processes()[1].clone();
    assert_eq!(name, "planning");
    signal(worker, "STOP");
    let begun = now();
    let error = drive_pipeline(pipeline, seed, 1, &mut []).unwrap_err().to_string();
    let expected = "process `planning` did not answer operator `planner` within 0.5 s \
                    (process.planning.reply_within_s) and was killed";
    assert!(error.contains(expected), "{error}");
    assert!(now() - begun < Duration::from_secs(5));
    drop(processes);
    assert_eq!(left_over(&prefix), [""; 0]);
}

#[test]
#[ignore = "real clock"]
fn stopped_worker_under_wall_clock_is_restarted() {
    let mut config = bounded(0.5, &["clock.source=wall"]);
    config.process.values_mut().for_each(|process| process.on_loss = OnLoss::Restart);
    let Run { pipeline, processes, seed } = start(&config, Time::from_ms(5000));
    let worker = processes.workers().processes()[1].1;
    let stopped = after(Duration::from_millis(1000), move || signal(worker, "STOP"));
    let killer = Killer { after: u64::MAX, process: worker, killed: None };
    let mut watcher = Watcher { killer, supervision: Vec::new(), brakes: 0.0 };
    drive_pipeline(pipeline, seed, 3, &mut [&mut watcher]).unwrap();
    stopped.join().unwrap();
    let told: Vec<_> = watcher.supervision.iter().map(|(_, told)| &told.gone).collect();
    assert!(told[0][0].why.contains("did not answer operator `planner` within 0.5 s"), "{told:?}");
    assert!(told.last().unwrap().is_empty(), "{told:?}");
}

/// True if a process exists: neither gone nor waiting to be reaped.
fn is_there(process: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    stat.rsplit(") ").next().is_some_and(|rest| !rest.is_empty() && !rest.starts_with(['Z', 'X']))
}

#[test]
fn second_interrupt_ends_a_run_with_a_hanging_worker_at_once() {
    let configs = root().join("configs/two_processes.toml");
    for [first, second] in [["INT", "INT"], ["INT", "TERM"]] {
        let out = tempfile::tempdir().unwrap();
        let mut run = Command::new(PROGRAM)
            .args(["run", scenario_file().to_str().unwrap(), "--clock", "wall", "--out"])
            .arg(out.path())
            .arg("-c")
            .arg(&configs)
            .args(["--set", "process.perception.reply_within_s=3600"])
            .args(["--set", "process.planning.reply_within_s=3600"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begun = now();
        let pause = || {
            std::thread::park_timeout(Duration::from_millis(2));
            assert!(now() - begun < Duration::from_secs(20), "it takes too long");
        };
        let log = out.path().join("log.partial.mcap");
        // Once the log has its first chunks, the drive has begun.
        while std::fs::metadata(&log).map_or(0, |file| file.len()) < 50_000 {
            pause();
        }
        let workers = workers_of(run.id());
        workers.iter().for_each(|worker| signal(*worker, "STOP"));
        std::thread::park_timeout(Duration::from_millis(300));
        signal(run.id(), first);
        std::thread::park_timeout(Duration::from_millis(100));
        signal(run.id(), second);
        let status = loop {
            if let Some(status) = run.try_wait().unwrap() {
                break status;
            }
            pause();
        };
        assert_eq!(status.code(), Some(130), "{status}");
        assert_eq!(workers.len(), 2);
        while workers.iter().any(|worker| is_there(*worker)) {
            pause();
        }
    }
}
