//! Keys and kinds that were renamed or removed: the error for an old one names its replacement.

use swerve_text::KeyProblem;

/// Old and present name of every renamed key; `*` is one name.
const RENAMED: [(&str, &str); 10] = [
    ("planning.config", "planning.discretisation"),
    ("perception.params.distance_spread_m", "perception.params.distance_scale_m"),
    ("perception.params.half_share", "perception.params.half_visibility"),
    ("perception.params.share_spread", "perception.params.visibility_scale"),
    ("perception.params.ghosts_per_frame", "perception.params.false_positives_per_frame"),
    ("perception.params.score_gap", "perception.params.score_separation"),
    ("perception.params.missed", "perception.params.misses"),
    ("perception.params.ghosts", "perception.params.false_positives"),
    ("perception.params.misplaced", "perception.params.pose_errors"),
    ("perception.params.*.steady", "perception.params.*.correlation"),
];

/// Removed keys with the reason or the replacement.
const REMOVED: [(&str, &str); 2] = [
    ("render.threads", "--threads sets the threads of the whole run"),
    ("perception.calibration", "`swerve calibrate detector` writes it as a comment"),
];

/// Removed kinds of operators with the replacement.
const REMOVED_KINDS: [(&str, &str); 2] = [
    (
        "stop_lines",
        "the operator `behaviour` is in every pipeline and obeys lights; remove this table and what reads it",
    ),
    ("linear_predictor", "it was renamed to `predictor`"),
];

/// The reason or the replacement of a kind that was removed.
pub(crate) fn removed_kind(kind: &str) -> Option<&'static str> {
    REMOVED_KINDS.iter().find(|(old, _)| *old == kind).map(|(_, why)| *why)
}

/// The problem, with the present name if its key is an old one.
pub(crate) fn with_present_name((key, message): KeyProblem) -> KeyProblem {
    let parts: Vec<&str> = key.split('.').collect();
    let is = |old: &str| {
        let old: Vec<&str> = old.split('.').collect();
        old.len() == parts.len() && old.iter().zip(&parts).all(|(old, part)| *old == "*" || old == part)
    };
    let removed =
        REMOVED.iter().find(|(old, _)| is(old)).map(|(_, why)| format!("this key was removed: {why}"));
    let renamed = || {
        let (_, new) = RENAMED.iter().find(|(old, _)| is(old))?;
        let name = new.rsplit('.').next()?;
        Some(format!("this key was renamed to `{name}`"))
    };
    let message = removed.or_else(renamed).unwrap_or(message);
    (key, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(key: &str) -> String {
        with_present_name((key.to_owned(), "unknown key".to_owned())).1
    }

    #[test]
    fn error_of_an_old_key_names_the_present_one() {
        assert_eq!(message("perception.params.half_share"), "this key was renamed to `half_visibility`");
        assert_eq!(message("perception.params.misses.steady"), "this key was renamed to `correlation`");
        assert!(message("perception.calibration").starts_with("this key was removed: "));
        assert_eq!(message("perception.params.half_visibility"), "unknown key");
    }

    #[test]
    fn page_on_upgrading_has_every_old_name() {
        let page = include_str!("../../../../docs/howto/upgrade.md");
        let keys =
            RENAMED.iter().flat_map(|(old, new)| [*old, *new]).chain(REMOVED.iter().map(|(old, _)| *old));
        for name in keys.chain(REMOVED_KINDS.iter().map(|(old, _)| *old)) {
            let last = name.rsplit('.').next().unwrap();
            assert!(page.contains(last), "{name} is missing");
        }
    }
}
