//! Suggestions for unknown commands.

use std::ffi::OsString;

use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};
use swerve_stack::config::Config;

/// Replaces the suggestion for an unknown option that is a key of the configuration by `--set`; `words` are those of the
/// command line. Returns other errors unchanged.
pub fn by_key(error: Error, program: &Command, words: &[OsString]) -> Error {
    let Some(ContextValue::String(option)) = error.get(ContextKind::InvalidArg) else { return error };
    let name = option.trim_start_matches('-').split('=').next().unwrap_or_default();
    let takes_keys = words
        .get(1)
        .and_then(|word| program.find_subcommand(word))
        .is_some_and(|command| command.get_arguments().any(|argument| argument.get_long() == Some("set")));
    if error.kind() != ErrorKind::UnknownArgument || !takes_keys || !option.starts_with("--") {
        return error;
    }
    let [key] = &Config::keys_like(name)[..] else { return error };
    let place =
        words.iter().position(|word| word.to_string_lossy().split('=').next() == Some(&format!("--{name}")));
    let given = place.and_then(|place| words[place].to_str());
    let value = given.and_then(|word| word.split_once('=')).map(|(_, value)| value);
    let next = place.and_then(|place| words.get(place + 1)).and_then(|word| word.to_str());
    let value = value.or(next.filter(|next| !next.starts_with('-'))).unwrap_or("VALUE");
    let mut suggesting = Error::new(error.kind()).with_cmd(program);
    let is_advice = |kind: &ContextKind| matches!(kind, ContextKind::Suggested | ContextKind::SuggestedArg);
    for (kind, value) in error.context().filter(|(kind, _)| !is_advice(kind)) {
        suggesting.insert(kind, value.clone());
    }
    let advice = format!("a key of the configuration is set by `--set {key}={value}`");
    suggesting.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![advice.into()]));
    suggesting
}

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

#[cfg(test)]
mod tests {
    use clap::{Arg, Command};

    use super::*;

    /// Message for a command line.
    fn message(words: &[&str]) -> String {
        let set = Arg::new("set").long("set").num_args(1);
        let run = Command::new("run").arg(set).arg(Arg::new("scenario"));
        let program = Command::new("swerve").subcommand(run).subcommand(Command::new("check"));
        let words: Vec<OsString> = words.iter().map(OsString::from).collect();
        let error = program.clone().try_get_matches_from(&words).unwrap_err();
        by_key(error, &program, &words).to_string()
    }

    #[test]
    fn option_with_the_name_of_a_key_is_answered_with_set() {
        for words in [
            &["swerve", "run", "lane", "--planner", "rrt_star"][..],
            &["swerve", "run", "--planner=rrt_star"],
        ] {
            let text = message(words);
            assert!(
                text.contains("`--set planning.planner=rrt_star`") && !text.contains("-- --planner"),
                "{text}"
            );
        }
        assert!(message(&["swerve", "run", "--planner"]).contains("`--set planning.planner=VALUE`"));
        let others = [&["swerve", "check", "--planner"][..], &["swerve", "run", "--qqqqq"]];
        assert!(others.iter().all(|words| !message(words).contains("--set planning")));
    }
}
