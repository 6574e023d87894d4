//! Text of a map file, with the map in it.

use core::fmt;
use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use swerve_map_io::MapFile;

/// Text of a map file. The map is read once: copies share it, and so do the scenarios that are read on it.
#[derive(Clone)]
pub struct MapText(Arc<Shared>);

struct Shared {
    text: Box<str>,
    /// The map, with the file name that it was first read by.
    read: OnceLock<(String, Arc<MapFile>)>,
}

impl MapText {
    /// The map; `file` is the name of the file, which decides its format if the root element does not.
    ///
    /// # Errors
    /// All faults of the file, as [`MapFile::read`].
    pub fn file(&self, file: &str) -> Result<Arc<MapFile>, String> {
        if let Some((name, read)) = self.0.read.get()
            && name == file
        {
            return Ok(Arc::clone(read));
        }
        let read = Arc::new(MapFile::read(file, &self.0.text)?);
        let _first = self.0.read.set((file.to_owned(), Arc::clone(&read)));
        Ok(read)
    }
}

impl From<String> for MapText {
    fn from(text: String) -> Self {
        Self(Arc::new(Shared { text: text.into(), read: OnceLock::new() }))
    }
}

impl From<&str> for MapText {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl Deref for MapText {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0.text
    }
}

impl PartialEq for MapText {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.0.text == other.0.text
    }
}

impl fmt::Debug for MapText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MapText({} bytes)", self.0.text.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NET: &str = include_str!("../../swerve-map-io/maps/junction.net.xml");

    #[test]
    fn map_is_read_once_by_each_name() {
        let text = MapText::from(NET);
        let first = text.file("a.net.xml").unwrap();
        assert!(Arc::ptr_eq(&first, &text.clone().file("a.net.xml").unwrap()), "copies share it");
        assert!(!Arc::ptr_eq(&first, &text.file("b.net.xml").unwrap()), "messages have the name of the file");
        assert_eq!((&*text, &text), (NET, &MapText::from(NET)));
        let wrong = MapText::from("<net/>");
        assert!(wrong.file("c.net.xml").unwrap_err().starts_with("c.net.xml:1:"));
    }
}
