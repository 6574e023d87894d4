//! Suggestions for a command that there is not.

use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

/// The error with the nearest command that the help lists as its suggestion, in place of one that the help hides; another
/// error as it is.
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
