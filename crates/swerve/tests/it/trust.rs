//! Programs named in files: started for the user's own files, or with `--allow-code`.

use std::collections::BTreeMap;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;

use swerve_core::Digest;
use swerve_log::{Recorder, RunEnd, RunStart};
use swerve_stack::config::programs::reaches_outside;

use crate::support::{Bench, SHORT, Said};

/// An operator whose program leaves a marker file and then fails to start.
fn evil(mark: &Path) -> String {
    format!(
        "[operator.evil]\nkind = \"python\"\ninputs = {{ pose = \"EgoState\" }}\n\
         outputs = {{ health = \"SensorHealth\" }}\nruntime = {{ zero = true }}\n\
         [process.evil]\noperators = [\"evil\"]\n{}",
        starts(mark)
    )
}

fn starts(mark: &Path) -> String {
    format!("start = [\"sh\", \"-c\", \"touch {}; exit 3\"]\n", mark.display())
}

/// Two folders: the current one of the call, and another one.
struct Sides {
    here: Bench,
    there: Bench,
}

impl Sides {
    fn new() -> Self {
        Self { here: Bench::new(), there: Bench::new() }
    }

    /// Path of a file in the other folder.
    fn away(&self, name: &str) -> String {
        self.there.path(name).display().to_string()
    }

    /// Calls the program; also returns true if the other program left its marker, which is removed.
    fn call(&self, words: &[&str]) -> (Said, bool) {
        let said = self.here.swerve(words);
        let ran = std::fs::remove_file(self.here.path("mark")).is_ok();
        (said, ran)
    }

    /// A call that must start nothing and name the option that allows it.
    fn refused(&self, words: &[&str], key: &str) -> Said {
        let (said, ran) = self.call(words);
        assert!(!ran, "{words:?} ran it: {said:?}");
        assert_eq!(said.code, Some(1), "{words:?}: {said:?}");
        let told = &said.stderr;
        assert!(told.contains(key) && told.contains("expected --allow-code to run `"), "{words:?}: {said:?}");
        said
    }

    /// Checks that a call is refused, and starts the program with consent.
    fn needs_consent(&self, words: &[&str], key: &str) {
        self.refused(words, key);
        let (said, ran) = self.call(&[words, &["--allow-code"]].concat());
        assert!(ran, "{words:?} did not run it with --allow-code: {said:?}");
    }
}

#[test]
fn configuration_from_outside_starts_programs_with_consent_only() {
    let sides = Sides::new();
    let mark = sides.here.path("mark");
    sides.there.write("c.toml", &evil(&mark));
    sides.here.write("own.toml", "[planning]\nplanner = \"fot\"\n");
    let config = sides.away("c.toml");
    let key = format!("{config}:8: process.evil.start: ");
    sides.needs_consent(&["run", "short.toml", "-c", &config], &key);
    sides.needs_consent(&["run", "short.toml", "-c", &config, "-c", "own.toml"], &key);
    sides.needs_consent(&["run", "short.toml", "-c", "own.toml", "-c", &config], &key);
    sides.needs_consent(&["suite", "short.toml", "-c", &config, "--seeds", "1"], &key);
    sides.needs_consent(&["calibrate", "short.toml", "-c", &config], &key);
    sides.refused(&["view", "short.toml", "-c", &config, "--no-open"], &key);
    let said = sides.refused(&["run", "short.toml", "-c", &config, "--out", "o"], &key);
    assert!(said.stderr.contains("outside of the current folder") && !sides.here.path("o").exists());
    let dataset = ["dataset", "short.toml", "-c", &config, "--tracks", "--out"];
    sides.refused(&[&dataset[..], &["d"]].concat(), "process.evil.start");
    // A vehicle's configuration too, and from the page.
    let plain =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live/plain.toml"))
            .unwrap();
    let route = format!("route = \"{}\"", sides.here.path("short.toml").display());
    let lines: Vec<&str> =
        plain.lines().map(|line| if line.starts_with("route") { &route } else { line }).collect();
    sides.there.write("live.toml", &(lines.join("\n") + "\n" + &evil(&mark)));
    let live = sides.away("live.toml");
    sides.refused(&["live", &live], "process.evil.start");
    sides.refused(&["view", "--live", &live, "--no-open"], "process.evil.start");
    // Commands that start nothing need no consent.
    sides.here.good(&["graph", "short.toml", "-c", &config]);
}

#[test]
fn own_configuration_starts_programs_without_an_option() {
    let sides = Sides::new();
    let mark = sides.here.path("mark");
    std::fs::create_dir(sides.here.path("configs")).unwrap();
    sides.here.write("configs/c.toml", &evil(&mark));
    let run = ["run", "short.toml", "-c", "configs/c.toml"];
    let (said, ran) = sides.call(&run);
    assert!(ran, "{said:?}");
    assert!(said.stderr.contains("note: process.evil.start runs `sh -c 'touch "), "{said:?}");
    // Nor does a program named on the command line.
    let sets =
        evil(&mark).lines().filter(|line| !line.starts_with('[')).map(str::to_owned).collect::<Vec<_>>();
    let (operator, process) = sets.split_at(4);
    let set = |table: &str, line: &String| format!("{table}.evil.{}", line.replacen(" = ", "=", 1));
    let operator = operator.iter().map(|line| set("operator", line));
    let sets: Vec<String> = operator.chain(process.iter().map(|line| set("process", line))).collect();
    let words: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    let (said, ran) = sides.call(&[&["run", "short.toml"], &words[..]].concat());
    assert!(ran, "{said:?}");
    // The file is not trusted if others can write it or it links elsewhere.
    let path = sides.here.path("configs/c.toml");
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o666)).unwrap();
    assert!(sides.refused(&run, "process.evil.start").stderr.contains("writable by everybody"));
    sides.there.write("c.toml", &evil(&mark));
    std::fs::remove_file(&path).unwrap();
    symlink(sides.there.path("c.toml"), &path).unwrap();
    assert!(sides.refused(&run, "process.evil.start").stderr.contains("outside of the current folder"));
}

#[test]
fn every_key_naming_a_program_needs_consent() {
    let sides = Sides::new();
    let interpreter = sides.there.path("python");
    let script = format!("#!/bin/sh\ntouch {}\n", sides.here.path("mark").display());
    std::fs::write(&interpreter, script).unwrap();
    std::fs::set_permissions(&interpreter, PermissionsExt::from_mode(0o755)).unwrap();
    sides.there.write("op.py", "");
    let text = evil(Path::new("unused"));
    let head = text.split("start").next().unwrap();
    sides.there.write("c.toml", &format!("{head}python = \"op.py:Op\"\ninterpreter = \"./python\"\n"));
    let config = sides.away("c.toml");
    sides.needs_consent(&["run", "short.toml", "-c", &config], "process.evil.");
    // A foreign key among the user's own.
    sides.there.write("i.toml", "[process.evil]\ninterpreter = \"./python\"\n");
    sides.here.write("op.py", "");
    sides.here.write("c.toml", &format!("{head}python = \"op.py:Op\"\n"));
    let other = sides.away("i.toml");
    sides.needs_consent(&["run", "short.toml", "-c", "c.toml", "-c", &other], "process.evil.interpreter");
}

#[test]
fn study_from_outside_starts_programs_with_consent_only() {
    let sides = Sides::new();
    let mark = sides.here.path("mark");
    let without_start = evil(&mark).replace(&starts(&mark), "start = [\"true\"]\n");
    sides.here.write("c.toml", &without_start);
    let (scenario, config) = (sides.here.path("short.toml"), sides.here.path("c.toml"));
    let base = format!("base = {{ scenario = \"{}\", config = \"{}\"", scenario.display(), config.display());
    let axis = "[[axis]]\nkey = \"seed\"\nvalues = [1]\n";
    let set = starts(&mark).trim().replacen("start", "\"process.evil.start\"", 1);
    sides.there.write("base.toml", &format!("{base}, set = {{ {set} }} }}\n{axis}"));
    let settings = format!("[[axis]]\nname = \"a\"\nsettings = [{{ name = \"x\", set = {{ {set} }} }}]\n");
    sides.there.write("axis.toml", &format!("{base} }}\n{settings}"));
    for name in ["base.toml", "axis.toml"] {
        let study = sides.away(name);
        sides.needs_consent(&["study", &study], &format!("{study}: process.evil.start"));
        let said = sides.here.swerve(&["check", &study]);
        assert!(said.code == Some(0) && said.stderr.contains("with --allow-code only"), "{name}: {said:?}");
        sides.here.write(name, &sides.there.read(name));
        let (said, ran) = sides.call(&["study", name]);
        assert!(ran, "{name} is the user's own: {said:?}");
    }
    // A study of the user's own over a foreign configuration.
    sides.there.write("c.toml", &evil(&mark));
    let config = sides.away("c.toml");
    sides
        .here
        .write("own.toml", &format!("base = {{ scenario = \"short.toml\", config = \"{config}\" }}\n{axis}"));
    sides.needs_consent(&["study", "own.toml"], &format!("{config}:8: process.evil.start"));
    let said = sides.here.swerve(&["check", "own.toml"]);
    assert!(said.stderr.contains("with --allow-code only") && said.stderr.contains(&config), "{said:?}");
}

/// Writes a log whose configuration names a program.
fn log(path: &Path, mark: &Path) {
    let extra = BTreeMap::from([("scenario".to_owned(), SHORT.to_owned())]);
    let start = RunStart { version: "0".into(), seed: 1, config: evil(mark), extra };
    let mut recorder = Recorder::create(path, &start).unwrap();
    let end = RunEnd { digest: Digest::default(), ..RunEnd::default() };
    recorder.end(end);
    recorder.finish().unwrap();
}

#[test]
fn log_starts_programs_with_consent_only_and_wherever_it_is() {
    let sides = Sides::new();
    let mark = sides.here.path("mark");
    // Being in the current folder does not make a log trusted.
    std::fs::create_dir(sides.here.path("o")).unwrap();
    log(&sides.here.path("o/log.mcap"), &mark);
    let key = "o/log.mcap:8: process.evil.start: a log does not start programs; not started";
    let replay = ["replay", "o/log.mcap"];
    sides.needs_consent(&replay, key);
    sides.needs_consent(&[&replay[..], &["--verify"]].concat(), key);
    sides.needs_consent(&[&replay[..], &["--set", "planning.added_latency_ms=10"]].concat(), key);
    for words in
        [&["report", "o"][..], &["why", "o/log.mcap"], &["run", "short.toml", "--runtimes", "o/log.mcap"]]
    {
        let (said, ran) = sides.call(words);
        assert!(!ran, "{words:?}: {said:?}");
    }
    let page = sides.here.read("o/report.html");
    assert!(page.contains("process.evil.start runs `sh -c "), "the page lists it");
    // A program that the user sets in its place is started.
    let other = sides.here.path("other");
    let set = format!("process.evil.start=[\"sh\", \"-c\", \"touch {}; exit 3\"]", other.display());
    let (said, ran) = sides.call(&["replay", "o/log.mcap", "--set", &set]);
    assert!(!ran && other.exists(), "{said:?}");
}

#[test]
fn check_lists_programs() {
    let sides = Sides::new();
    let mark = sides.here.path("mark");
    sides.here.write("c.toml", &evil(&mark).replace("touch", "\\u001b[2Jtouch"));
    sides.there.write("c.toml", &evil(&mark));
    let (said, ran) = sides.call(&["check", "c.toml"]);
    assert!(!ran && said.code == Some(0), "{said:?}");
    let line = "note: c.toml: process.evil.start runs `sh -c '\\u{1b}[2Jtouch ";
    assert!(said.stderr.starts_with(line) && !said.stderr.contains("--allow-code"), "{said:?}");
    let (said, ran) = sides.call(&["check", &sides.away("c.toml")]);
    assert!(
        !ran && said.stderr.contains(", with --allow-code only (") && said.stderr.contains("outside of"),
        "{said:?}"
    );
}

#[test]
fn every_key_naming_a_file_is_refused_on_the_page_of_a_view() {
    let keys = Bench::new().good(&["keys", "--json"]);
    let keys: serde_json::Value = serde_json::from_str(&keys).unwrap();
    let names_file = |doc: &str| {
        let doc = doc.to_lowercase();
        ["path from", "file of", "shared memory", "file as"].iter().any(|word| doc.contains(word))
    };
    let mut found = 0;
    for key in keys.as_array().unwrap() {
        let (name, doc) = (key["key"].as_str().unwrap(), key["doc"].as_str().unwrap_or_default());
        if names_file(doc) || name.starts_with("process.") {
            let name = name.split(' ').next().unwrap().replace("NAME", "x").replace("[]", "");
            assert!(reaches_outside(&name, &"a".into()).is_some(), "{name}: {doc}");
            found += 1;
        }
    }
    assert!(found >= 9, "only {found} keys name files");
}
