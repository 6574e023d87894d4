//! Runs over processes through the program itself: interrupted, suspended, on full disks, with little shared memory.

use super::*;

/// The program during a run over processes.
struct Called {
    child: Child,
    out: TempDir,
}

impl Called {
    /// Starts the program and returns once the run is in progress.
    fn start(args: &[&str]) -> Self {
        let out = tempfile::tempdir().unwrap();
        let mut command = Command::new(PROGRAM);
        command.args(["run", scenario_file().to_str().unwrap(), "--out"]).arg(out.path()).args(args);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut called = Self { child, out };
        let log = called.out.path().join("log.partial.mcap");
        // More than a log holds before the first step.
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

    /// Waits for its end; returns exit code and output.
    fn end(self) -> (Option<i32>, String, TempDir) {
        let output = self.child.wait_with_output().unwrap();
        let said = [&output.stdout[..], &output.stderr].concat();
        let said = String::from_utf8_lossy(&said).into_owned();
        (output.status.code(), said, self.out)
    }
}

#[test]
#[ignore = "other processes' timing"]
fn interrupted_virtual_run_ends_in_order_and_leaves_nothing() {
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
fn suspended_run_counts_missed_ticks_and_continues() {
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
        // No tick is skipped or repeated: as many as there are periods in the drive.
        let driven_ms = said["drive"]["duration_s"].as_f64().unwrap() * 1e3;
        let due = driven_ms / period_ms as f64;
        let ticks = timer["ticks"].as_u64().unwrap() as f64;
        assert!((ticks - due).abs() <= 2.0, "{ticks} ticks, {due} were due");
    }
}

/// Calls this program with folders of limited size mounted at these paths. `None` if mounting is not permitted.
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
        swerve_tests::skipped(&format!("no small file system may be mounted here: {said}"));
        return None;
    }
    Some((output.status.code(), said))
}

#[test]
fn full_disk_ends_a_virtual_run_with_a_readable_log() {
    let (small, keep) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let out = small.path().join("out");
    // The log must be read where it is mounted.
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
fn full_disk_does_not_stop_a_wall_clock_drive() {
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
fn run_with_little_shared_memory_copies_or_is_refused_and_is_not_killed() {
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
    let args = ["run", paths[0], "-c", paths[1], "--out", paths[2], "--overwrite", "--json"];
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
            // Not by a signal, and with a message on the missing memory.
            Some(1) => {
                assert!(said.contains("getting shared memory") && megabytes < 200, "{megabytes} MiB: {said}")
            }
            _ => panic!("{megabytes} MiB: {code:?}: {said}"),
        }
    }
    assert!(!digests.is_empty() && digests.windows(2).all(|pair| pair[0] == pair[1]), "{digests:?}");
}
