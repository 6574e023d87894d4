//! Tables and values of any form, in schemas.

use std::collections::BTreeMap;

use schemars::JsonSchema;

/// A table whose keys depend on other keys, in schemas.
pub(crate) type AnyTable = BTreeMap<String, AnyValue>;

/// Any value, in schemas.
pub(crate) struct AnyValue;

impl JsonSchema for AnyValue {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "AnyValue".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        true.into()
    }
}
