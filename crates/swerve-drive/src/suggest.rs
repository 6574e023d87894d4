//! Suggestions for unknown commands.

use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

/// Replaces a suggested hidden command by the nearest command listed in the help; returns other errors unchanged.
pub fn visible(error: Error, program: &Command) -> Error {
    if error.kind() != ErrorKind::InvalidSubcommand {
        return error;
    }
    let mut suggesting = Error::new(error.kind()).with_cmd(program);
    for (kind, value) in error.context().filter(|(kind, _)| *kind != ContextKind::SuggestedSubcommand) {
        suggesting.insert(kind, value.clone());
    }
    if let Some(ContextValue::String(wrong)) = error.get(ContextKind::InvalidSubcommand) {
        let listed = program.get_subcommands().filter(|command| !command.is_hide_set());
        if let Some(near) = swerve_text::nearest(wrong, listed.map(Command::get_name)) {
            let near = ContextValue::Strings(vec![near.to_owned()]);
            suggesting.insert(ContextKind::SuggestedSubcommand, near);
        }
    }
    suggesting
}
