//! Graphics adapters: reports, selection, and reasons for rejection.

/// Hardware of an adapter.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum AdapterKind {
    /// A GPU: discrete, integrated, or assigned to a virtual machine.
    Gpu,
    /// The CPU, through a software rasteriser.
    Software,
}

impl AdapterKind {
    /// Name in configurations and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::Software => "software",
        }
    }
}

/// An adapter that a driver offers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct AdapterReport {
    /// Name reported by the driver.
    pub name: String,
    /// Graphics API: `vulkan` or `gl`.
    pub api: &'static str,
    /// Name and version of the driver; may be empty.
    pub driver: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub device_type: &'static str,
    /// Hardware of the adapter; `None` if the driver does not report it.
    pub kind: Option<AdapterKind>,
    /// Reason for rejection; `None` if usable.
    pub refused: Option<String>,
}

impl core::fmt::Display for AdapterReport {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} ({}, {}", self.name, self.api, self.device_type)?;
        if !self.driver.is_empty() {
            write!(f, ", {}", self.driver)?;
        }
        write!(f, ")")
    }
}

/// Adapters found by [`probe`](crate::probe).
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Adapters {
    /// All adapters in the order in which they are tried.
    pub found: Vec<AdapterReport>,
    /// Probable reasons, one for each API that offers no adapter.
    pub absent: Vec<String>,
}

impl Adapters {
    /// Selects the adapter for a back end of this kind.
    ///
    /// # Errors
    /// If none is usable, with all reasons.
    pub fn choose(&self, kind: AdapterKind) -> Result<&AdapterReport, NoAdapter> {
        let is_of_kind = |report: &&AdapterReport| report.kind == Some(kind);
        match self.found.iter().filter(is_of_kind).find(|report| report.refused.is_none()) {
            Some(report) => Ok(report),
            None => Err(self.none(kind)),
        }
    }

    /// Reasons why no adapter of a kind is usable.
    pub(crate) fn none(&self, kind: AdapterKind) -> NoAdapter {
        let mut reasons = self.absent.clone();
        for report in &self.found {
            match (&report.refused, report.kind) {
                (Some(why), _) => reasons.push(format!("{report}: {why}")),
                (None, Some(other)) if other != kind => {
                    reasons.push(format!("{report}: is {}", described(other)));
                }
                _ => {}
            }
        }
        NoAdapter { kind, reasons }
    }
}

fn described(kind: AdapterKind) -> &'static str {
    match kind {
        AdapterKind::Gpu => "a graphics processor",
        AdapterKind::Software => "software, not a graphics processor",
    }
}

/// No adapter of the requested kind is usable.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no {} adapter: {}", .kind.name(), .reasons.join("; "))]
pub struct NoAdapter {
    /// Requested kind.
    pub kind: AdapterKind,
    /// Reason for each API and adapter.
    pub reasons: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(kind: AdapterKind, refused: Option<&str>) -> AdapterReport {
        AdapterReport {
            name: "A 1".to_owned(),
            api: "vulkan",
            driver: String::new(),
            device_type: "discrete",
            kind: Some(kind),
            refused: refused.map(str::to_owned),
        }
    }

    #[test]
    fn adapters_choose_the_first_usable_or_report_all_reasons() {
        let mut adapters = Adapters {
            found: vec![
                report(AdapterKind::Software, None),
                report(AdapterKind::Gpu, Some("no device: Parent device is lost")),
            ],
            absent: vec!["gl: no loader: libEGL.so.1 is not installed".to_owned()],
        };
        assert_eq!(adapters.choose(AdapterKind::Software), Ok(&adapters.found[0]));
        let error = adapters.choose(AdapterKind::Gpu).expect_err("it was refused");
        assert_eq!(
            error.to_string(),
            "no gpu adapter: gl: no loader: libEGL.so.1 is not installed; A 1 (vulkan, discrete): is software, \
             not a graphics processor; A 1 (vulkan, discrete): no device: Parent device is lost"
        );
        adapters.found.push(report(AdapterKind::Gpu, None));
        assert_eq!(adapters.choose(AdapterKind::Gpu), Ok(&adapters.found[2]));
    }
}
