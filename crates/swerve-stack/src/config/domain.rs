//! Domain of a model for camera images: the pictures and the weathers in which it holds its figures.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use serde::Deserialize;
use swerve_scene::WeatherPreset;
use swerve_text::Document;
use swerve_vision::shipped;

/// Smallest share of each figure at clear noon that a weather of the domain has.
const HOLDS: f64 = 0.85;

/// Figures of one weather, 0 to 1, by class; larger is better.
pub type Figures = BTreeMap<String, f64>;

/// Images that a model was made for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pictures {
    /// Images of the simulated camera.
    Rendered,
    /// Photographs.
    Photographs,
}

/// Conditions under which a model was measured, and its figures there.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// The model, such as "detector `street`".
    #[serde(skip)]
    pub model: String,
    /// Images that it was made for.
    pub pictures: Pictures,
    /// Measure of the figures, such as "AP50".
    pub measure: String,
    /// Distance up to which objects count, metres.
    pub within_m: Option<f64>,
    /// Smallest height of an object in the image, pixels.
    pub height_min_px: Option<f64>,
    /// Classes that it finds.
    #[serde(default)]
    pub classes: Vec<String>,
    /// Known failures in every weather.
    #[serde(default)]
    pub limits: Vec<String>,
    /// Figures in rendered images, by weather.
    #[serde(default)]
    pub weather: BTreeMap<WeatherPreset, Figures>,
    /// Figures in photographs.
    #[serde(default)]
    pub photographs: Figures,
}

/// Domains of the built-in models, by sort of model and name.
static BUILT_IN: LazyLock<BTreeMap<String, BTreeMap<String, Domain>>> =
    LazyLock::new(|| swerve_text::built_in(shipped::DOMAINS));

impl Domain {
    /// Domain of a built-in model: `sort` is `detector` or `segmentation`. `None` if there is no such model.
    pub fn built_in(sort: &str, name: &str) -> Option<Self> {
        let domain = BUILT_IN.get(sort)?.get(name)?.clone();
        Some(Self { model: format!("{sort} `{name}`"), ..domain })
    }

    /// Domain of a detector: a built-in one, or that of a file of weights, read from the file of the same name with the
    /// ending `.domain.toml`. `None` if there is none.
    ///
    /// # Errors
    /// All problems of the file.
    pub fn of_detector(name: &str) -> Result<Option<Self>, String> {
        if let Some(domain) = Self::built_in("detector", name) {
            return Ok(Some(domain));
        }
        let beside = Path::new(name).with_extension("domain.toml");
        if !Path::new(name).is_file() || !beside.is_file() {
            return Ok(None);
        }
        let document = Document::read(&beside).map_err(|problem| problem.to_string())?;
        let domain = document.to::<Self>().map_err(|problems| {
            let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
            lines.join("; ")
        })?;
        Ok(Some(Self { model: format!("detector `{name}`"), ..domain }))
    }

    /// Reason for which rendered images in this weather are outside the domain, with the figures; `None` if they are
    /// inside, or the domain has no weather.
    pub fn doubt(&self, weather: WeatherPreset) -> Option<String> {
        let (model, name) = (&self.model, weather.name());
        if self.pictures == Pictures::Photographs {
            return Some(format!(
                "{model} was made for photographs, and the images of this run are rendered"
            ));
        }
        let best = self.weather.get(&WeatherPreset::ClearNoon)?;
        let outside = format!("`{name}` is outside the domain of {model}");
        let Some(here) = self.weather.get(&weather) else {
            return Some(format!("{outside}: its {} was not measured there", self.measure));
        };
        let holds =
            |(class, figure): (&String, &f64)| best.get(class).is_none_or(|best| *figure >= HOLDS * best);
        let [now, at_best] = [here, best].map(listed);
        let of = &self.measure;
        (!here.iter().all(holds)).then(|| format!("{outside}: {of} {now} (clear_noon: {at_best})"))
    }
}

fn listed(figures: &Figures) -> String {
    let all: Vec<String> = figures.iter().map(|(class, figure)| format!("{class} {figure:.2}")).collect();
    all.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_model_has_a_domain_with_figures() {
        let named = |sort: &str| BUILT_IN[sort].keys().map(String::as_str).collect::<Vec<_>>();
        let mut detectors: Vec<&str> = shipped::names().collect();
        detectors.sort_unstable();
        assert_eq!(named("detector"), detectors);
        assert_eq!(named("segmentation"), shipped::segmentations().collect::<Vec<_>>());
        for domain in BUILT_IN.values().flat_map(BTreeMap::values) {
            let figures = domain.weather.values().chain([&domain.photographs]).flat_map(BTreeMap::values);
            assert!(figures.clone().all(|figure| (0.0..=1.0).contains(figure)), "{domain:?}");
            assert!(figures.count() > 0 && !domain.measure.is_empty(), "{domain:?}");
            let is_rendered = domain.pictures == Pictures::Rendered;
            assert_eq!(domain.weather.contains_key(&WeatherPreset::ClearNoon), is_rendered, "{domain:?}");
        }
    }

    #[test]
    fn page_has_the_figures_of_the_data() {
        let page = include_str!("../../../../docs/seeing.md");
        let rows =
            page.split("<!-- domain -->").nth(1).unwrap().lines().skip(3).take_while(|line| !line.is_empty());
        let models = [("detector", "street"), ("detector", "hog_street"), ("segmentation", "street")];
        let domains = models.map(|(sort, name)| Domain::built_in(sort, name).unwrap());
        let cell = |figures: Option<&Figures>| {
            let figure = |class: &str| Some(format!("{:.2}", figures?.get(class)?));
            let all: Vec<String> = ["people", "cars", "mean"].into_iter().filter_map(figure).collect();
            all.join(", ")
        };
        let row = |name: &str, of: &dyn Fn(&Domain) -> String| {
            let [street, hog, segmentation] = domains.each_ref().map(of);
            format!("| {name} | {street} | {hog} | {segmentation} |")
        };
        let mut weathers: Vec<WeatherPreset> =
            domains.iter().flat_map(|domain| domain.weather.keys().copied()).collect();
        weathers.sort_unstable();
        weathers.dedup();
        let mut wanted: Vec<String> = weathers
            .into_iter()
            .map(|weather| row(weather.name(), &|domain| cell(domain.weather.get(&weather))))
            .collect();
        wanted.push(row("photographs", &|domain| cell(Some(&domain.photographs))));
        assert_eq!(rows.collect::<Vec<_>>(), wanted);
    }

    #[test]
    fn weather_is_outside_where_a_figure_falls_or_is_missing() {
        let text = "pictures = \"rendered\"\nmeasure = \"AP50\"\n\
            [weather]\nclear_noon = { cars = 0.9, people = 0.8 }\nwet_noon = { cars = 0.8, people = 0.7 }\n\
            clear_night = { cars = 0.85, people = 0.6 }\n";
        let domain = Document::parse("my.domain.toml", text).unwrap().to::<Domain>().unwrap();
        let domain = Domain { model: "detector `my.weights`".into(), ..domain };
        for (weather, doubt) in [
            (WeatherPreset::ClearNoon, None),
            (WeatherPreset::WetNoon, None),
            (
                WeatherPreset::ClearNight,
                Some(
                    "`clear_night` is outside the domain of detector `my.weights`: AP50 cars 0.85, people 0.60 \
                     (clear_noon: cars 0.90, people 0.80)",
                ),
            ),
            (
                WeatherPreset::ClearSunset,
                Some(
                    "`clear_sunset` is outside the domain of detector `my.weights`: its AP50 was not measured there",
                ),
            ),
        ] {
            assert_eq!(domain.doubt(weather).as_deref(), doubt, "{weather:?}");
        }
        let photographs = Domain { pictures: Pictures::Photographs, ..domain };
        assert!(photographs.doubt(WeatherPreset::ClearNoon).unwrap().contains("made for photographs"));
    }

    #[test]
    fn file_of_weights_may_have_a_domain_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let weights = folder.path().join("my.weights");
        let name = weights.to_str().unwrap();
        assert_eq!(Domain::of_detector(name), Ok(None));
        std::fs::write(&weights, b"").unwrap();
        assert_eq!(Domain::of_detector(name), Ok(None));
        let beside = folder.path().join("my.domain.toml");
        std::fs::write(&beside, "pictures = \"rendered\"\nmeasure = \"AP50\"\n").unwrap();
        let domain = Domain::of_detector(name).unwrap().unwrap();
        assert_eq!(
            (&*domain.model, domain.doubt(WeatherPreset::ClearNight)),
            (&*format!("detector `{name}`"), None)
        );
        std::fs::write(&beside, "pictures = \"rendered\"\nmeasure = \"AP50\"\n[weather]\nnight = {}\n")
            .unwrap();
        let said = Domain::of_detector(name).unwrap_err();
        assert!(said.contains("my.domain.toml:4: ") && said.contains("night"), "{said}");
    }
}
