//! How sure it is that a box is what it is taken for: boosted trees over a few numbers of its cluster.

use core::fmt::Write as _;

use swerve_geom::math;
use swerve_msg::ActorKind;

use super::boxes::CLASSES;

/// Numbers of a candidate that its score comes from.
pub const FEATURES: usize = 16;
/// What they are, by their places.
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
/// Splits of a tree: its root, then level by level.
pub const SPLITS: usize = 7;
/// Ends of a tree.
pub const LEAVES: usize = 8;

/// A whole tree of three levels.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Tree {
    /// Feature and threshold of each split: below it to the left. The two below split `k` are `2k + 1` and `2k + 2`.
    pub splits: [(u8, f32); SPLITS],
    /// What each end adds to the logarithm of the odds, from left to right.
    pub leaves: [f32; LEAVES],
}

/// A sum of trees: the logarithm of the odds.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Ensemble {
    /// What the sum begins with.
    pub bias: f32,
    /// Summed in this order.
    pub trees: Vec<Tree>,
}

/// What tells objects: an ensemble for each class.
#[derive(Clone, PartialEq, Debug)]
pub struct Model {
    /// In the order of the classes.
    pub classes: Vec<(ActorKind, Ensemble)>,
}

/// First words of a file of weights, and the version of its form.
const HEAD: &str = "swerve lidar objects 1";

impl Tree {
    /// Which end a candidate comes to.
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
    /// The logarithm of the odds.
    pub fn sum(&self, features: &[f32; FEATURES]) -> f32 {
        self.trees.iter().fold(self.bias, |sum, tree| sum + tree.leaves[tree.leaf(features)])
    }

    /// The score, 0 to 1.
    pub fn score(&self, features: &[f32; FEATURES]) -> f64 {
        1.0 / (1.0 + math::exp(-f64::from(self.sum(features))))
    }
}

impl Model {
    /// The one that Swerve is shipped with: `swerve train lidar` made it.
    pub fn shipped() -> Self {
        Self::parse(include_str!("weights.txt")).expect("the weights that are shipped are read in a test")
    }

    /// The ensemble of a class.
    pub(super) fn of(&self, class: usize) -> &Ensemble {
        &self.classes[class].1
    }

    /// As text: a head, remarks, then class by class its bias, and tree by tree its splits and leaves.
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

    /// Reads what [`text`](Self::text) writes.
    ///
    /// # Errors
    /// The first line that is not as expected, with its number from 1.
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
    fn the_shipped_weights_are_read_and_written_alike() {
        let model = Model::shipped();
        assert!(model.classes.iter().all(|(_, ensemble)| !ensemble.trees.is_empty()));
        assert_eq!(Model::parse(&model.text(&["a remark".into()])).as_ref(), Ok(&model));
    }

    #[test]
    fn a_line_that_is_wrong_is_told() {
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
