//! Trust in files that name programs: the user's own files may start them, others may not.
//!
//! A file is the user's own if it is built in, or if it is a regular file in or below the current folder, symbolic
//! links resolved, where the file and every folder up to the current one belong to the user or to root and are not
//! world-writable. If the current folder is the root or the home folder, no file is the user's own: downloads are below
//! them. A log is never the user's own: it holds the configuration of its recorder.

use std::path::Path;

use swerve_report::output::tell;
use swerve_stack::Setup;
use swerve_stack::config::programs::shown;

/// Consent to the programs named in files.
#[derive(clap::Args, Clone, Copy, Default, Debug)]
pub struct CodeArgs {
    /// Start programs named in logs, and in configurations and studies from outside the current folder:
    /// process.NAME.start, python and interpreter
    #[arg(long)]
    pub allow_code: bool,
}

impl CodeArgs {
    /// Allows all programs of a configuration if the user has consented.
    pub fn apply(self, config: &mut Setup) {
        if self.allow_code {
            config.allow_programs();
        }
    }

    /// Same as [`apply`](Self::apply), for a configuration that is about to be run.
    ///
    /// # Errors
    /// Same as [`start`].
    pub fn start(self, config: &mut Setup) -> anyhow::Result<()> {
        self.apply(config);
        start(config)
    }

    /// The option for a command line, after a space; empty without consent.
    pub fn words(self) -> &'static str {
        if self.allow_code { " --allow-code" } else { "" }
    }
}

/// Reason why programs named in a log are not started.
pub const DOUBT_OF_LOGS: &str = "a log does not start programs";

/// Reason why a file with this text is not the user's own; `None` if it is.
pub fn doubt(path: &Path, text: &str) -> Option<String> {
    let here = std::env::current_dir().and_then(|here| here.canonicalize());
    let (Ok(real), Ok(here)) = (path.canonicalize(), here) else {
        return Some("the file cannot be found again".into());
    };
    if let Some(doubt) = doubt_of_place(&real, &here) {
        return Some(doubt);
    }
    // No other user can change the file now; it is either the text that was read, or that text came from elsewhere.
    let is_same = swerve_text::read_bytes(&real, swerve_text::FILE_MAX)
        .is_ok_and(|bytes| without_mark(&bytes) == without_mark(text.as_bytes()));
    (!is_same).then(|| "the file changed while it was read".into())
}

/// Text without the UTF-8 byte-order mark.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes)
}

fn doubt_of_place(real: &Path, here: &Path) -> Option<String> {
    let is_home =
        std::env::home_dir().and_then(|home| home.canonicalize().ok()).is_some_and(|home| home == here);
    if here.parent().is_none() || is_home {
        let here = here.display();
        return Some(format!("the current folder {here} is too wide to make files below it your own"));
    }
    if !real.starts_with(here) {
        return Some(format!("the file is outside of the current folder {}", here.display()));
    }
    let up_to_here = real.ancestors().take_while(|path| path.starts_with(here));
    up_to_here.enumerate().find_map(|(k, path)| doubt_of_owner(path, k == 0))
}

/// Reason why another user may have written a file or folder.
#[cfg(unix)]
fn doubt_of_owner(path: &Path, is_file: bool) -> Option<String> {
    use std::os::unix::fs::MetadataExt as _;
    const OTHERS_WRITE: u32 = 0o002;
    let shown = path.display();
    let Ok(metadata) = path.symlink_metadata() else { return Some(format!("{shown} cannot be examined")) };
    let user = rustix::process::geteuid().as_raw();
    match metadata.uid() {
        _ if is_file && !metadata.is_file() => Some("it is not a regular file".into()),
        owner if owner != user && owner != 0 => Some(format!("{shown} belongs to another user")),
        _ if metadata.mode() & OTHERS_WRITE != 0 => Some(format!("{shown} is writable by everybody")),
        _ => None,
    }
}

#[cfg(not(unix))]
fn doubt_of_owner(_: &Path, _: bool) -> Option<String> {
    None
}

/// Lists the programs of a configuration, one per line, as in `process.far.start runs `ssh far``.
pub fn programs(config: &Setup) -> Vec<String> {
    config.programs().map(|program| format!("{} runs `{}`", program.key, shown(&program.words))).collect()
}

/// Same as [`programs`], with the reasons why some need `--allow-code`.
pub fn programs_with_doubts(config: &Setup) -> Vec<String> {
    let line = |(line, name): (String, &String)| match config.refusal(name) {
        Some(refusal) => format!("{line}, with --allow-code only ({})", refusal.why),
        None => line,
    };
    let named = config.process.keys().filter(|name| config.names_program(name));
    programs(config).into_iter().zip(named).map(line).collect()
}

/// Reports the programs of a drive on standard error. Called before the drive, so that a refusal has no other effect.
///
/// # Errors
/// If the user has not consented to one of them.
pub fn start(config: &Setup) -> anyhow::Result<()> {
    check(config, config.process.keys())?;
    programs(config).iter().for_each(|line| tell(&format!("note: {line}")));
    Ok(())
}

/// Refuses processes whose programs the user has not consented to.
///
/// # Errors
/// All refusals, with key and command line.
pub fn check<'a>(config: &Setup, processes: impl IntoIterator<Item = &'a String>) -> anyhow::Result<()> {
    let refusals = processes.into_iter().filter_map(|name| config.refusal(name));
    let refusals: Vec<String> = refusals.map(|refusal| refusal.to_string()).collect();
    anyhow::ensure!(refusals.is_empty(), "{}", refusals.join("\n"));
    Ok(())
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    /// Reason why a file is not the user's own, as seen from a folder; empty if it is.
    fn place(file: &Path, here: &Path) -> String {
        let [file, here] = [file, here].map(|path| path.canonicalize().unwrap());
        doubt_of_place(&file, &here).unwrap_or_default()
    }

    #[test]
    fn own_files_are_below_the_current_folder_and_not_writable_by_others() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mode =
            |path: &Path, mode| std::fs::set_permissions(path, PermissionsExt::from_mode(mode)).unwrap();
        std::fs::create_dir_all(at("mine/configs")).unwrap();
        std::fs::create_dir_all(at("other")).unwrap();
        for file in ["mine/configs/c.toml", "mine/c.toml", "other/c.toml"] {
            std::fs::write(at(file), "").unwrap();
            mode(&at(file), 0o644);
        }
        symlink(at("other/c.toml"), at("mine/link.toml")).unwrap();
        symlink(at("other"), at("mine/linked")).unwrap();
        let mine = at("mine");
        let of = |file: &str| place(&at(file), &mine);
        assert_eq!(of("mine/c.toml"), "");
        assert_eq!(of("mine/configs/c.toml"), "");
        for outside in ["other/c.toml", "mine/link.toml", "mine/linked/c.toml", "mine/../other/c.toml"] {
            assert!(of(outside).starts_with("the file is outside of"), "{outside}: {}", of(outside));
        }
        assert_eq!(of("mine/configs"), "it is not a regular file");
        mode(&at("mine/configs"), 0o777);
        assert!(of("mine/configs/c.toml").ends_with("configs is writable by everybody"));
        mode(&at("mine/c.toml"), 0o646);
        assert!(of("mine/c.toml").ends_with("c.toml is writable by everybody"));
        mode(&at("mine/c.toml"), 0o644);
        mode(&mine, 0o1777);
        assert!(of("mine/c.toml").ends_with("mine is writable by everybody"), "also where it is sticky");
        assert!(place(&at("other/c.toml"), Path::new("/")).contains("too wide"));
        let home = std::env::home_dir().filter(|home| home.is_dir());
        home.iter().for_each(|home| assert!(place(home, home).contains("too wide")));
    }

    #[test]
    fn text_read_elsewhere_is_not_trusted() {
        // Unit tests run in the folder of their crate.
        let manifest = Path::new("Cargo.toml");
        let text = std::fs::read_to_string(manifest).unwrap();
        assert_eq!(doubt(manifest, &text), None);
        assert_eq!(doubt(manifest, &(text + " ")).unwrap(), "the file changed while it was read");
        assert!(doubt(Path::new("/proc/self/status"), "").is_some());
    }
}
