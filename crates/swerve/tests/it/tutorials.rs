//! Tutorials: the files of a page are written and its commands are run, in the order of the page.
//!
//! Fenced blocks: `sh` is run; `text` has lines of the output of the commands before it, and `...` for any lines in
//! between; a language and a name are a file. `.ci/python` runs the blocks `sh python`, and all of `highway.md`.

use crate::support::{Bench, Said};

/// A fenced block: line, info string, text.
struct Block {
    line: usize,
    info: String,
    text: String,
}

fn blocks(page: &str) -> Vec<Block> {
    let (mut blocks, mut open) = (Vec::new(), None::<Block>);
    for (i, line) in page.lines().enumerate() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some(info), None) => {
                open = Some(Block { line: i + 1, info: info.trim().to_owned(), text: String::new() });
            }
            (None, Some(block)) => block.text += &format!("{line}\n"),
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a fence is never closed");
    blocks
}

/// First line of `expected` that is missing in `output`, in this order; `...` stands for any lines.
fn missing<'a>(expected: &'a str, output: &str) -> Option<&'a str> {
    let mut output = output.lines().map(str::trim_end);
    let mut skips = true;
    for line in expected.lines().map(str::trim_end) {
        if line == "..." {
            skips = true;
            continue;
        }
        let found = if skips { output.any(|has| has == line) } else { output.next() == Some(line) };
        if !found {
            return Some(line);
        }
        skips = false;
    }
    None
}

/// Follows a page in an empty folder: runs `sh` and the marks given; `prepare` is called before each block.
fn follow(page: &str, marks: &[&str], environment: &[(&str, &str)], prepare: impl Fn(&Bench)) {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let text = std::fs::read_to_string(format!("{root}/docs/tutorial/{page}")).unwrap();
    let bench = Bench::empty();
    let (mut folder, mut output, mut runs) = (bench.path("."), None::<String>, 0);
    for block in blocks(&text) {
        let place = format!("docs/tutorial/{page}:{}", block.line);
        prepare(&bench);
        match block.info.split_once(' ').unwrap_or((&block.info, "")) {
            ("sh", mark) if mark.is_empty() || marks.contains(&mark) => {
                let lines = format!(
                    "set -e\ncd '{}'\n{}\npwd > '{}'",
                    folder.display(),
                    block.text,
                    bench.path(".pwd").display()
                );
                let said = Said::of(
                    &bench.shell_command(&lines).envs(environment.iter().copied()).output().unwrap(),
                );
                assert!(said.code == Some(0), "{place}: {said:?}");
                folder = bench.read(".pwd").trim_end().into();
                output = Some(said.stdout);
                runs += 1;
            }
            ("sh", mark) => {
                assert!(
                    ["install", "long", "python", "rust"].contains(&mark),
                    "{place}: unknown mark `{mark}`"
                );
                output = None;
            }
            ("text", "") => {
                let missed = output.as_ref().and_then(|output| missing(&block.text, output));
                assert!(missed.is_none(), "{place}: no line `{}` in\n{}", missed.unwrap(), output.unwrap());
            }
            (_, name) => {
                assert!(!name.is_empty(), "{place}: expected a file name after `{}`", block.info);
                std::fs::write(folder.join(name), block.text).unwrap();
            }
        }
    }
    assert!(runs >= 2, "only {runs} blocks of commands");
}

#[test]
fn missing_lines_are_found() {
    assert_eq!(missing("a\n...\nd\n", "x\na\nb\nc\nd \n"), None);
    assert_eq!(missing("a\nc\n", "a\nb\nc\n"), Some("c"));
    assert_eq!(missing("a\n...\nd\n", "d\na\n"), Some("d"));
    assert_eq!(blocks("```sh rust\nls\n```\nsaid\n")[0].info, "sh rust");
}

#[test]
fn first_result_runs_without_its_planners() {
    follow("first_result.md", &[], &[], |_| {});
}

/// Folder of SUMO's Python package: its environment is the first on the path, as in `.ci/sumo`.
fn has_sumo() -> bool {
    let sumo = std::process::Command::new("python3").args(["-c", "import sumo"]).output();
    let found = sumo.is_ok_and(|said| said.status.success());
    if !found {
        swerve_tests::skipped(
            "Python's package eclipse-sumo is not installed: its maps are those of the page",
        );
    }
    found
}

/// Computes for a minute or more: `.ci/run` runs it beside the tests with the real clock.
mod long {
    use super::*;

    #[test]
    #[ignore = "builds a package on Swerve"]
    fn planner_of_the_first_result_drives_in_rust() {
        let target = Bench::target();
        let environment = [("CARGO_TARGET_DIR", target.to_str().unwrap()), ("CARGO_NET_OFFLINE", "true")];
        follow("first_result.md", &["rust"], &environment, |bench| {
            if bench.path("my_study/Cargo.toml").exists() && !bench.path("my_study/Cargo.lock").exists() {
                bench.use_builds_of_the_workspace("my_study");
            }
        });
    }

    #[test]
    #[ignore = "drives through a town with a lidar"]
    fn town_runs_with_its_study() {
        if has_sumo() {
            follow("town.md", &["long"], &[], |_| {});
        }
    }
}
