//! Formats of road networks, by the root element of a file and by its name.

/// A format that is read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Format {
    /// ASAM OpenDRIVE: `.xodr`, root element `OpenDRIVE`.
    OpenDrive,
    /// Lanelet2: `.osm`, root element `osm`.
    Lanelet2,
    /// CommonRoad: `.xml`, root element `commonRoad`.
    CommonRoad,
    /// SUMO: `.net.xml`, root element `net`.
    Sumo,
}

/// Formats with the ends of their file names, the longer end first, and their root elements.
const FORMATS: [(Format, &str, &str); 4] = [
    (Format::OpenDrive, ".xodr", "OpenDRIVE"),
    (Format::Lanelet2, ".osm", "osm"),
    (Format::Sumo, ".net.xml", "net"),
    (Format::CommonRoad, ".xml", "commonRoad"),
];

impl Format {
    /// Format of a file: that of its root element, else that of its name, so that its reader reports the wrong element.
    ///
    /// # Errors
    /// If neither belongs to a format.
    pub fn of(file: &str, text: &str) -> Result<Self, String> {
        let root = root(text);
        let file = file.strip_suffix(".gz").unwrap_or(file);
        let by_root = FORMATS.iter().find(|(_, _, name)| root == Some(name));
        let by_name = FORMATS.iter().find(|(_, end, _)| file.ends_with(end));
        by_root.or(by_name).map(|(format, _, _)| *format).ok_or_else(|| {
            let known: Vec<String> =
                FORMATS.iter().map(|(_, end, root)| format!("`{root}` ({end})")).collect();
            let found = root.map_or_else(|| "no XML".to_owned(), |root| format!("`{}`", short(root)));
            format!("expected a road network with the root element {}, found {found}", known.join(", "))
        })
    }
}

fn short(name: &str) -> String {
    name.chars().take(40).collect()
}

/// Name of the first element of an XML text; `None` without one.
fn root(text: &str) -> Option<&str> {
    let mut rest = text.trim_start_matches('\u{feff}');
    loop {
        rest = rest.trim_start().strip_prefix('<')?;
        let end = match rest {
            _ if rest.starts_with("!--") => "-->",
            _ if rest.starts_with('?') => "?>",
            _ if rest.starts_with('!') => ">",
            _ => break,
        };
        rest = &rest[rest.find(end)? + end.len()..];
    }
    let name = &rest[..rest.find(|c: char| c.is_whitespace() || c == '>' || c == '/')?];
    Some(name).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_element_decides_then_the_name() {
        let cases = [
            ("a.xodr", "<OpenDRIVE/>", Ok(Format::OpenDrive)),
            (
                "a.xml",
                "\u{feff}<?xml version=\"1.0\"?>\n<!-- <osm> -->\n<osm version=\"0.6\">",
                Ok(Format::Lanelet2),
            ),
            ("a.xml", "<net>", Ok(Format::Sumo)),
            ("a.net.xml", "<commonRoad>", Ok(Format::CommonRoad)),
            ("a.net.xml", "<nets>", Ok(Format::Sumo)),
            ("a.cr.xml.gz", "", Ok(Format::CommonRoad)),
            ("a.osm", "<!DOCTYPE osm><osm>", Ok(Format::Lanelet2)),
            ("a.kml", "<kml>", Err("found `kml`")),
            ("a.kml", "<", Err("found no XML")),
            ("a.kml", "<!-- open", Err("found no XML")),
        ];
        for (file, text, expected) in cases {
            match (Format::of(file, text), expected) {
                (Ok(found), Ok(expected)) => assert_eq!(found, expected, "{file} {text}"),
                (Err(message), Err(end)) => assert!(message.ends_with(end), "{message}"),
                other => panic!("{file} {text}: {other:?}"),
            }
        }
    }
}
