//! The table of contents, the gallery and the change log have the form that their readers expect.

use std::path::PathBuf;

use crate::docs::{links, root, site, words};

/// `docs/SUMMARY.md` is the one table of contents: mdBook reads it, and ignores the text after a link.
#[test]
fn contents_list_every_page_once_by_subject() {
    const SUBJECTS: [&str; 10] = [
        "Contents",
        "Start",
        "Scenarios and maps",
        "Sensors and perception",
        "Planning and control",
        "Studies",
        "Vehicles and ROS 2",
        "Other simulators",
        "Extending",
        "Reference",
    ];
    let contents = std::fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let subjects: Vec<&str> = contents.lines().filter_map(|line| line.strip_prefix("# ")).collect();
    assert_eq!(subjects, SUBJECTS);
    let mut listed = links(&contents);
    listed.sort();
    let names = site().into_iter().map(|page| page.strip_prefix("docs").unwrap().to_owned());
    let mut pages: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
    pages.retain(|page| page != "SUMMARY.md");
    pages.sort();
    assert_eq!(listed, pages, "docs/SUMMARY.md lists each page of docs/ once");
    let other = std::fs::read_to_string(root().join("docs/README.md")).unwrap();
    assert!(!other.contains("- ["), "docs/README.md has a list of links: expected it in docs/SUMMARY.md");
}

/// Below each picture of the gallery is the command that makes it; each picture of `docs/img` is on a page.
#[test]
fn pictures_have_commands_and_pages() {
    let gallery = std::fs::read_to_string(root().join("docs/gallery.md")).unwrap();
    let pictures: Vec<&str> = gallery.split("![").skip(1).collect();
    for picture in &pictures {
        let (_, below) = picture.split_once("```sh\n").unwrap_or_default();
        let command = below.split("```").next().unwrap_or_default();
        let has_command = words(command).first().is_some_and(|word| word == "swerve");
        let name = picture.split([']', '\n']).next().unwrap_or_default();
        assert!(has_command, "docs/gallery.md: no command of swerve below the picture `{name}`");
    }
    assert!(pictures.len() >= 15, "only {} pictures found", pictures.len());
    let pages = site().into_iter().chain([PathBuf::from("README.md")]);
    let pages: String = pages.map(|page| std::fs::read_to_string(root().join(page)).unwrap()).collect();
    for entry in std::fs::read_dir(root().join("docs/img")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(pages.contains(&format!("img/{name})")), "docs/img/{name} is on no page");
    }
}

/// Changes are short lines under four headings, the newest version first, with an empty place for the next one.
#[test]
fn changelog_has_short_lines_in_groups() {
    let text = std::fs::read_to_string(root().join("CHANGELOG.md")).unwrap();
    let versions: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("## ")).collect();
    assert_eq!(versions.first(), Some(&"[Unreleased]"), "{versions:?}");
    let changes = text.lines().filter(|line| line.starts_with("- "));
    for line in changes.clone() {
        assert!(line.chars().count() <= 220 && line.ends_with('.'), "expected one short sentence: {line}");
    }
    assert!(changes.count() >= 50, "changes are missing");
    for group in text.lines().filter_map(|line| line.strip_prefix("### ")) {
        assert!(["Breaking", "Added", "Changed", "Fixed"].contains(&group), "unknown group {group}");
    }
}

/// `CITATION.cff` is of the newest version in the change log.
#[test]
fn citation_has_the_newest_version() {
    let read = |name: &str| std::fs::read_to_string(root().join(name)).unwrap();
    let (changes, citation) = (read("CHANGELOG.md"), read("CITATION.cff"));
    let newest = changes.lines().filter_map(|line| line.strip_prefix("## [")).nth(1).unwrap();
    let (version, date) = newest.split_once("] - ").unwrap();
    let expected = format!("version: {version}\ndate-released: {date}\n");
    assert!(citation.contains(&expected), "CITATION.cff: expected `{}`", expected.trim_end());
}
