use super::*;

/// Problems of reading `text` as a form with one key of every kind.
fn said(text: &str, with_lines: bool) -> Vec<String> {
    let document = Document::parse("a.toml", text).unwrap();
    let reading = if with_lines { Reading::of(&document) } else { Reading::without_text("[a]") };
    let top = reading.top(&document.table);
    top.number("share", Range::between(0.0, 1.0));
    top.number_or("speed", 1.0, Range::between(0.1, 10.0));
    top.whole_if_any("count", 1, 9);
    top.truth_if_any("is_on");
    top.text_if_any("note");
    top.one_of_if_any("way", &["left", "right"]);
    for thing in top.tables("thing", |thing| thing.text_if_any("name")) {
        thing.pairs("points", "pairs [s, d]", [Range::between(0.0, 5.0); 2]);
        thing.only_one(&["stay", "go"]);
        thing.finish();
    }
    for name in top.table_if_any("free").iter().flat_map(TableReader::keys) {
        reading.report(&format!("free.{name}"), "is here");
    }
    top.finish();
    reading.into_problems().iter().map(ToString::to_string).collect()
}

#[test]
fn every_problem_has_its_line_and_name() {
    let right = "share = 0.5\nspeed = 3\ncount = 2\nis_on = true\nnote = \"x\"\nway = \"left\"\n\
                 [[thing]]\nname = \"a\"\npoints = [[1, 2.5]]\nstay = 1\n";
    assert_eq!(said(right, true), [""; 0]);
    let wrong = "speed = 0\ncount = 2.5\nis_on = 1\nnote = \" \"\nway = \"lft\"\nspede = 1\n\
                 [[thing]]\nname = \"a\"\npoints = [[1, 2], [1, 9]]\ngo = 1\nstay = 1\n\
                 [[thing]]\npoints = []\ngoo = 1\n[free]\nz = 1\na = 2\n";
    assert_eq!(
        said(wrong, true),
        [
            "a.toml:1: share: is missing: expected a number from 0 to 1",
            "a.toml:1: speed: expected a number from 0.1 to 10, found 0",
            "a.toml:2: count: expected a whole number from 1 to 9, found 2.5",
            "a.toml:3: is_on: expected true or false, found 1",
            "a.toml:4: note: expected a text that is not blank, without control characters, found the text \" \"",
            "a.toml:5: way: expected one of \"left\", \"right\", found \"lft\"; did you mean `left`?",
            "a.toml:6: spede: unknown key; did you mean `speed`?",
            "a.toml:7: thing.a: expected only one of \"stay\", \"go\", found \"stay\", \"go\"",
            "a.toml:9: thing.a.points[1]: expected a pair of a number from 0 to 5 and a number from 0 to 5, \
             found an array of 2",
            "a.toml:12: thing[1]: expected one of \"stay\", \"go\"; did you mean `go`?",
            "a.toml:13: thing[1].points: expected pairs [s, d], found an empty array",
            "a.toml:14: thing[1].goo: unknown key; did you mean `go`?",
            "a.toml:16: free.z: is here",
            "a.toml:17: free.a: is here",
        ]
    );
}

#[test]
fn table_without_text_has_no_lines() {
    assert_eq!(
        said("count = 0\nthing = [3]\n", false),
        [
            "[a]: share: is missing: expected a number from 0 to 1",
            "[a]: count: expected a whole number from 1 to 9, found 0",
            "[a]: thing[0]: expected a table, found 3",
        ]
    );
}

#[test]
fn names_are_limited_in_length_and_other_texts_are_not() {
    let long = "n".repeat(201);
    let document = Document::parse("a.toml", format!("name = \"{long}\"\nnote = \"{long}\"\n")).unwrap();
    let reading = Reading::of(&document);
    let top = reading.top(&document.table);
    assert_eq!(top.text("name"), "");
    assert_eq!(top.paragraph_like("note", "a text", |_| true), Some(long));
    let said = reading.into_problems().to_string();
    assert_eq!(said, "a.toml:1: name: has 201 characters: expected at most 200");
}
