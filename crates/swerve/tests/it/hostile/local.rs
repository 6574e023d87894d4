//! Another user of the host against a run in several processes, and a worker that hangs on restart.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use serde_json::Value;

use super::{PATIENCE, pause};
use crate::support::{Bench, alone};

/// Runs a script as user `nobody`. `None` unless run by root.
fn as_nobody(script: &str) -> Option<(bool, String)> {
    let words = ["--reuid=65534", "--regid=65534", "--clear-groups", "sh", "-c", script];
    let output = Command::new("setpriv").args(words).output().ok()?;
    let told =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    if told.contains("setpriv: ") {
        swerve_tests::skipped(told.trim());
        return None;
    }
    Some((output.status.success(), told))
}

/// Shared-memory files of a process's runs.
fn shared_files(pid: u32) -> Vec<PathBuf> {
    let all = std::fs::read_dir("/dev/shm").unwrap().filter_map(|entry| Some(entry.ok()?.path()));
    let name = format!("/dev/shm/swerve_{pid}_");
    all.filter(|path| path.to_str().is_some_and(|path| path.starts_with(&name))).collect()
}

fn drive(bench: &Bench, config: &str) -> Command {
    bench.write("config.toml", config);
    bench.write("long.toml", &super::SCENARIO.replace("SECONDS", "6.0"));
    let told = std::fs::File::create(bench.path("told")).unwrap();
    let words = ["run", "long.toml", "-c", "config.toml", "--clock", "wall", "--out", "out"];
    let mut command = bench.command(&words);
    command.stdin(Stdio::null()).stdout(told.try_clone().unwrap()).stderr(told);
    command
}

#[test]
#[ignore = "real clock"]
fn other_user_cannot_read_write_or_block_a_run() {
    let _alone = alone();
    if as_nobody("true").is_none() {
        return;
    }
    let bench = Bench::new();
    // A world-writable parent for the run's folder, as the system's own is.
    let temporary = tempfile::tempdir_in("/tmp").unwrap();
    let path = temporary.path().to_str().unwrap().to_owned();
    assert!(Command::new("chmod").args(["1777", &path]).status().unwrap().success());
    let base = format!("{path}/swerve_ipc_0");
    // The folder already exists with another owner: refused with a message, and left untouched.
    assert!(as_nobody(&format!("mkdir -p {base} && touch {base}/x.lock && mkfifo {base}/z.lock")).unwrap().0);
    let config = "[process.planning]\noperators = ['planner']\non_loss = 'restart'\n";
    let mut command = drive(&bench, config);
    command.env("TMPDIR", &path).env_remove("XDG_RUNTIME_DIR");
    assert!(!command.status().unwrap().success());
    let told = bench.read("told");
    assert!(told.contains("it belongs to user 65534, and not yours"), "{told}");
    assert!(std::path::Path::new(&base).join("x.lock").exists());
    std::fs::remove_dir_all(&base).unwrap();

    let mut run = command.spawn().unwrap();
    for _ in 0..PATIENCE {
        if shared_files(run.id()).len() > 4 {
            break;
        }
        pause();
    }
    let files = shared_files(run.id());
    assert!(files.len() > 4, "{files:?}");
    let pid = run.id();
    for script in [
        format!(
            "for f in /dev/shm/swerve_{pid}_*; do ( : > \"$f\" ) && echo wrote $f; ( cat \"$f\" > /dev/null ) && echo read $f; done"
        ),
        format!(
            "ls {base} && echo listed; flock -n {base}/guard true && echo locked; echo > {base}/y.lock && echo made"
        ),
    ] {
        let (_, told) = as_nobody(&script).unwrap();
        let done = told.lines().filter(|line| {
            ["wrote ", "read ", "listed", "locked", "made"].iter().any(|w| line.starts_with(w))
        });
        assert_eq!(done.count(), 0, "{told}");
        assert!(told.contains("ermission denied"), "{told}");
    }
    assert!(run.wait().unwrap().success(), "{}", bench.read("told"));
    assert_eq!(shared_files(pid), Vec::<PathBuf>::new(), "it left something");
}

#[test]
#[ignore = "real clock"]
fn worker_that_hangs_on_restart_is_reported_within_a_second_and_the_ego_stops() {
    let _alone = alone();
    let bench = Bench::new();
    let program = env!("CARGO_BIN_EXE_swerve");
    let start =
        format!("if mkdir {}; then exec {program} worker; fi; exec sleep 60", bench.path("begun").display());
    let config = format!(
        "[process.planning]\noperators = ['planner']\non_loss = 'restart'\nstart = ['sh', '-c', '{start}']\n"
    );
    let mut run = drive(&bench, &config).spawn().unwrap();
    let worker = || -> Option<u32> {
        let children = std::fs::read_to_string(format!("/proc/{0}/task/{0}/children", run.id())).ok()?;
        children.split_whitespace().next()?.parse().ok()
    };
    for _ in 0..PATIENCE {
        if bench.read("told").contains("driving")
            || bench.path("out/log.partial.mcap").exists() && worker().is_some()
        {
            break;
        }
        pause();
    }
    // The run is driving by now, or soon will be.
    (0..150).for_each(|_| pause());
    super::signal(worker().unwrap(), "-KILL");
    assert!(run.wait().unwrap().success(), "{}", bench.read("told"));
    let told = bench.read("told");
    println!("{told}");
    assert!(told.contains("process `planning` was started again, and is not ready after 1 s"), "{told}");
    let metrics: Value = serde_json::from_str(&bench.read("out/metrics.json")).unwrap();
    let speed = metrics["drive"]["speed_end_mps"].as_f64().unwrap();
    assert!(speed < 0.5, "{speed} m/s at the end");
    assert_eq!(shared_files(run.id()), Vec::<PathBuf>::new(), "it left something");
}
