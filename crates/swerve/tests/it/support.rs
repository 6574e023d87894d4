//! A folder in which to call the program, and a lock for timed tests.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempDir;

/// Serialises timed tests.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Three seconds past a person standing beside the lane; short, so that many runs take little time.
pub(crate) const SHORT: &str = r#"name = "short"

[road]
segments = [{ length_m = 80.0 }]
lane_width_m = 4.0
left_m = 6.0
right_m = 2.0

[ego]
target_speed_mps = 12.0
end_m = 20.0

[[actor]]
name = "person"
kind = "pedestrian"
s_m = 30.0
d_m = 4.0
trigger = { distance = { to = "ego", within_m = 25.0 } }
motion = [{ walk = { speed_mps = 1.0, distance_m = 1.0, direction = "left" } }]

[expect]
verdict = "avoided"
min_distance_m = { min = 0.5 }

[end]
timeout_s = 10.0
"#;

/// A folder with the scenario `short.toml` in it.
pub(crate) struct Bench {
    folder: TempDir,
}

impl Bench {
    pub(crate) fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        bench.write("short.toml", SHORT);
        bench
    }

    pub(crate) fn empty() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// The target folder of these tests.
    pub(crate) fn target() -> &'static Path {
        Path::new(env!("CARGO_BIN_EXE_swerve")).ancestors().nth(2).unwrap()
    }

    /// Gives the package of a new folder the lock file, profile and features of this workspace: in the target folder
    /// of these tests, only Swerve's own crates and the package are built then.
    pub(crate) fn use_builds_of_the_workspace(&self, folder: &str) {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        std::fs::copy(format!("{root}/Cargo.lock"), self.path(&format!("{folder}/Cargo.lock"))).unwrap();
        let workspace = std::fs::read_to_string(format!("{root}/Cargo.toml")).unwrap();
        let (_, profiles) = workspace.split_once("[profile.dev]").unwrap();
        let own = self.read(&format!("{folder}/Cargo.toml"));
        let (own, _) = own.split_once("[profile.dev]").unwrap();
        let own = own.replace("swerve = { ", "swerve = { features = [\"full\"], ");
        // Another program than that of other tests in the same target folder.
        let own = own.replace("my_stack", &format!("package_{folder}"));
        self.write(&format!("{folder}/Cargo.toml"), &format!("{own}[profile.dev]{profiles}"));
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// A call of the program, with `--overwrite` if `--out` is given.
    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let again = matches!(args.first(), Some(&("run" | "live"))) && args.contains(&"--out");
        let mut command = self.plain_command(args);
        command.args(again.then_some("--overwrite").filter(|flag| !args.contains(flag)));
        command
    }

    pub(crate) fn plain_command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_swerve"));
        command.args(args).current_dir(self.folder.path());
        command
    }

    pub(crate) fn swerve(&self, args: &[&str]) -> Said {
        Said::of(&self.command(args).output().unwrap())
    }

    /// Same as [`swerve`](Self::swerve), but must succeed; returns standard output.
    pub(crate) fn good(&self, args: &[&str]) -> String {
        let said = self.swerve(args);
        assert!(said.code == Some(0), "{args:?}: {said:?}");
        said.stdout
    }

    /// A shell line with the program on its path, as in `commands.txt` and the how-to pages.
    pub(crate) fn shell_command(&self, line: &str) -> Command {
        let program = Path::new(env!("CARGO_BIN_EXE_swerve"));
        let mut path = program.parent().unwrap().as_os_str().to_owned();
        path.push(":");
        path.push(std::env::var_os("PATH").unwrap_or_default());
        let mut shell = Command::new("sh");
        shell.args(["-c", line]).current_dir(self.folder.path()).env("PATH", path);
        shell
    }

    pub(crate) fn shell(&self, line: &str) -> Said {
        Said::of(&self.shell_command(line).output().unwrap())
    }
}

/// Digest printed by a run.
pub(crate) fn digest(said: &str) -> &str {
    said.lines().find_map(|line| line.trim().strip_prefix("digest")).expect("a run prints its digest").trim()
}

/// Output of a call of the program.
#[derive(Debug)]
pub(crate) struct Said {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Said {
    pub(crate) fn of(output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("the program prints UTF-8");
        Self { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) }
    }
}
