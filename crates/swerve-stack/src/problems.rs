//! Problems of settings, by key.

use swerve_core::{ParamError, Ranges};
use swerve_text::{KeyProblem, did_you_mean};

/// Problems of settings, by key.
pub type KeyProblems = Vec<(String, String)>;

/// Problems of all numbers out of their ranges.
pub(crate) fn problems_of_ranges(settings: &impl Ranges) -> Vec<KeyProblem> {
    settings.out_of_range().into_iter().map(problem).collect()
}

/// Problem of a parameter out of its range.
pub(crate) fn problem(error: ParamError) -> KeyProblem {
    let message = format!("expected {}, found {}", error.expected, error.value);
    (error.key.into_owned(), message)
}

/// The same as a list.
pub(crate) fn outside(error: ParamError) -> Vec<KeyProblem> {
    vec![problem(error)]
}

/// Problems of the table at dotted `key`, which is empty for the whole configuration.
pub(crate) fn within(key: &str, problems: Vec<KeyProblem>) -> Vec<KeyProblem> {
    let whole = |inner: String| match (key.is_empty(), inner.is_empty()) {
        (true, _) => inner,
        (_, true) => key.to_owned(),
        _ => format!("{key}.{inner}"),
    };
    problems.into_iter().map(|(inner, message)| (whole(inner), message)).collect()
}

/// End of an error message about an unknown name.
pub(crate) fn one_of(name: &str, names: &[&str]) -> String {
    let near = did_you_mean(name, names.iter().copied());
    if names.is_empty() {
        ", and there is none".to_owned()
    } else {
        format!(", expected one of {}{near}", names.join(", "))
    }
}
