use std::collections::BTreeMap;

use super::*;
use serde::Deserialize;

#[derive(Deserialize, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[serde(rename_all = "snake_case")]
enum Way {
    Left,
    Right,
}

#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only read through its errors")]
struct Inner {
    number: f64,
    count: Option<usize>,
    way: Way,
    ways: Option<Vec<Way>>,
    pair: Option<[f64; 2]>,
    #[serde(default)]
    name: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only read through its errors")]
struct Outer {
    #[serde(default)]
    by_way: BTreeMap<Way, f64>,
    is_on: bool,
    inner: Inner,
    #[serde(default)]
    list: Vec<Inner>,
}

fn said(text: &str) -> Vec<String> {
    let table: Table = text.parse().unwrap();
    let found = read::<Outer>(&table).err().unwrap_or_default();
    found.iter().map(|(key, message)| format!("{key}: {message}")).collect()
}

#[test]
fn correct_form_has_no_problems() {
    assert_eq!(said("is_on = true\n[inner]\nnumber = 1\nway = \"left\"\npair = [1, 2.5]\n"), [""; 0]);
}

#[test]
fn every_problem_is_reported_in_terms_of_toml() {
    let text = "is_on = 1\n[inner]\nnumber = \"far\"\ncount = -1\nway = 5\nways = [\"left\", \"rigt\"]\n\
                pair = [1]\nname = 1e308\nnmae = 1\n[[list]]\n[[list]]\nnumber = [1]\nway = \"up\"\nother = 3\n";
    let mut said = said(text);
    said.sort();
    let ways = "one of \"left\", \"right\"";
    assert_eq!(
        said,
        [
            "inner.count: expected a whole number that is not negative, found -1".to_owned(),
            "inner.name: expected a text, found 1e308".into(),
            "inner.nmae: unknown key; did you mean `name`?".into(),
            "inner.number: expected a number, found the text \"far\"".into(),
            "inner.pair: expected an array of 2 values, found an array of 1".into(),
            format!("inner.way: expected {ways}, found 5"),
            format!("inner.ways[1]: expected {ways}, found \"rigt\"; did you mean `right`?"),
            "is_on: expected true or false, found 1".into(),
            "list[0].number: is missing: expected a number".into(),
            format!("list[0].way: is missing: expected {ways}"),
            "list[1].number: expected a number, found an array of 1".into(),
            "list[1].other: unknown key; expected one of \"number\", \"count\", \"way\", \"ways\", \"pair\", \"name\"".into(),
            format!("list[1].way: expected {ways}, found \"up\""),
        ]
    );
}

#[test]
fn contents_of_a_wrong_value_are_not_reported() {
    assert_eq!(said("is_on = true\ninner = 5\n"), ["inner: expected a table, found 5"]);
    assert_eq!(
        said(""),
        ["is_on: is missing: expected true or false", "inner: is missing: expected a table"]
    );
    let ways = "one of \"left\", \"right\"";
    assert_eq!(
        said("is_on = true\nby_way = { up.far = 1 }\n[inner]\nnumber = 1\nway = { left = 1 }\n"),
        [
            format!("by_way.up: expected {ways}, found \"up\""),
            format!("inner.way: expected {ways}, found a table"),
        ]
    );
    assert_eq!(
        said("is_off = true\ninner = 5\n"),
        ["inner: expected a table, found 5", "is_off: unknown key; did you mean `is_on`?"]
    );
}

/// All forms in configurations: maps, lists, options, arrays of a fixed length, enums with and without content.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only read through its errors")]
struct Shapes {
    number: f64,
    whole: u8,
    way: Way,
    inner: Option<Inner>,
    pair: Option<[f64; 2]>,
    places: Option<Vec<[f64; 3]>>,
    lens: Option<Lens>,
    #[serde(default)]
    named: BTreeMap<String, Inner>,
    #[serde(default)]
    costs: BTreeMap<Way, BTreeMap<Way, Inner>>,
    #[serde(default)]
    any: Table,
    tuple: Option<(f64, String)>,
}

#[derive(Deserialize, Debug)]
#[serde(rename_all = "snake_case")]
#[expect(dead_code, reason = "only read through its errors")]
enum Lens {
    Plain,
    Angle(f64),
    Matrix([[f64; 3]; 3]),
    Barrel { k1: f64, inner: Box<Inner> },
}

const NAMES: [&str; 14] = [
    "number", "whole", "way", "inner", "pair", "places", "lens", "named", "costs", "any", "tuple", "angle",
    "left", "k1",
];

/// Plausible mistakes: values of every kind, nested, under correct and wrong keys.
fn odd_value() -> impl proptest::strategy::Strategy<Value = Value> {
    use proptest::prelude::*;
    let leaf = prop_oneof![
        any::<i64>().prop_map(Value::Integer),
        any::<f64>().prop_map(Value::Float),
        any::<bool>().prop_map(Value::Boolean),
        proptest::sample::select(&["left", "right", "plain", "x", ""][..]).prop_map(Value::from),
        Just(Value::Datetime("1979-05-27".parse().unwrap())),
    ];
    leaf.prop_recursive(4, 24, 4, |inner| {
        prop_oneof![
            proptest::collection::vec(inner.clone(), 0..4).prop_map(Value::Array),
            odd_table(inner).prop_map(Value::Table),
        ]
    })
}

fn odd_table(
    values: impl proptest::strategy::Strategy<Value = Value>,
) -> impl proptest::strategy::Strategy<Value = Table> {
    use proptest::strategy::Strategy as _;
    let entry = (proptest::sample::select(&NAMES[..]), values);
    proptest::collection::vec(entry, 0..6)
        .prop_map(|entries| entries.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
}

#[test]
fn every_reading_terminates_with_a_result() {
    use proptest::prelude::*;
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: 2_000,
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    let check = |table: Table| {
        if let Err(problems) = read::<Shapes>(&table) {
            prop_assert!(!problems.is_empty() && problems.len() <= PROBLEMS_MAX);
            for (key, message) in &problems {
                prop_assert!(!key.is_empty() && !message.is_empty(), "{key}: {message}");
                prop_assert!(!message.contains("struct ") && !message.contains("f64"), "{key}: {message}");
            }
        }
        Ok(())
    };
    runner.run(&odd_table(odd_value()), check).unwrap();
}

#[test]
fn array_is_not_accepted_as_a_table() {
    let right = "number = 1\nwhole = 1\nway = \"left\"\n";
    let said = |text: &str| {
        let table: Table = format!("{right}{text}").parse().unwrap();
        let found = read::<Shapes>(&table).err().unwrap_or_default();
        found.iter().map(|(key, message)| format!("{key}: {message}")).collect::<Vec<_>>()
    };
    assert_eq!(said(""), [""; 0]);
    assert_eq!(said("named = { x = [1] }\n"), ["named.x: expected a table, found an array of 1"]);
    assert_eq!(said("inner = [1.0, 2, \"left\"]\n"), ["inner: expected a table, found an array of 3"]);
    assert_eq!(said("named = []\n"), ["named: expected a table, found an array of 0"]);
    assert_eq!(said("any = [1]\n"), ["any: expected a table, found an array of 1"]);
    assert_eq!(said("lens.barrel = [1, 2]\n"), ["lens.barrel: expected a table, found an array of 2"]);
    assert_eq!(
        said("pair = [1, 2, 3]\nplaces = [[1, 2, 3], [1, 2]]\n"),
        [
            "pair: expected an array of 2 values, found an array of 3",
            "places[1]: expected an array of 3 values, found an array of 2",
        ]
    );
}

#[test]
fn enums_with_content_are_read() {
    let lens = |text: &str| {
        let table: Table = format!("number = 1\nwhole = 1\nway = \"left\"\nlens = {text}\n").parse().unwrap();
        read::<Shapes>(&table).map(|shapes| shapes.lens)
    };
    assert!(matches!(lens("\"plain\""), Ok(Some(Lens::Plain))));
    assert!(matches!(lens("{ angle = 2 }"), Ok(Some(Lens::Angle(2.0)))));
    assert!(matches!(lens("{ barrel = { k1 = 1, inner = { number = 1, way = \"left\" } } }"), Ok(Some(_))));
    assert_eq!(
        lens("{ barrel = { inner = { number = true, way = \"left\" } } }").unwrap_err(),
        [
            ("lens.barrel.inner.number".to_owned(), "expected a number, found true".to_owned()),
            ("lens.barrel.k1".to_owned(), "is missing: expected a number".to_owned()),
        ]
    );
    let names = "expected one of \"plain\", \"angle\", \"matrix\", \"barrel\", found a table";
    assert_eq!(lens("{ angle = 2, plain = {} }").unwrap_err(), [("lens".to_owned(), names.to_owned())]);
}

/// The intended value is read after misspellings are corrected; values that are not from the text are marked as
/// guessed.
#[test]
fn repaired_value_is_read() {
    let misread = |text: &str| {
        let table: Table = text.parse().unwrap();
        read_meant::<Inner>(&table).expect_err("wrong on purpose")
    };
    let slips = misread("nubmer = 2.5\nway = \"rigth\"\ncount = 3\nnmae = 4\n");
    assert_eq!(slips.problems.len(), 3, "{:?}", slips.problems);
    let meant = slips.meant.expect("every slip has a near name");
    assert_eq!((meant.number, meant.way, meant.count), (2.5, Way::Right, Some(3)));
    // A misspelt key whose value would also be wrong under the correct name.
    assert_eq!(meant.name, "");
    for (key, is_guessed) in
        [("number", true), ("nubmer", true), ("way", true), ("name", true), ("count", false), ("", true)]
    {
        assert_eq!(slips.guessed.holds(key), is_guessed, "{key}");
    }
    let several = misread("number = 1\nway = \"left\"\ncount = -1\nother = 2\npair = [1, 2]\n");
    let meant = several.meant.expect("what is optional can be left out");
    assert_eq!((meant.count, meant.pair), (None, Some([1.0, 2.0])));
}
