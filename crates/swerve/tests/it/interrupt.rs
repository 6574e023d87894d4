//! Ctrl-C in the middle of a study.

use std::process::{Command, Stdio};

use crate::support::{Bench, Said};

const CELLS: usize = 200;

fn finished(bench: &Bench) -> usize {
    std::fs::read_dir(bench.path("o/cells")).map_or(0, |entries| {
        let name = |e: std::io::Result<std::fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
        entries.map(name).filter(|n| n.ends_with(".json")).count()
    })
}

/// Starts the study, sends SIGINT once `cells` are finished, and waits.
fn interrupted(bench: &Bench, args: &[&str], cells: usize) -> Said {
    let mut child = bench.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    while finished(bench) < cells {
        assert!(child.try_wait().unwrap().is_none(), "the study ended before it could be stopped");
        std::thread::yield_now();
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    Said::of(&child.wait_with_output().unwrap())
}

#[test]
#[ignore = "other processes' timing"]
fn interrupted_study_keeps_its_cells_and_resumes() {
    let bench = Bench::new();
    let seeds: Vec<String> = (1..=CELLS).map(|seed| seed.to_string()).collect();
    let values = seeds.join(", ");
    bench.write(
        "study.toml",
        &format!("base = {{ scenario = \"short.toml\" }}\n[[axis]]\nkey = \"seed\"\nvalues = [{values}]\n"),
    );
    let args = ["study", "study.toml", "--out", "o", "--threads", "2"];
    for (shard, cells) in [(&["--shard", "1/2"][..], 2), (&[], 10)] {
        let said = interrupted(&bench, &[&args[..], shard].concat(), cells);
        assert_eq!(said.code, Some(1), "{said:?}");
        assert!(said.stderr.contains("the same command goes on from here"), "{said:?}");
        assert!((cells..CELLS).contains(&finished(&bench)), "{} cells", finished(&bench));
        let rows = bench.read("o/cells.csv").lines().count() - 1;
        assert!((cells..CELLS).contains(&rows), "{rows} rows");
    }
    let stopped = bench.read("o/cells.csv");
    bench.good(&args);
    let whole = bench.read("o/cells.csv");
    assert_eq!(whole.lines().count(), CELLS + 1);
    let kept = stopped.lines().all(|row| whole.lines().any(|other| other == row));
    assert!(kept, "a finished cell came out otherwise");
    let other = ["study", "study.toml", "--out", "at_once"];
    bench.good(&other);
    assert_eq!(bench.read("at_once/cells.csv"), whole);
}
