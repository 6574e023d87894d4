//! Output files: regular ones are replaced whole, pipes and devices written through; foreign files are not followed or
//! replaced.

use std::os::unix::fs::{FileTypeExt, symlink};
use std::process::Command;

use crate::support::{Bench, Said};

/// Detections of two frames in MOTChallenge rows.
const BOXES: &str = "1,-1,10,10,30,60,0.9,-1,-1,-1\n2,-1,12,10,30,60,0.9,-1,-1,-1\n";

const TRACK: [&str; 5] = ["track", "boxes.txt", "--tracker", "sort", "--out"];

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("boxes.txt", BOXES);
    bench
}

fn track(bench: &Bench, out: &str, more: &[&str]) -> Said {
    bench.swerve(&[&TRACK[..], &[out], more].concat())
}

#[test]
fn output_goes_through_pipes_devices_and_descriptors() {
    let bench = bench();
    let good = track(&bench, "tracks.txt", &[]);
    assert_eq!(good.code, Some(0), "{good:?}");
    let rows = bench.read("tracks.txt");
    assert!(rows.lines().count() == 2, "{rows}");
    // `/dev/stdout` is a pipe here.
    let said = track(&bench, "/dev/stdout", &[]);
    assert!(said.code == Some(0) && said.stdout.starts_with(&rows), "{said:?}");
    assert!(std::path::Path::new("/dev/stdout").is_symlink(), "it is still a link to a descriptor");
    // And a file here, which also holds the output printed afterwards.
    let line = "swerve track boxes.txt --tracker sort --out /dev/stdout";
    let said = bench.shell(&format!("{line} > all.txt; {line} | head -n 1; {line} > /dev/full"));
    assert!(bench.read("all.txt").starts_with(&rows) && bench.read("all.txt").contains("boxes of tracks"));
    assert_eq!(said.stdout, format!("{}\n", rows.lines().next().unwrap()), "{said:?}");
    assert!(said.stderr.contains("No space left"), "{said:?}");
    let said = bench.shell(&format!("{line} 3>three.txt --out /dev/fd/3", line = &line[..line.len() - 18]));
    assert!(said.code == Some(0) && bench.read("three.txt") == rows, "{said:?}");
    assert!(Command::new("mkfifo").arg(bench.path("pipe")).status().unwrap().success());
    let said = bench.shell("cat pipe > read.txt & swerve track boxes.txt --tracker sort --out pipe; wait");
    assert!(said.code == Some(0) && bench.read("read.txt") == rows, "{said:?}");
    assert!(bench.path("pipe").metadata().unwrap().file_type().is_fifo(), "it is still a pipe");
    assert_eq!(track(&bench, "/dev/null", &[]).code, Some(0));
    assert!(std::path::Path::new("/dev/null").metadata().unwrap().file_type().is_char_device());
    let left: Vec<_> =
        std::fs::read_dir(bench.path("")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().contains(".part")), "{left:?}");
}

#[test]
fn foreign_files_are_replaced_with_consent_only() {
    let bench = bench();
    bench.write("mine.txt", "mine\n");
    let refused = |out: &str, what: &str| {
        let said = track(&bench, out, &[]);
        assert!(said.code == Some(1) && said.stderr.contains(what), "{out}: {said:?}");
    };
    refused("mine.txt", "--overwrite");
    assert_eq!(bench.read("mine.txt"), "mine\n");
    assert_eq!(track(&bench, "mine.txt", &["--overwrite"]).code, Some(0));
    let rows = bench.read("mine.txt");
    // The file is now the program's own until edited, if the file system supports extended attributes.
    if swerve_report::files::is_unchanged(&bench.path("mine.txt")).is_some() {
        assert_eq!(track(&bench, "mine.txt", &[]).code, Some(0));
        bench.write("mine.txt", &(rows.clone() + "a note\n"));
    }
    refused("mine.txt", "changed since");
    // A link is not followed, even with consent.
    bench.write("target", "target\n");
    symlink(bench.path("target"), bench.path("link")).unwrap();
    symlink(bench.path("nowhere"), bench.path("dangling")).unwrap();
    for link in ["link", "dangling"] {
        for more in [&[][..], &["--overwrite"]] {
            let said = track(&bench, link, more);
            assert!(
                said.code == Some(1) && said.stderr.contains("is a symbolic link to"),
                "{link}: {said:?}"
            );
        }
        assert!(bench.path(link).is_symlink());
    }
    assert_eq!(bench.read("target"), "target\n");
    assert!(!bench.path("nowhere").exists());
    refused(".", "it is a folder");
    // Each command that writes to a given file.
    bench.good(&["run", "short.toml", "--out", "o"]);
    bench.write("mine", "mine\n");
    bench.write("mine.svg", "mine\n");
    bench.write("mine.mp4", "mine\n");
    for words in [
        &["report", "o", "--out", "mine"][..],
        &["graph", "short.toml", "--picture", "mine.svg"],
        &["map", "build", "short.toml", "--out", "mine"],
        &["calibrate", "short.toml", "--out", "mine"],
        &["train", "lidar", "--out", "mine"],
        &["timing", "av", "--report", "mine"],
        &["timing", "av", "--picture", "mine.svg"],
        &["plan", "detour", "--planner", "fot", "--discretisation", "fast", "--report", "mine"],
        &["run", "short.toml", "--video", "mine.mp4"],
    ] {
        let said = bench.swerve(words);
        assert!(said.code == Some(1) && said.stderr.contains("or --overwrite"), "{words:?}: {said:?}");
    }
    for file in ["mine", "mine.svg", "mine.mp4"] {
        assert_eq!(bench.read(file), "mine\n", "{file}");
    }
    // The page of a run belongs to this program.
    bench.good(&["report", "o"]);
}

#[test]
fn folder_of_a_run_keeps_foreign_files() {
    let bench = bench();
    for name in ["report.html", "story.svg", "trace.json", "metrics.json", "log.mcap", "log.partial.mcap"] {
        std::fs::create_dir(bench.path("o")).unwrap();
        bench.write(&format!("o/{name}"), "mine");
        let run = ["run", "short.toml", "--out", "o"];
        let said = Said::of(&bench.plain_command(&run).output().unwrap());
        assert!(said.code == Some(1) && said.stderr.contains("or --overwrite"), "{name}: {said:?}");
        assert_eq!(bench.read(&format!("o/{name}")), "mine");
        let said = bench.swerve(&["study", "table1", "--out", "o", "--threads", "1", "--shard", "1/100000"]);
        let of_study = ["report.html", "metrics.json"].contains(&name);
        assert!(
            !of_study || said.code == Some(1) && said.stderr.contains("expected another --out"),
            "{said:?}"
        );
        std::fs::remove_dir_all(bench.path("o")).unwrap();
        // A link there is not followed, dangling or not.
        for target in ["target", "nowhere"] {
            bench.write("target", "target\n");
            std::fs::create_dir(bench.path("o")).unwrap();
            symlink(bench.path(target), bench.path(&format!("o/{name}"))).unwrap();
            for more in [&[][..], &["--overwrite"]] {
                let said = Said::of(&bench.plain_command(&[&run[..], more].concat()).output().unwrap());
                assert_eq!(said.code, Some(1), "{name}: {said:?}");
            }
            assert!(bench.read("target") == "target\n" && !bench.path("nowhere").exists(), "{name}");
            std::fs::remove_dir_all(bench.path("o")).unwrap();
        }
    }
    bench.good(&["run", "short.toml", "--out", "o"]);
    bench.good(&["replay", "o/log.mcap", "--from", "planner", "--out", "r"]);
    bench.good(&["replay", "o/log.mcap", "--from", "planner", "--out", "r", "--overwrite"]);
    assert!(!bench.path("r/log.partial.mcap").exists());
    bench.good(&["replay", "--verify", "r/log.mcap"]);
}

#[test]
fn video_is_a_file_of_exactly_the_given_name() {
    use std::os::unix::fs::PermissionsExt;
    let bench = bench();
    std::fs::create_dir(bench.path("bin")).unwrap();
    let script = "#!/bin/sh\nfor last; do :; done\necho \"$last\" >> \"$WORDS\"\ncat > \"$last\"\n";
    bench.write("bin/ffmpeg", script);
    std::fs::set_permissions(bench.path("bin/ffmpeg"), PermissionsExt::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", bench.path("bin").display(), std::env::var("PATH").unwrap());
    let run = |file: &str| {
        let mut call = bench.plain_command(&["run", "short.toml", &format!("--video={file}")]);
        Said::of(&call.env("PATH", &path).env("WORDS", bench.path("words")).output().unwrap())
    };
    for name in ["-y.mp4", "http:a.mp4", "pipe:1.mp4", "drive.mp4"] {
        let said = run(name);
        assert!(said.code == Some(0) && bench.path(name).metadata().unwrap().len() > 0, "{name}: {said:?}");
    }
    assert!(bench.read("words").lines().all(|file| file.starts_with('/')), "{}", bench.read("words"));
    assert!(run("http://127.0.0.1/a.mp4").stderr.contains("No such file"));
    bench.write("target", "target\n");
    symlink(bench.path("target"), bench.path("link.mp4")).unwrap();
    assert!(run("link.mp4").stderr.contains("is a symbolic link"));
    assert_eq!(bench.read("target"), "target\n");
}
