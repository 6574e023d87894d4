//! A study on simulated Slurm: a fake `sbatch` records its input, and the test runs it as Slurm would.

use crate::support::{Bench, Said};

const AXIS: &str = "[[axis]]\nkey = \"seed\"\nvalues = \"1..5\"\n";

/// Records its arguments and its script, and answers with an increasing number.
const SBATCH: &str = "#!/bin/bash\n\
    n=$(ls calls | wc -l)\n\
    printf '%s\\n' \"$@\" > calls/$n\n\
    echo $((n + 100))\n";

#[test]
fn job_runs_all_shards_and_merges_them() {
    let bench = Bench::new();
    bench.write("study.toml", &format!("base = {{ scenario = \"short.toml\" }}\n{AXIS}"));
    for folder in ["calls", "bin"] {
        std::fs::create_dir(bench.path(folder)).unwrap();
    }
    bench.write("bin/sbatch", SBATCH);
    assert_eq!(bench.shell("chmod +x bin/sbatch").code, Some(0));
    let line = "PATH=$PWD/bin:$PATH swerve study study.toml --on slurm --shards 3 --threads 2 --out 'my out' \
                --set 'planning.added_latency_ms=20'";
    let said = bench.shell(line);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.stdout.contains("job 100 drives 3 shards, job 101 joins them in my out"), "{said:?}");

    assert_eq!(bench.read("calls/0"), "--parsable\nmy out/study.sbatch\n");
    let script = bench.read("my out/study.sbatch");
    assert!(script.contains("#SBATCH --array=1-3 --cpus-per-task=2\n"), "{script}");
    for task in 1..=3 {
        let mut call = bench.shell_command("bash 'my out/study.sbatch'");
        let said = Said::of(&call.env("SLURM_ARRAY_TASK_ID", task.to_string()).output().unwrap());
        assert_eq!(said.code, Some(0), "task {task}: {said:?}");
    }
    let submitted = bench.read("calls/1");
    let words: Vec<&str> = submitted.lines().collect();
    assert_eq!(words[1], "--dependency=afterok:100");
    let merge = words.last().unwrap();
    let said = bench.shell(merge);
    assert_eq!(said.code, Some(0), "{merge}: {said:?}");
    bench.good(&["study", "study.toml", "--out", "whole", "--set", "planning.added_latency_ms=20"]);
    for name in ["cells.csv", "heatmap.svg", "commands.txt"] {
        assert_eq!(bench.read(&format!("my out/{name}")), bench.read(&format!("whole/{name}")), "{name}");
    }
}

#[test]
fn missing_slurm_is_reported_and_the_job_is_written() {
    let bench = Bench::new();
    bench.write("study.toml", &format!("base = {{ scenario = \"short.toml\" }}\n{AXIS}"));
    let said = bench.shell("swerve study study.toml --on slurm --shards 3 --out o");
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.stderr.contains("the job is in o/study.sbatch: submit it where Slurm is"), "{said:?}");
    assert!(bench.read("o/study.sbatch").starts_with("#!/bin/bash\n"));
    let said = bench.shell("swerve study study.toml --on slurm --shards 0 --out o");
    assert!(said.stderr.contains("--shards 0: expected 1 to 10000"), "{said:?}");
}
