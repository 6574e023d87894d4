//! The job array of the how-to page, simulated: no Slurm is asked, the variables that it sets are set by hand, and
//! its tasks run one after the other.

use std::path::Path;
use std::process::Command;

use crate::support::{Bench, Said};

/// The page's two blocks: the batch script, and the lines that submit it and the merge.
fn blocks() -> (String, String) {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/howto/run_a_study.md");
    let page = std::fs::read_to_string(page).unwrap();
    let blocks: Vec<&str> = page.split("```sh\n").skip(1).filter_map(|b| b.split("```").next()).collect();
    let of = |start: &str| {
        let found: Vec<&&str> = blocks.iter().filter(|block| block.starts_with(start)).collect();
        assert_eq!(found.len(), 1, "blocks that begin with {start}");
        found[0].replace("configs/studies/planners.toml", "study.toml")
    };
    (of("#!/bin/bash\n"), of("array=$(sbatch "))
}

/// What stands between two marks, the first of which is there once.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    assert_eq!(text.matches(from).count(), 1, "`{from}` in {text}");
    text.split(from).nth(1).unwrap().split(to).next().unwrap()
}

#[test]
fn the_tasks_of_the_pages_array_run_all_shards_and_its_merge_joins_them() {
    let (script, submit) = blocks();
    let bench = Bench::new();
    let axis = "[[axis]]\nkey = \"seed\"\nvalues = [1, 2, 3, 4, 5, 6, 7, 8, 9]\n";
    bench.write("study.toml", &format!("base = {{ scenario = \"short.toml\" }}\n{axis}"));
    bench.write("my_study.sbatch", &script);
    bench.write("submit.sh", &submit);
    for name in ["my_study.sbatch", "submit.sh"] {
        let syntax = Command::new("bash").arg("-n").arg(bench.path(name)).output().unwrap();
        assert!(syntax.status.success() && syntax.stderr.is_empty(), "{name}: {syntax:?}");
    }
    assert!(submit.contains(" my_study.sbatch)"), "{submit}");

    let last = between(&script, "--array=1-", " ");
    assert!(script.contains(&format!("--shard $SLURM_ARRAY_TASK_ID/{last} ")), "{script}");
    let cpus = between(&script, "--cpus-per-task=", "\n");
    for task in 1..=last.parse::<usize>().unwrap() {
        let mut call = bench.shell_command("bash my_study.sbatch");
        call.env("SLURM_ARRAY_TASK_ID", task.to_string()).env("SLURM_CPUS_PER_TASK", cpus);
        let said = Said::of(&call.output().unwrap());
        assert_eq!(said.code, Some(0), "task {task}: {said:?}");
    }
    let merge = between(&submit, "--wrap \"", "\"");
    let said = bench.shell(merge);
    assert_eq!(said.code, Some(0), "{merge}: {said:?}");
    bench.good(&["study", "study.toml", "--out", "whole"]);
    for name in ["cells.csv", "heatmap.svg", "commands.txt"] {
        let (merged, whole) = (format!("out/planners/{name}"), format!("whole/{name}"));
        assert_eq!(bench.read(&merged), bench.read(&whole), "{name}");
    }
}
