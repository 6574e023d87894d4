use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::{KeyProblem, read};

/// Parameters with some of them changed: tables are merged key by key; other values are replaced.
///
/// # Errors
/// Keys missing from `defaults` and values of another form, each with its key.
///
/// # Panics
/// If `defaults` cannot be serialized as a table.
pub fn overridden<T: Serialize + DeserializeOwned>(
    defaults: &T,
    changes: &Table,
) -> Result<T, Vec<KeyProblem>> {
    let mut table = Table::try_from(defaults).expect("parameters are a table of plain values");
    merge(&mut table, changes);
    read(&table)
}

fn merge(table: &mut Table, changes: &Table) {
    for (key, value) in changes {
        match (table.get_mut(key), value) {
            (Some(Value::Table(old)), Value::Table(new)) => merge(old, new),
            _ => {
                table.insert(key.clone(), value.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Serialize, Deserialize, PartialEq, Debug)]
    #[serde(deny_unknown_fields)]
    struct Outer {
        gain: f64,
        list: Vec<i64>,
        middle: Middle,
    }

    #[derive(Serialize, Deserialize, PartialEq, Debug)]
    #[serde(deny_unknown_fields)]
    struct Middle {
        on: bool,
        inner: Inner,
    }

    #[derive(Serialize, Deserialize, PartialEq, Debug)]
    #[serde(deny_unknown_fields)]
    struct Inner {
        low: f64,
        high: f64,
    }

    fn defaults() -> Outer {
        Outer {
            gain: 1.0,
            list: vec![1, 2],
            middle: Middle { on: true, inner: Inner { low: 0.5, high: 2.0 } },
        }
    }

    fn changed(text: &str) -> Result<Outer, Vec<KeyProblem>> {
        overridden(&defaults(), &text.parse().unwrap())
    }

    #[test]
    fn unnamed_parameters_stay_unchanged() {
        assert_eq!(changed(""), Ok(defaults()));
        let mut wanted = defaults();
        wanted.gain = 3.0;
        wanted.list = vec![7];
        wanted.middle.inner.high = 9.0;
        assert_eq!(changed("gain = 3\nlist = [7]\nmiddle.inner.high = 9\n"), Ok(wanted));
    }

    #[test]
    fn every_problem_has_its_key() {
        let said = changed("gian = 3\nlist = 7\nmiddle.inner = { hihg = 9 }\nmiddle.on = {}\n").unwrap_err();
        assert_eq!(
            crate::in_one_line(&said),
            "`gian`: unknown key; did you mean `gain`?; `list`: expected an array, found 7; \
             `middle.inner.hihg`: unknown key; did you mean `high`?; \
             `middle.on`: expected true or false, found a table"
        );
    }
}
