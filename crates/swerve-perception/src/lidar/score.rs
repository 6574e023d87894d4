//! Score of a candidate box: boosted trees over features of its cluster.

use core::fmt::Write as _;

use swerve_geom::math;
use swerve_msg::ActorKind;

use super::boxes::CLASSES;

/// Number of features of a candidate.
pub const FEATURES: usize = 16;
/// Feature names, by index.
pub const FEATURE_NAMES: [&str; FEATURES] = [
    "range_m",
    "points_ln",
    "seen_length_m",
    "seen_width_m",
    "top_m",
    "lowest_m",
    "closeness",
    "expected_points_ln",
    "inside_share",
    "clutter_share",
    "floor_points_ln",
    "off_axis_rad",
    "off_road_axis_rad",
    "added_length_m",
    "spread_m",
    "beyond_road_m",
];
/// Splits of a tree: the root, then level by level.
pub const SPLITS: usize = 7;
/// Leaves of a tree.
pub const LEAVES: usize = 8;

/// Complete binary tree of three levels.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Tree {
    /// Feature and threshold of each split; smaller values go left. The children of split `k` are
    /// `2k + 1` and `2k + 2`.
    pub splits: [(u8, f32); SPLITS],
    /// Contribution of each leaf to the log-odds, from left to right.
    pub leaves: [f32; LEAVES],
}

/// Sum of trees: the log-odds of a class.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Ensemble {
    /// Initial value of the sum.
    pub bias: f32,
    /// Trees, in the order of summation.
    pub trees: Vec<Tree>,
}

/// Classifier of candidates: an ensemble for each class.
#[derive(Clone, PartialEq, Debug)]
pub struct Model {
    /// Ensembles, in the order of the classes.
    pub classes: Vec<(ActorKind, Ensemble)>,
}

/// Header of a weights file: type and format version.
const HEAD: &str = "swerve lidar objects 1";

impl Tree {
    /// Index of the leaf reached by a candidate.
    pub fn leaf(&self, features: &[f32; FEATURES]) -> usize {
        let mut at = 0;
        while at < SPLITS {
            let (feature, threshold) = self.splits[at];
            at = 2 * at + if features[usize::from(feature)] < threshold { 1 } else { 2 };
        }
        at - SPLITS
    }
}

impl Ensemble {
    /// Log-odds of a candidate.
    pub fn sum(&self, features: &[f32; FEATURES]) -> f32 {
        self.trees.iter().fold(self.bias, |sum, tree| sum + tree.leaves[tree.leaf(features)])
    }

    /// Score, 0 to 1.
    pub fn score(&self, features: &[f32; FEATURES]) -> f64 {
        1.0 / (1.0 + math::exp(-f64::from(self.sum(features))))
    }
}

impl Model {
    /// Built-in model, created by `swerve train lidar`.
    pub fn shipped() -> Self {
        Self::parse(include_str!("weights.txt")).expect("the weights that are shipped are read in a test")
    }

    /// Ensemble of a class.
    pub(super) fn of(&self, class: usize) -> &Ensemble {
        &self.classes[class].1
    }

    /// Serialises to text: a header, remarks, then for each class its bias, and for each tree its splits and leaves.
    pub fn text(&self, remarks: &[String]) -> String {
        let mut text = format!("{HEAD}\n");
        for remark in remarks {
            let _ = writeln!(text, "# {remark}");
        }
        for (kind, ensemble) in &self.classes {
            let _ = writeln!(text, "class {} {}", name(*kind), ensemble.bias);
            for tree in &ensemble.trees {
                text += "tree";
                for (feature, threshold) in tree.splits {
                    let _ = write!(text, " {feature}<{threshold}");
                }
                for leaf in tree.leaves {
                    let _ = write!(text, " {leaf}");
                }
                text += "\n";
            }
        }
        text
    }

    /// Parses the output of [`text`](Self::text).
    ///
    /// # Errors
    /// The first invalid line, with its number from 1.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut classes: Vec<(ActorKind, Ensemble)> = Vec::new();
        if text.lines().next() != Some(HEAD) {
            return Err(format!("line 1: expected `{HEAD}`"));
        }
        for (k, line) in text.lines().enumerate().skip(1) {
            let wrong = |what: &str| format!("line {}: expected {what}, found `{line}`", k + 1);
            let mut words = line.split_whitespace();
            match words.next() {
                None => {}
                Some("#") => {}
                Some("class") => {
                    let wanted = CLASSES.get(classes.len()).map(|class| class.kind);
                    let kind = wanted.filter(|kind| words.next() == Some(name(*kind)));
                    let bias = words.next().and_then(number);
                    let (Some(kind), Some(bias)) = (kind, bias) else {
                        return Err(wrong("the next class and its bias"));
                    };
                    classes.push((kind, Ensemble { bias, trees: Vec::new() }));
                }
                Some("tree") => {
                    let tree = tree(words).ok_or_else(|| wrong("7 splits and 8 numbers"))?;
                    let (_, ensemble) =
                        classes.last_mut().ok_or_else(|| wrong("a class before its trees"))?;
                    ensemble.trees.push(tree);
                }
                Some(_) => return Err(wrong("`class`, `tree` or a remark")),
            }
        }
        match CLASSES.get(classes.len()) {
            Some(class) => Err(format!("the class `{}` is missing", name(class.kind))),
            None => Ok(Self { classes }),
        }
    }
}

fn tree<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Tree> {
    let mut tree = Tree { splits: [(0, 0.0); SPLITS], leaves: [0.0; LEAVES] };
    for split in &mut tree.splits {
        let (feature, threshold) = words.next()?.split_once('<')?;
        let feature = feature.parse().ok().filter(|feature| usize::from(*feature) < FEATURES)?;
        *split = (feature, number(threshold)?);
    }
    for leaf in &mut tree.leaves {
        *leaf = number(words.next()?)?;
    }
    words.next().is_none().then_some(tree)
}

fn number(word: &str) -> Option<f32> {
    word.parse().ok().filter(|number: &f32| number.is_finite())
}

fn name(kind: ActorKind) -> &'static str {
    match kind {
        ActorKind::Car => "car",
        ActorKind::Truck => "truck",
        ActorKind::Motorcycle => "motorcycle",
        ActorKind::Cyclist => "cyclist",
        ActorKind::Pedestrian => "pedestrian",
        ActorKind::Static => "static",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shipped_weights_survive_a_round_trip() {
        let model = Model::shipped();
        assert!(model.classes.iter().all(|(_, ensemble)| !ensemble.trees.is_empty()));
        assert_eq!(Model::parse(&model.text(&["a remark".into()])).as_ref(), Ok(&model));
    }

    #[test]
    fn parse_reports_the_first_invalid_line() {
        let good = Model::shipped().text(&[]);
        let told = |text: &str| Model::parse(text).unwrap_err();
        assert_eq!(told("swerve lidar objects 2\n"), "line 1: expected `swerve lidar objects 1`");
        assert!(
            told(&good.replacen("class car", "class cat", 1)).starts_with("line 2: expected the next class")
        );
        assert!(told(&good.replacen("tree ", "tree x", 1)).starts_with("line 3: expected 7 splits"));
        assert!(told(&good.replacen("tree ", "tree 99<0 ", 1)).starts_with("line 3: expected 7 splits"));
        assert!(
            told(&format!("{good}leaf\n")).contains("expected `class`, `tree` or a remark, found `leaf`")
        );
        let cut: String = good.lines().take(3).map(|line| format!("{line}\n")).collect();
        assert_eq!(told(&cut), "the class `truck` is missing");
    }
}
