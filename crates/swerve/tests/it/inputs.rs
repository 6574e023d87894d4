//! Input files: regular files under any name, and the errors for others.

#![cfg(target_os = "linux")]

use std::process::Command;

use crate::support::{Bench, Said};

/// Runs the program, which must exit by itself.
fn soon(bench: &Bench, line: &str) -> Said {
    let said = Said::of(&bench.shell_command(&format!("exec timeout 30 {line} 2>&1")).output().unwrap());
    assert!(said.code != Some(124), "`{line}` waits for ever");
    said
}

fn pipe(bench: &Bench, name: &str) {
    assert!(Command::new("mkfifo").arg(bench.path(name)).status().unwrap().success());
}

#[test]
fn pipes_and_devices_are_refused_by_every_reader_without_waiting() {
    let bench = Bench::new();
    for name in ["p", "p.mcap", "p.toml", "p.png"] {
        pipe(&bench, name);
    }
    for args in [
        "check p.toml",
        "run p.toml",
        "run short.toml -c p.toml",
        "run short.toml --runtimes p.mcap",
        "study p.toml",
        "suite p.toml",
        "timing p.toml",
        "plan --planner fot --discretisation fast p",
        "live p.toml",
        "graph p.toml",
        "report p.mcap",
        "view p.mcap --no-open",
        "why p.mcap",
        "why p",
        "replay p.mcap",
        "track --tracker sort --out t.txt p",
        "eval localization p",
        "eval score p",
        "map check --map p short.toml",
        "map show p",
        "look --signs p.png",
        "look --detector p short.toml",
    ] {
        let said = soon(&bench, &format!("swerve {args}"));
        assert!(matches!(said.code, Some(1 | 2)), "{args}: {said:?}");
        assert!(said.stdout.contains("expected a regular file, found a pipe"), "{args}: {said:?}");
    }
    for (path, found) in [("/proc/kmsg", "a file of procfs"), ("/dev/zero", "a device"), (".", "a folder")] {
        for command in ["replay", "why"] {
            let said = soon(&bench, &format!("swerve {command} {path}"));
            // Only root can open the kernel log.
            let is_closed = said.stdout.contains("ermission denied") || said.stdout.contains("not permitted");
            let told = format!("expected a regular file, found {found}");
            assert!(said.code == Some(1) && (is_closed || said.stdout.contains(&told)), "{path}: {said:?}");
        }
    }
}

#[test]
fn files_named_in_files_must_be_regular() {
    let bench = Bench::new();
    pipe(&bench, "pipe");
    let study = "[[axis]]\nkey = \"seed\"\nvalues = [1]\n";
    let live = "[control]\ncontroller = \"mpc\"\n[ros2]\nvehicle = \"autoware\"\n";
    for (name, text, args, place) in [
        (
            "a.toml",
            format!("base = {{ scenario = \"pipe\" }}\n{study}"),
            "study a.toml",
            "a.toml:1: base.scenario: ",
        ),
        (
            "b.toml",
            format!("base = {{ scenario = \"/dev/stdin\" }}\n{study}"),
            "study b.toml",
            "b.toml:1: base.scenario: ",
        ),
        (
            "c.toml",
            format!("base = {{ scenario = \"short.toml\", config = \"pipe\" }}\n{study}"),
            "study c.toml",
            "c.toml:1: base.config: ",
        ),
        ("d.toml", format!("[live]\nroute = \"pipe\"\n{live}"), "live d.toml", "d.toml:2: live.route: "),
        (
            "e.toml",
            format!("[live]\nroute = \"short.toml\"\n{live}[source]\nrosbag = \"pipe\"\n"),
            "live e.toml",
            "e.toml:8: source.rosbag: ",
        ),
        (
            "f.toml",
            "[prediction]\npredictor = \"r2p2\"\nweights = \"pipe\"\n".to_owned(),
            "run short.toml -c f.toml",
            "f.toml:3: prediction.weights: ",
        ),
    ] {
        bench.write(name, &text);
        // Also without typed input.
        let said = soon(&bench, &format!("swerve {args} 0<> pipe"));
        assert!(said.stdout.contains(place), "{name}: {said:?}");
        assert!(said.stdout.contains("expected a regular file, found a pipe"), "{name}: {said:?}");
    }
}

#[test]
fn descriptor_of_the_caller_is_read_as_a_stream() {
    let bench = Bench::new();
    let whole = bench.good(&["run", "short.toml", "--out", "a"]);
    let piped = bench.shell("cat short.toml | swerve run /dev/stdin --out b");
    let digest = crate::support::digest;
    assert_eq!((piped.code, digest(&piped.stdout)), (Some(0), digest(&whole)), "{piped:?}");
}

#[test]
fn missing_files_are_reported_briefly() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("adir.toml")).unwrap();
    for (args, says) in [
        (&["run", "nosuch.toml"][..], "; `swerve scenarios` lists those of the program"),
        (
            &["run", "people_crosing.toml"],
            "; did you mean the scenario `people_crossing` that is in the program?",
        ),
        (&["run", "short.toml", "-c", "nosuch.toml"], "nosuch.toml: cannot be read: No such file"),
        (&["check", "adir.toml"], "error: adir.toml: no .toml file in this folder"),
    ] {
        let said = bench.swerve(args);
        assert!(said.code == Some(1) && said.stderr.contains(says), "{args:?}: {said:?}");
        assert!(said.stderr.lines().count() == 1 && said.stderr.len() < 200, "{args:?}: {said:?}");
    }
    let said = bench.swerve(&["rn"]);
    assert!(said.stderr.contains("'run'") && !said.stderr.contains("transport"), "{said:?}");
}

/// The test's driver prints an error where a Mesa layer would look for a display, as that layer does.
#[test]
fn drivers_do_not_look_for_a_missing_display() {
    let bench = Bench::new();
    bench.write(
        "driver.c",
        "#include <stdio.h>\n#include <stdlib.h>\n__attribute__((constructor)) static void look(void) {\n\
         if (!getenv(\"NODEVICE_SELECT\")) fputs(\"error: XDG_RUNTIME_DIR is not set\\n\", stderr);\n\
         else fputs(\"the driver is asked\\n\", stderr);\n}\n",
    );
    let made = Command::new("cc")
        .args(["-shared", "-fPIC", "-o", "libvulkan.so.1", "driver.c"])
        .current_dir(bench.path(""))
        .status();
    if !made.is_ok_and(|status| status.success()) {
        println!("no compiler for C: not looked at");
        return;
    }
    for args in [&["doctor"][..], &["dataset", "short.toml", "--out", "d"]] {
        let mut command = bench.command(args);
        command.env_remove("XDG_RUNTIME_DIR").env("LD_LIBRARY_PATH", bench.path(""));
        let said = Said::of(&command.output().unwrap());
        assert_eq!(said.code, Some(0), "{args:?}: {said:?}");
        assert!(!said.stderr.contains("XDG_RUNTIME_DIR"), "{args:?}: {said:?}");
        assert!(said.stderr.contains("the driver is asked"), "{args:?}: {said:?}");
    }
}
