//! Resource exhaustion: full disk, no memory, no file descriptors. Finished results are kept, partial ones are not
//! taken for complete, and the same command continues once there is room.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::{Bench, Said, digest};

const STUDY: &str = r#"
base = { scenario = "short.toml" }
[[axis]]
key = "seed"
values = [1, 2, 3, 4]
"#;

const RUN: [&str; 5] = ["run", "short.toml", "--out", "o", "--overwrite"];

/// A call under a `ulimit`. Writing past a file size limit is an error, not a signal.
fn limited(bench: &Bench, limit: &str, args: &[&str]) -> Said {
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("trap '' XFSZ; ulimit -c 0; ulimit {limit} && exec \"$0\" \"$@\"")]);
    shell.arg(env!("CARGO_BIN_EXE_swerve")).args(args).current_dir(bench.path(""));
    Said::of(&shell.output().unwrap())
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    paths.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// No partial file is left beside complete ones, and every file with a final name is complete.
fn check_whole(bench: &Bench, said: &Said) {
    for path in ["o", "s"].into_iter().flat_map(|folder| files(&bench.path(folder))) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        // An aborted process cannot clean up.
        assert!(said.code.is_none() || !name.ends_with(".part"), "{name}: {said:?}");
        if name.ends_with(".json") && !name.contains(".partial.") && !name.ends_with(".part") {
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(serde_json::from_str::<serde_json::Value>(&text).is_ok(), "{name}: {text}");
        }
    }
}

#[test]
fn full_disk_is_reported_and_finished_files_are_kept() {
    let bench = Bench::new();
    let clean = bench.good(&RUN);
    let longest = files(&bench.path("o")).iter().map(|f| f.metadata().unwrap().len()).max().unwrap();
    let (mut refused, mut went) = (0, 0);
    for blocks in [0, 1, 4, 16, 64, 256, longest / 256] {
        std::fs::remove_dir_all(bench.path("o")).unwrap();
        let said = limited(&bench, &format!("-f {blocks}"), &RUN);
        match said.code {
            Some(0) => went += 1,
            code => {
                assert_eq!(code, Some(1), "{blocks}: {said:?}");
                assert!(said.stderr.contains("File too large"), "{blocks}: {said:?}");
                assert!(!said.stderr.contains("panicked"), "{blocks}: {said:?}");
                refused += 1;
            }
        }
        check_whole(&bench, &said);
        std::fs::create_dir_all(bench.path("o")).unwrap();
    }
    assert!(refused >= 3 && went >= 1, "{refused} refused, {went} went well");
    assert_eq!(digest(&bench.good(&RUN)), digest(&clean));
}

#[test]
fn study_resumes_after_a_full_disk() {
    let bench = Bench::new();
    bench.write("study.toml", STUDY);
    let args = ["study", "study.toml", "--out", "o"];
    bench.good(&["study", "study.toml", "--out", "clean"]);
    for blocks in [0, 2, 8, 64] {
        let said = limited(&bench, &format!("-f {blocks}"), &args);
        assert!(matches!(said.code, Some(0 | 1)), "{blocks}: {said:?}");
        assert!(said.code == Some(0) || said.stderr.contains("File too large"), "{blocks}: {said:?}");
        assert!(!said.stderr.contains("panicked"), "{blocks}: {said:?}");
        check_whole(&bench, &said);
    }
    bench.good(&args);
    assert_eq!(bench.read("o/cells.csv"), bench.read("clean/cells.csv"));
}

/// A failed allocation aborts the process (Rust's standard library); finished results must be kept.
#[test]
fn finished_cells_are_kept_when_memory_runs_out() {
    let bench = Bench::new();
    bench.write("study.toml", STUDY);
    let args = ["study", "study.toml", "--out", "s", "--threads", "1"];
    bench.good(&["study", "study.toml", "--out", "clean"]);
    let clean = bench.good(&RUN);
    let (mut ended, mut went) = (0, 0);
    for kib in (14..22).map(|power| 1_u64 << power) {
        let limit = format!("-v {kib}");
        for call in [&RUN[..], &args] {
            let said = limited(&bench, &limit, call);
            check_whole(&bench, &said);
            if said.code == Some(0) {
                went += 1;
            } else {
                ended += 1;
            }
        }
        let log = bench.path("o/log.mcap");
        if log.exists() && ended > 0 {
            let said = bench.swerve(&["why", "o/log.mcap"]);
            assert!(matches!(said.code, Some(0 | 1)), "{kib}: {said:?}");
        }
    }
    assert!(ended > 0 && went > 0, "{ended} ended, {went} went well");
    bench.good(&args);
    assert_eq!(bench.read("s/cells.csv"), bench.read("clean/cells.csv"));
    assert_eq!(digest(&bench.good(&RUN)), digest(&clean));
}

#[test]
fn descriptor_exhaustion_is_one_error() {
    let bench = Bench::new();
    let clean = bench.good(&RUN);
    let mut refused = 0;
    for descriptors in [4, 5, 6, 8, 12, 64] {
        let said = limited(&bench, &format!("-n {descriptors}"), &RUN);
        if said.code != Some(0) {
            assert!(said.stderr.contains("Too many open files"), "{descriptors}: {said:?}");
            assert!(!said.stderr.contains("panicked"), "{descriptors}: {said:?}");
            refused += 1;
        }
        check_whole(&bench, &said);
    }
    assert!(refused > 0);
    assert_eq!(digest(&bench.good(&RUN)), digest(&clean));
}
