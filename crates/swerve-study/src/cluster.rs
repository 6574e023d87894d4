//! Studies over several machines with a shared folder: writes and submits the job that drives and merges the shards.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, bail, ensure};
use swerve_drive::trust::CodeArgs;
use swerve_report::files::write_whole;
use swerve_report::output::{print, quoted};

/// Scheduler that provides the machines for a study.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
pub(crate) enum Cluster {
    /// Job array of `sbatch`, and a job that merges the shards when all are done
    Slurm,
    /// Ray tasks, run by the Python in SWERVE_PYTHON, else python3
    Ray,
}

/// Study to submit.
pub(crate) struct Job<'a> {
    /// The study's file.
    pub(crate) file: &'a Path,
    /// Assignments for every cell.
    pub(crate) sets: &'a [String],
    /// Consent to the programs that the study names; needed because shards run in other folders.
    pub(crate) code: CodeArgs,
    /// Results folder; the shards are in a subfolder.
    pub(crate) out: &'a Path,
    /// If true, the results of another study may be replaced there.
    pub(crate) overwrite: bool,
    /// Number of shards.
    pub(crate) shards: usize,
    /// Cores per shard.
    pub(crate) threads: usize,
}

impl Job<'_> {
    /// Writes the job, submits it and prints the result.
    ///
    /// # Errors
    /// If the cluster is not available here (the job file is still written), or rejects the job.
    pub(crate) fn submit(&self, cluster: Cluster) -> anyhow::Result<()> {
        ensure!((1..=10_000).contains(&self.shards), "--shards {}: expected 1 to 10000", self.shards);
        std::fs::create_dir_all(self.out).with_context(|| self.out.display().to_string())?;
        let program = std::env::current_exe().context("looking for the own program")?;
        match cluster {
            Cluster::Slurm => self.to_slurm(&program),
            Cluster::Ray => self.to_ray(&program),
        }
    }

    /// Command line of a shard without its number, and of the merge without the shard folders.
    fn calls(&self, program: &Path) -> [Vec<String>; 2] {
        let text = |path: &Path| path.display().to_string();
        let sets = self.sets.iter().flat_map(|set| ["--set".to_owned(), set.clone()]);
        let study = || vec![text(program), "study".to_owned()];
        let mut shard = study();
        shard.extend([text(self.file), "--threads".into(), self.threads.to_string()]);
        shard.extend(sets.clone());
        shard.extend(self.code.words().split_whitespace().map(str::to_owned));
        let mut merge = study();
        merge.extend(["merge".into(), "--study".into(), text(self.file), "--out".into(), text(self.out)]);
        merge.extend(sets);
        if self.overwrite {
            shard.push("--overwrite".into());
            merge.push("--overwrite".into());
        }
        [shard, merge]
    }

    fn to_slurm(&self, program: &Path) -> anyhow::Result<()> {
        let [shard, merge] = self.calls(program).map(|words| shell(&words));
        let (out, shards) = (shell(&[self.out.display().to_string()]), self.shards);
        let script = self.out.join("study.sbatch");
        let text = format!(
            "#!/bin/bash\n\
             #SBATCH --array=1-{shards} --cpus-per-task={}\n\
             #SBATCH --output={out}/slurm-%a.txt\n\
             exec {shard} --shard $SLURM_ARRAY_TASK_ID/{shards} --out {out}/shards/$SLURM_ARRAY_TASK_ID\n",
            self.threads
        );
        write_whole(&script, text.as_bytes())?;
        let folders = (1..=shards).fold(String::new(), |mut folders, i| {
            let _written = write!(folders, " {out}/shards/{i}");
            folders
        });
        let array = sbatch(&[script.display().to_string()])
            .with_context(|| format!("the job is in {}: submit it where Slurm is", script.display()))?;
        let after = format!("--dependency=afterok:{array}");
        let log = format!("--output={out}/slurm-merge.txt");
        let joins = sbatch(&[after, log, "--wrap".into(), format!("{merge}{folders}")])?;
        print(&format!(
            "job {array} drives {shards} shards, job {joins} joins them in {}\n",
            self.out.display()
        ))
    }

    fn to_ray(&self, program: &Path) -> anyhow::Result<()> {
        let [shard, merge] = self.calls(program);
        let script = self.out.join("study_on_ray.py");
        let text = format!(
            "import subprocess\n\nimport ray\n\nSHARDS = {}\nOUT = {}\nSHARD = {}\nMERGE = {}\n\n\n\
             @ray.remote(num_cpus={}, max_retries=3)\n\
             def drive(i):\n    \
                 folder = f\"{{OUT}}/shards/{{i}}\"\n    \
                 subprocess.run([*SHARD, \"--shard\", f\"{{i}}/{{SHARDS}}\", \"--out\", folder], check=True)\n    \
                 return folder\n\n\n\
             ray.init()\n\
             folders = ray.get([drive.remote(i) for i in range(1, SHARDS + 1)])\n\
             subprocess.run([*MERGE, *folders], check=True)\n",
            self.shards,
            python(&absolute(self.out)?),
            list(&self.absolute(&shard)?),
            list(&self.absolute(&merge)?),
            self.threads,
        );
        write_whole(&script, text.as_bytes())?;
        let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".into());
        let has = Command::new(&python).args(["-c", "import ray"]).stderr(Stdio::null()).status();
        if !has.is_ok_and(|status| status.success()) {
            let script = script.display();
            bail!(
                "{python} has no Ray (pip install ray; SWERVE_PYTHON names another Python); the job is in {script}"
            );
        }
        let done = Command::new(&python).arg(&script).status().with_context(|| python.clone())?;
        ensure!(done.success(), "{} failed: {done}; the same command goes on from here", script.display());
        Ok(())
    }

    /// Makes the paths of the study and the results absolute, since Ray workers run in other folders.
    fn absolute(&self, words: &[String]) -> anyhow::Result<Vec<String>> {
        let is_file = |word: &&String| Path::new(word) == self.file && self.file.exists();
        let is_path = |word: &String| is_file(&word) || Path::new(word) == self.out;
        words
            .iter()
            .map(|word| if is_path(word) { absolute(Path::new(word)) } else { Ok(word.clone()) })
            .collect()
    }
}

fn absolute(path: &Path) -> anyhow::Result<String> {
    let path: PathBuf = std::path::absolute(path).with_context(|| path.display().to_string())?;
    Ok(path.display().to_string())
}

/// Submits a job to Slurm. Returns the job number.
fn sbatch(words: &[String]) -> anyhow::Result<String> {
    let said = Command::new("sbatch").arg("--parsable").args(words).output().context("calling sbatch")?;
    let text = String::from_utf8_lossy(&said.stdout);
    // With several clusters the output is `number;cluster`.
    let number = text.trim().split(';').next().unwrap_or_default().to_owned();
    let told = String::from_utf8_lossy(&said.stderr);
    ensure!(said.status.success() && !number.is_empty(), "sbatch: {}", told.trim());
    Ok(number)
}

/// Shell command line with quoted words.
fn shell(words: &[String]) -> String {
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

fn list(words: &[String]) -> String {
    format!("[{}]", words.iter().map(|word| python(word)).collect::<Vec<_>>().join(", "))
}

/// Python string literal; JSON strings are valid ones.
fn python(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
