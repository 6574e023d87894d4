//! Shell completions and manual pages of the command line.

use std::path::PathBuf;

use anyhow::Context as _;
use clap_complete::Shell;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_report::files::write_whole;
use swerve_report::output::print;

/// `swerve completions`.
#[derive(clap::Args, Debug)]
pub(crate) struct CompletionsArgs {
    /// Shell; store the script where it looks for it, e.g. ~/.local/share/bash-completion/completions/swerve
    shell: Shell,
}

/// `swerve man`.
#[derive(clap::Args, Debug)]
pub(crate) struct ManArgs {
    /// Folder for the pages, one per command
    #[arg(long, default_value = "man")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

/// Prints the completion script of a command line for a shell.
pub(crate) fn completions(args: &CompletionsArgs, mut command: clap::Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "swerve", &mut script);
    print(&String::from_utf8(script)?)
}

/// Writes a page for every command.
pub(crate) fn man(args: &ManArgs, mut command: clap::Command) -> anyhow::Result<()> {
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    command.build();
    let mut count = 0;
    let mut open = vec![command];
    while let Some(command) = open.pop() {
        let mut page = Vec::new();
        clap_mangen::Man::new(command.clone()).render(&mut page)?;
        let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned();
        let file = args.out.join(format!("{name}.1"));
        args.overwrite.check([file.as_path()])?;
        write_whole(&file, &page)?;
        count += 1;
        let shown = |inner: &&clap::Command| !inner.is_hide_set() && inner.get_name() != "help";
        open.extend(command.get_subcommands().filter(shown).cloned());
    }
    print(&format!("{count} pages in {}\n", args.out.display()))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_shell_and_every_command_is_covered() {
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "swerve", &mut script);
            let script = String::from_utf8(script).unwrap();
            assert!(script.contains("calibrate") && script.contains("seed"), "{shell}");
        }
        let folder = tempfile::tempdir().unwrap();
        man(&ManArgs { out: folder.path().to_owned(), overwrite: OverwriteArgs::default() }, Cli::command())
            .unwrap();
        for page in ["swerve.1", "swerve-run.1", "swerve-study-merge.1"] {
            let text = std::fs::read_to_string(folder.path().join(page)).unwrap();
            assert!(text.starts_with(".ie") && text.contains(".SH"), "{page}: {text:.60}");
        }
    }
}
