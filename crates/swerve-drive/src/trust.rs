//! Trust in the files that name programs: a file of the user's own may start them, any other may not.
//!
//! A file is the user's own if it is in the program, or if it is a regular file in or below the current folder, symbolic
//! links resolved, where the file and every folder up to the current one belong to the user or to root and are not
//! writable by everybody. The root folder and the home folder make nothing below them the user's own: downloads are
//! below them. A log is never the user's own: it holds the configuration of whoever recorded it.

use std::path::Path;

use swerve_report::output::tell;
use swerve_stack::config::Config;
use swerve_stack::config::programs::shown;

/// Consent to the programs that files name.
#[derive(clap::Args, Clone, Copy, Default, Debug)]
pub struct CodeArgs {
    /// Start the programs that files name which are not yours: process.NAME.start, python and interpreter of logs, and of
    /// configurations and studies from outside the current folder
    #[arg(long)]
    pub allow_code: bool,
}

impl CodeArgs {
    /// Has the user's consent, if it is given, cover all that a configuration names.
    pub fn apply(self, config: &mut Config) {
        if self.allow_code {
            config.allow_programs();
        }
    }

    /// As [`apply`](Self::apply), for a configuration that is about to be driven.
    ///
    /// # Errors
    /// As [`start`].
    pub fn start(self, config: &mut Config) -> anyhow::Result<()> {
        self.apply(config);
        start(config)
    }

    /// The option as a command line has it, after a space.
    pub fn words(self) -> &'static str {
        if self.allow_code { " --allow-code" } else { "" }
    }
}

/// The reason why a log names no programs that are started.
pub const DOUBT_OF_LOGS: &str = "a log does not start programs";

/// The reason why a file of this text is not the user's own; `None` for one that is.
pub fn doubt(path: &Path, text: &str) -> Option<String> {
    let here = std::env::current_dir().and_then(|here| here.canonicalize());
    let (Ok(real), Ok(here)) = (path.canonicalize(), here) else {
        return Some("the file cannot be found again".into());
    };
    if let Some(doubt) = doubt_of_place(&real, &here) {
        return Some(doubt);
    }
    // Nobody else can change what is there now: it is what was read, or that came from elsewhere.
    let is_same = swerve_text::read_bytes(&real, swerve_text::FILE_MAX)
        .is_ok_and(|bytes| without_mark(&bytes) == without_mark(text.as_bytes()));
    (!is_same).then(|| "the file changed while it was read".into())
}

/// Text without the byte-order mark of UTF-8.
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

/// The reason why others may have written a file or folder.
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

/// Lists the programs of a configuration, a line each, as in `process.far.start runs `ssh far``.
pub fn programs(config: &Config) -> Vec<String> {
    config.programs().map(|program| format!("{} runs `{}`", program.key, shown(&program.words))).collect()
}

/// As [`programs`], with the reasons why some take `--allow-code`.
pub fn programs_with_doubts(config: &Config) -> Vec<String> {
    let line = |(line, name): (String, &String)| match config.refusal(name) {
        Some(refusal) => format!("{line}, with --allow-code only ({})", refusal.why),
        None => line,
    };
    let named = config.process.keys().filter(|name| config.names_program(name));
    programs(config).into_iter().zip(named).map(line).collect()
}

/// Reports on standard error the programs that a drive starts; before the drive, so that a refusal has no other effect.
///
/// # Errors
/// One that the user has not consented to.
pub fn start(config: &Config) -> anyhow::Result<()> {
    check(config, config.process.keys())?;
    programs(config).iter().for_each(|line| tell(&format!("note: {line}")));
    Ok(())
}

/// Refuses processes whose programs the user has not consented to.
///
/// # Errors
/// All refusals, with key and command line.
pub fn check<'a>(config: &Config, processes: impl IntoIterator<Item = &'a String>) -> anyhow::Result<()> {
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

    /// Whether a file is the user's own, seen from a folder.
    fn place(file: &Path, here: &Path) -> String {
        let [file, here] = [file, here].map(|path| path.canonicalize().unwrap());
        doubt_of_place(&file, &here).unwrap_or_default()
    }

    #[test]
    fn own_files_are_those_below_the_current_folder_that_nobody_else_can_write() {
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
    fn text_that_was_read_elsewhere_is_not_trusted() {
        // Unit tests run in the folder of their crate.
        let manifest = Path::new("Cargo.toml");
        let text = std::fs::read_to_string(manifest).unwrap();
        assert_eq!(doubt(manifest, &text), None);
        assert_eq!(doubt(manifest, &(text + " ")).unwrap(), "the file changed while it was read");
        assert!(doubt(Path::new("/proc/self/status"), "").is_some());
    }
}
